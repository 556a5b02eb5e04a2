"""The picture in the terminal: a frame a section, stale values grey, what is wrong red."""

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from ground.live.watch.receiver import ReceivedText, Receiver
from ground.live.watch.rows import WatchRow, rows
from ground.terminal import Escaped, literal

HEARTBEAT_TIMEOUT_S = 3.0
"""Without a heartbeat: when ground stations say that a vehicle is lost."""
WARNING = 4
"""MAV_SEVERITY; what is more urgent has a lower number."""
STALE_STYLE, ALARM_STYLE, LABEL_STYLE = "bright_black", "bold red", "cyan"


def draw(ears: Receiver, now_s: float, followed: RenderableType | None = None) -> RenderableType:
    """The whole view; what was made of ``followed`` telemetry comes first: a low terminal cuts off
    what comes last."""
    if ears.vehicle_id is None:
        return Escaped(
            Panel(_waiting_text(ears, now_s), title=literal(ears.address), border_style="yellow")
        )
    every = rows(ears, now_s)
    sides = Table.grid(expand=True, padding=(0, 1))
    sides.add_column(ratio=1)
    sides.add_column(ratio=1)
    sides.add_row(_section("vehicle", every), _section("motion", every))
    below = Table.grid(expand=True, padding=(0, 1))
    below.add_column(ratio=1)
    below.add_column(ratio=1)
    below.add_row(
        _section("mission", every), Panel(_link(ears, now_s), title="link", border_style="blue")
    )
    told = [] if followed is None else [Panel(followed, border_style="blue")]
    texts = Panel(_texts(ears.texts, now_s), title="texts")
    return Escaped(Group(_headline(ears, now_s), *told, sides, below, texts))


def _waiting_text(ears: Receiver, now_s: float) -> Text:
    waited_s = now_s - ears.began_s
    text = Text(
        f"no vehicle yet, after {waited_s:.0f} s: {ears.trouble or ears.why_nothing()}",
        style="yellow",
    )
    return text.append("\nCtrl-C ends", style=STALE_STYLE)


def _headline(ears: Receiver, now_s: float) -> Text:
    assert ears.vehicle_id is not None
    silent_s = now_s - ears.latest["HEARTBEAT"].at_s
    line = Text(
        f" system {ears.vehicle_id.system}, component {ears.vehicle_id.component}"
        f" on {ears.address}",
        style="bold",
    )
    if silent_s > HEARTBEAT_TIMEOUT_S:
        line.append(f"   no heartbeat for {silent_s:.0f} s", style=ALARM_STYLE)
    if ears.trouble:
        line.append(f"   {ears.trouble}", style=ALARM_STYLE)
    return line


def _section(name: str, every: list[WatchRow]) -> Panel:
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(style=LABEL_STYLE, no_wrap=True)
    table.add_column(ratio=1)
    table.add_column(justify="right", style=STALE_STYLE, no_wrap=True)
    for row in every:
        if row.section == name:
            table.add_row(row.label, _words(row), _age(row))
    return Panel(table, title=name, border_style="blue")


def _words(row: WatchRow) -> Text:
    if row.seen is None:
        return Text("-", style=STALE_STYLE)
    if row.stale:
        return Text(row.seen.words, style=STALE_STYLE)
    return Text(row.seen.words, style=ALARM_STYLE if row.seen.alarm else "")


def _age(row: WatchRow) -> str:
    return "" if row.age_s is None or not row.stale else f"{row.age_s:.0f} s ago"


def _link(ears: Receiver, now_s: float) -> Table:
    rate_bytes, rate_messages = ears.rates(now_s)
    sent = ears.frames + ears.lost_frames
    share = 100.0 * ears.lost_frames / sent if sent else 0.0
    table = Table.grid(padding=(0, 1))
    table.add_column(style=LABEL_STYLE)
    table.add_row("rate", f"{rate_bytes / 1e3:.1f} kB/s, {rate_messages:.0f} messages/s")
    table.add_row(
        "lost",
        Text(f"{ears.lost_frames} ({share:.1f} %)", style=ALARM_STYLE if share > 10.0 else ""),
    )
    table.add_row("broken", f"{ears.rejected_frames}")
    return table


def _texts(texts: Iterable[ReceivedText], now_s: float) -> RenderableType:
    table = Table.grid(padding=(0, 1))
    table.add_column(justify="right", style=STALE_STYLE)
    for said in texts:
        style = (
            ALARM_STYLE if said.severity < WARNING else "yellow" if said.severity == WARNING else ""
        )
        table.add_row(f"{now_s - said.at_s:.0f} s ago", Text(said.text, style=style))
    return table if table.row_count else Text("nothing said yet", style=STALE_STYLE)
