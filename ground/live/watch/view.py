"""Draw the live view: one frame per section, stale values grey, alarms red."""

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from ground.live.watch.receiver import ReceivedText, Receiver
from ground.live.watch.rows import WatchRow, rows
from ground.terminal import Escaped, literal

HEARTBEAT_TIMEOUT_S = 3.0
"""Time without a heartbeat after which ground stations report a lost vehicle (s)."""
WARNING = 4
"""Value of MAV_SEVERITY_WARNING; more urgent texts have lower values."""
STALE_STYLE, ALARM_STYLE, LABEL_STYLE = "bright_black", "bold red", "cyan"


def draw(
    receiver: Receiver, now_s: float, estimate: RenderableType | None = None
) -> RenderableType:
    """Return the whole view.

    The display of the listeners, ``estimate``, comes first because a terminal with few lines cuts
    off the end.
    """
    if receiver.vehicle_id is None:
        return Escaped(
            Panel(
                _waiting_text(receiver, now_s),
                title=literal(receiver.address),
                border_style="yellow",
            )
        )
    every = rows(receiver, now_s)
    sides = Table.grid(expand=True, padding=(0, 1))
    sides.add_column(ratio=1)
    sides.add_column(ratio=1)
    sides.add_row(_section("vehicle", every), _section("motion", every))
    below = Table.grid(expand=True, padding=(0, 1))
    below.add_column(ratio=1)
    below.add_column(ratio=1)
    below.add_row(
        _section("mission", every), Panel(_link(receiver, now_s), title="link", border_style="blue")
    )
    estimates = [] if estimate is None else [Panel(estimate, border_style="blue")]
    texts = Panel(_texts(receiver.texts, now_s), title="texts")
    return Escaped(Group(_headline(receiver, now_s), *estimates, sides, below, texts))


def _waiting_text(receiver: Receiver, now_s: float) -> Text:
    """Return the text while no vehicle was found."""
    waited_s = now_s - receiver.began_s
    text = Text(
        f"no vehicle yet, after {waited_s:.0f} s: {receiver.trouble or receiver.diagnosis()}",
        style="yellow",
    )
    return text.append("\nCtrl-C to quit", style=STALE_STYLE)


def _headline(receiver: Receiver, now_s: float) -> Text:
    """Return the vehicle's address, with an alarm if its heartbeat is missing."""
    assert receiver.vehicle_id is not None
    silent_s = now_s - receiver.latest["HEARTBEAT"].at_s
    system, component = receiver.vehicle_id
    line = Text(f" system {system}, component {component} on {receiver.address}", style="bold")
    if silent_s > HEARTBEAT_TIMEOUT_S:
        line.append(f"   no heartbeat for {silent_s:.0f} s", style=ALARM_STYLE)
    if receiver.trouble:
        line.append(f"   {receiver.trouble}", style=ALARM_STYLE)
    return line


def _section(name: str, every: list[WatchRow]) -> Panel:
    """Return the rows of a section as a panel."""
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(style=LABEL_STYLE, no_wrap=True)
    table.add_column(ratio=1)
    table.add_column(justify="right", style=STALE_STYLE, no_wrap=True)
    for row in every:
        if row.section == name:
            table.add_row(row.label, _value_text(row), _age(row))
    return Panel(table, title=name, border_style="blue")


def _value_text(row: WatchRow) -> Text:
    """Return the value of a row; grey if it is old, red if it is an alarm."""
    if row.cell is None:
        return Text("-", style=STALE_STYLE)
    if row.stale:
        return Text(row.cell.text, style=STALE_STYLE)
    return Text(row.cell.text, style=ALARM_STYLE if row.cell.alarm else "")


def _age(row: WatchRow) -> str:
    return "" if row.age_s is None or not row.stale else f"{row.age_s:.0f} s ago"


def _link(receiver: Receiver, now_s: float) -> Table:
    """Return rates and losses of the link as a table."""
    rate_bytes, rate_messages = receiver.rates(now_s)
    sent = receiver.frames + receiver.lost_frames
    share = 100.0 * receiver.lost_frames / sent if sent else 0.0
    table = Table.grid(padding=(0, 1))
    table.add_column(style=LABEL_STYLE)
    table.add_row("rate", f"{rate_bytes / 1e3:.1f} kB/s, {rate_messages:.0f} messages/s")
    table.add_row(
        "lost",
        Text(f"{receiver.lost_frames} ({share:.1f} %)", style=ALARM_STYLE if share > 10.0 else ""),
    )
    table.add_row("rejected", f"{receiver.rejected_frames}")
    return table


def _texts(texts: Iterable[ReceivedText], now_s: float) -> RenderableType:
    """Return the texts of the vehicle with their ages."""
    table = Table.grid(padding=(0, 1))
    table.add_column(justify="right", style=STALE_STYLE)
    for text in texts:
        style = (
            ALARM_STYLE if text.severity < WARNING else "yellow" if text.severity == WARNING else ""
        )
        table.add_row(f"{now_s - text.at_s:.0f} s ago", Text(text.text, style=style))
    return table if table.row_count else Text("no texts yet", style=STALE_STYLE)
