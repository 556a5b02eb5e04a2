"""Output to the terminal has no markup and no control characters from outside."""

import io
import json
import math
import signal
import sys
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from rich.console import Console
from typer.testing import CliRunner

from ground import terminal
from ground.cli import main as command_line
from ground.cli import options
from ground.client.flight import FlightProgress
from ground.client.vehicle import StatusText
from ground.live import estimate_view as live_view
from ground.live.estimate import EstimateStatus
from mavlink_io.errors import InputError, exit_with_error
from mavlink_io.printable import printable, printable_lines
from tests.ground.fake import FakeVehicle, step_while_waiting
from tests.ground.live.test_watch import Sea
from tests.helpers.display import shown_on

ATTACKS = (
    "[/b]",
    "[bold",
    "a\\[/b]",
    "[link=file:///etc/passwd]x[/link]",
    "\x1b[2J\x1b]0;title\x07",
    "\x9b31mred",
    "one\rtwo\nthree\x00\x7f\x08",
    "\u202edelrever\u2066",
    "\u2028\u2029",
    "\ud800",
    ":smile:",
)
FORBIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Unicode categories: C0, C1 and DEL; format characters and bidi overrides; surrogates;
separators."""

ANY = st.one_of(st.text(), st.text(st.sampled_from("[]/\\b\x1b\x9b\u202e\ud800\r\n:{}")))
QUIET = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def forbidden(output: str) -> list[str]:
    """The characters of an output that may reach no terminal; line feeds are the program's own."""
    return [c for c in output if c != "\n" and unicodedata.category(c) in FORBIDDEN]


def attacked(test: Callable[..., None]) -> Callable[..., None]:
    """Run a test of one text with every known attack first, then with any text."""
    for attack in ATTACKS:
        test = example(attack)(test)
    return QUIET(given(ANY)(test))


@attacked
def test_printable_any_text_has_no_control_characters(text: str) -> None:
    safe = printable(text)
    assert forbidden(safe) == []
    assert "\n" not in safe
    assert printable(safe) == safe, "what is escaped twice reads as if escaped once"
    safe.encode()


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("Armed: MISSION", "Armed: MISSION"),
        ("12 m, 3°, Tiefe über Grund", "12 m, 3°, Tiefe über Grund"),
        ("\x1b[2J", "\\x1b[2J"),
        ("a\nb\tc", "a\\nb\\tc"),
        ("\u202e", "\\u202e"),
        ("\udcff", "\\udcff"),
        ("[/b]", "[/b]"),
    ],
)
def test_printable_known_texts(text: str, safe: str) -> None:
    assert printable(text) == safe


@pytest.mark.parametrize(("name", "redrawable"), [("xterm", True), ("dumb", False)])
def test_dumb_terminal_is_not_redrawn(
    name: str, redrawable: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", name)
    page = Console(file=io.StringIO(), force_terminal=True)
    assert terminal.is_redrawable(page) is redrawable


def test_printable_lines_keeps_only_line_feeds() -> None:
    assert printable_lines("a\n  b\r\x85c") == "a\n  b\\r\\x85c"


def test_progress_without_a_terminal_is_one_line_per_period() -> None:
    page = io.StringIO()
    shown = shown_on(page)
    state = FlightProgress(
        item=1, items=6, vehicle_s=60.0, wall_s=2.0, depth_m=3.02, heading_deg=20.4
    )
    for _ in range(3):
        shown.watch_named("square", state)
    shown.show_fraction("8 of 16 dives", 0.5)
    assert page.getvalue().splitlines() == [
        "square: item 2 of 6, 3.0 m deep, heading 20 deg, 60 s at 30x",
        "dive: 50 %, 8 of 16 dives",
    ]


def test_warning_of_a_dive_is_printed_once() -> None:
    page = io.StringIO()
    shown = shown_on(page)
    for warning in ("", "look", "look", "", "look"):
        shown.watch_named("square", FlightProgress(0, 3, 1.0, 1.0, 2.0, 90.0, warning))
    assert page.getvalue().splitlines()[1:] == ["square: look", "square: look"]


@pytest.mark.parametrize(
    ("heading_deg", "shown_deg"), [(359.7, "0 deg"), (359.4, "359 deg"), (math.nan, "– deg")]
)
def test_progress_heading_stays_below_a_turn(heading_deg: float, shown_deg: str) -> None:
    page = io.StringIO()
    shown_on(page).watch_named("square", FlightProgress(0, 3, 1.0, 1.0, 2.0, heading_deg))
    assert f"heading {shown_deg}," in page.getvalue()


@attacked
def test_display_any_text_is_printed_as_it_is(text: str) -> None:
    page = io.StringIO()
    shown = shown_on(page)
    outputs: tuple[Callable[[], None], ...] = (
        lambda: shown.show_text(StatusText(4, text)),
        lambda: shown.print_line(text),
        lambda: shown.announce(text),
    )
    for say in outputs:
        before = page.tell()
        say()
        written = page.getvalue()[before:]
        assert forbidden(written) == []
        assert written.rstrip(" \n") == printable(text).rstrip(" ")


@attacked
def test_display_any_name_of_work_is_drawn(text: str) -> None:
    page = io.StringIO()
    shown = shown_on(page)
    shown.dive = text
    shown.show_fraction(text, 0.5)
    shown.watch_named(text, FlightProgress(0, 3, 1.0, 1.0, 2.0, 90.0))
    terminal.console(file=page, width=200).print(shown.picture())
    assert forbidden(page.getvalue()) == []


@attacked
def test_give_any_words_have_no_control_characters(text: str) -> None:
    page = io.StringIO()
    real, sys.stdout = sys.stdout, page
    try:
        options.print_result({"text": text}, text, False)
        options.print_result({"text": text}, text, True)
    finally:
        sys.stdout = real
    words, _, encoded = page.getvalue().rpartition("\n{")
    assert forbidden(page.getvalue()) == []
    assert words == printable_lines(text)
    assert json.loads("{" + encoded) == {"text": text}


@attacked
def test_watch_any_text_is_drawn(text: str) -> None:
    with closing(Sea()) as sea:
        sea.heartbeat()
        sea.send("STATUSTEXT", severity=2, text=text.encode("utf-8", "replace")[:49])
        sea.receiver.modes = {0: text}
        sea.receiver.trouble = text
        sea.receiver.address = text
        sea.send("HEARTBEAT", type=12, base_mode=1)
        assert forbidden(sea.screen()) == []
        sea.receiver.vehicle_id = None
        assert forbidden(sea.screen()) == []


@attacked
def test_live_estimate_any_trouble_is_drawn(text: str) -> None:
    page = io.StringIO()
    plain = Console(file=page, width=200)
    plain.print(terminal.Escaped(live_view.table(EstimateStatus({}, (), text))))
    assert forbidden(page.getvalue()) == []


@attacked
def test_rendered_any_part_has_no_control_characters(text: str) -> None:
    assert forbidden(terminal.render([text, terminal.heading(text)], 120)) == []


@attacked
def test_error_any_text_is_one_line(text: str) -> None:
    page = io.StringIO()
    real, sys.stderr = sys.stderr, page
    try:
        with pytest.raises(SystemExit):
            exit_with_error("ground", InputError(text))
    finally:
        sys.stderr = real
    assert page.getvalue() == f"ground: {printable(text)}\n"


def test_colour_of_rendered_words_reaches_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    page = terminal.render([terminal.heading("gates"), "\x1b[31mnot ours"], 120)
    assert "\x1b[1mgates" in page
    assert "\\x1b[31mnot ours" in page


@pytest.fixture
def hostile(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeVehicle]:
    """A vehicle whose parameters bear names that move the cursor."""
    from ground.client import vehicle as client

    fake = FakeVehicle(parameters={"\x1b[2J": 1.0, "[/b]": 2.0})
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    monkeypatch.setattr(client, "open_transport", lambda address: fake.ground_end)
    fake.heartbeat()
    yield fake
    fake.close()


def test_params_list_hostile_names_are_escaped(hostile: FakeVehicle) -> None:
    done = CliRunner().invoke(command_line.app, ["params", "list"])
    assert done.exit_code == 0, done.output
    assert forbidden(done.output) == []
    assert "\\x1b[2J" in done.output
    assert "[/b]" in done.output


def usage_error(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Any:
    """Return what `ground` prints for arguments that it does not accept."""
    monkeypatch.setattr(sys, "argv", ["ground", *words])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(SystemExit) as ended:
        command_line.main()
    assert ended.value.code == 2
    return capsys.readouterr()


@pytest.mark.parametrize(
    "words",
    [
        ["fly", "a", "\x1b[2J[/b]"],
        ["--\x1b[2J"],
        ["\x1b[2J"],
        ["log", "list", "\x9b\u202e"],
        ["fly", "a", "--seed", "\x1b"],
    ],
)
def test_usage_error_has_no_control_characters(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = usage_error(words, monkeypatch, capsys)
    assert forbidden(said.out + said.err) == []
    assert "Error" in said.err


@pytest.mark.parametrize("words", [[], ["log"]])
def test_command_without_arguments_prints_its_help_in_lines(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = usage_error(words, monkeypatch, capsys).err.splitlines()
    assert "Commands:" in lines
    assert not any("\\n" in line for line in lines)
