"""Report of one dive and of several dives side by side, as data and in a real browser."""

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from ground.client import assessment, verdict
from ground.report import dive_charts, dive_data, dives
from ground.report.dive_data import ReportedDive
from mavlink_io.errors import InputError
from sysid.data import dataset as logs
from sysid.data.dataset import Log, VelocitySource
from sysid.data.events import Armed, Failsafe, FailsafeCause, ModeChanged, PlainText
from tests.browser import Page, check_layout, check_print, needs_chromium, opened
from tests.helpers.synthetic_dive import constant, dive, swing

MAX_BYTES = 4_000_000


def reported(log: Log, label: str) -> ReportedDive:
    """Return a dive as the reader of logs gives it."""
    return dive_data.reported_dive(Path(label), label, log)


def good(name: str = "good.mcap") -> ReportedDive:
    events = (
        logs.LogEvent(0.0, Armed()),
        logs.LogEvent(1.0, ModeChanged(None)),
        logs.LogEvent(20.0, PlainText(6, "<b>text</b> </script>")),
    )
    flown = dive(heading_error_deg=swing(1.0), depth_error_m=constant(-0.2))
    t = flown.attitude.time_s
    velocity = logs.Velocity(t, np.full(t.size, 1.3), 0.0 * t, 0.0 * t, VelocitySource.BOTTOM_TRACK)
    return reported(replace(flown, events=events, velocity=velocity), name)


def untrimmed() -> ReportedDive:
    event = logs.LogEvent(150.0, Failsafe(FailsafeCause.LEAK, "Failsafe: Leak -> SURFACE"))
    flown = dive(heading_error_deg=constant(-8.4), rudder_deg=6.05, parameters={"HDG_P": 2.0})
    return reported(replace(flown, events=(event,)), "untrimmed.mcap")


def test_page_begins_with_the_verdict_of_fly() -> None:
    shown = untrimmed()
    html = dives.render([shown])
    assert len(html) < MAX_BYTES
    head = html[html.index("<h1>") : html.index("<h2>")]
    assert "✕</span> Failed" in head
    assert "The rudder trim is not set".lower() in head.lower()
    step = verdict.next_step(shown.assessment)
    assert step[1:40] in re.sub("</?code>", "`", head)
    assert "Failsafe: Leak" in head


def test_text_of_a_log_cannot_become_markup() -> None:
    html = dives.render([good("<i>name</i>.mcap")])
    assert "<b>text</b>" not in html
    assert "<i>name</i>" not in html
    (data,) = re.findall(r'<script id="track-data" type="application/json">(.*?)</script>', html)
    assert json.loads(data)["dives"][0]["name"] == "<i>name</i>.mcap"


def test_outputs_of_unknown_use_are_numbered() -> None:
    """A log without ACT_TRAVEL_DEG and SERVOn_FUNCTION may be of a vehicle with motors alone."""
    flown = reported(replace(good().log, parameters={"HDG_P": 1.0}), "foreign.ulg")
    chart = dive_charts.actuator_chart([flown])
    titles = [chart["layout"][f"yaxis{row}"]["title"]["text"] for row in ("", "2", "3")]
    assert titles == ["output 1, %", "output 2, %", "output 3, %"]
    (track,) = dive_charts.track_data([flown])["dives"]
    assert not track["surfaces"]
    assert set(track["rudder"]) == {0.0}
    assert dive_charts.track_data([good()])["dives"][0]["surfaces"]


def test_positions_of_different_sources_name_their_dives() -> None:
    html = dives.render([good("a"), untrimmed()])
    assert re.search(r"Position: a: integrated from .*; untrimmed\.mcap: heading at", html)
    assert re.search(r"Position: integrated from [^;]*\)\.", dives.render([good("a"), good("b")]))


def test_times_of_texts_count_from_arming() -> None:
    events = (
        logs.LogEvent(50.0, Armed()),
        logs.LogEvent(150.0, Failsafe(FailsafeCause.LEAK, "Failsafe: Leak -> SURFACE")),
    )
    shown = reported(replace(dive(), events=events), "late.mcap")
    assert "100 s after arming" in verdict.headline(shown.assessment)
    assert "-25-" in verdict.format_text(shown.assessment)


def test_dive_that_cannot_be_assessed_says_why_first() -> None:
    text = logs.LogEvent(9.0, PlainText(3, "no barometer found"))
    shown = reported(replace(dive(length_s=20.0), events=(text,)), "short.ulg")
    assert verdict.headline(shown.assessment).startswith("too short: no leg")
    assert verdict.next_step(shown.assessment) == "give each leg at least 60 s"
    assert "no barometer found" in verdict.format_text(shown.assessment)


def test_side_by_side_lists_only_the_parameters_that_differ() -> None:
    html = dives.render([good(), untrimmed()])
    table = html[html.index("Parameter differences") : html.index("<h2>Events")]
    assert "1 of 6 parameters differ" in table
    assert re.search(r"<td>HDG_P</td><td>–</td><td>2</td>", table)
    assert "PTCH_P" not in table


def test_equal_parameters_are_said_to_be_equal() -> None:
    html = dives.render([good("a"), good("b")])
    assert "The 5 parameters of the logs are equal." in html


def test_thinned_curve_keeps_its_extremes_and_gaps() -> None:
    t = np.arange(10_000.0)
    values = np.zeros(t.size)
    values[1234], values[8765], values[5000] = 7.0, -3.0, math.nan
    x, y = dive_charts.thin(t, values, 400)
    assert x.size < 500
    assert np.all(np.diff(x) > 0.0)
    assert (x[0], x[-1]) == (0.0, 9999.0)
    assert (np.nanmax(y), np.nanmin(y)) == (7.0, -3.0)
    assert np.count_nonzero(np.isnan(y)) == 1


def test_track_of_a_circle_closes() -> None:
    """At 1 m/s and 2 pi / 100 rad/s the path is a circle of 100 m; the current adds its drift."""
    flown = dive(length_s=101.0)
    t = flown.attitude.time_s
    yaw = 2.0 * math.pi * t / 100.0
    velocity = logs.Velocity(t, np.ones(t.size), 0.0 * t, 0.0 * t, VelocitySource.BOTTOM_TRACK)
    turning = replace(flown, attitude=replace(flown.attitude, yaw_rad=yaw), velocity=velocity)
    track = dive_data.integrate_track(turning, 0.0)
    at = int(np.argmin(np.abs(track.time_s - 100.0)))
    # 0.1 m is the error of the rectangle rule with 0.1 s at 1 m/s
    assert math.hypot(track.north_m[at], track.east_m[at]) < 0.15
    assert np.max(track.east_m) == pytest.approx(100.0 / math.pi, abs=0.15)
    assert "DVL" in track.source


def test_track_without_velocity_names_its_assumption() -> None:
    track = dive_data.integrate_track(dive(), 0.0)
    assert "assumed 1 m/s" in track.source
    length_m = np.sum(np.hypot(np.diff(track.north_m), np.diff(track.east_m)))
    assert length_m == pytest.approx(200.0, abs=1.0)


def test_heading_chart_is_continuous_within_a_turn() -> None:
    """A heading about north must not jump between 0 and 360 deg."""
    flown = dive(heading_error_deg=lambda t: -20.0 + swing(3.0)(t))
    shown = dive_charts.motion_chart([reported(flown, "north")])
    headings = [t for t in shown["data"] if t["yaxis"] == "y2"]
    assert len(headings) == 2
    values = np.array(headings[1]["y"], float)
    assert np.ptp(values) == pytest.approx(6.0, abs=0.1)
    assert np.mean(headings[0]["y"]) - np.mean(values) == pytest.approx(20.0, abs=0.5)


CSV_ROWS = "".join(f"{k / 5},20,0,0,{3 + 0.01 * (k % 3)},1,0.5,58\n" for k in range(300))


def csv_log(folder: Path) -> Path:
    """Write a log of another program, without set-points."""
    path = folder / "other.csv"
    head = "time_s,heading_deg,pitch_deg,roll_deg,depth_m,rudder_deg,elevator_deg,thrust_pct\n"
    path.write_text(head + CSV_ROWS, encoding="utf-8")
    return path


def test_command_writes_the_report_of_a_foreign_log(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["report", str(csv_log(tmp_path))])
    assert done.exit_code == 0, done.output
    html = (tmp_path / "other-report.html").read_text(encoding="utf-8")
    assert "Not assessed" in html
    assert "no set-points of heading and depth" in html


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["{csv}", "{folder}"], "is a folder; give one campaign, or logs of dives"),
        (["{folder}", "--out", "x.html"], "--out: is for logs of dives"),
        (["{csv}", "--picture", "x.png"], "--picture x.png: is drawn of a campaign"),
        (["{csv}"] * 7, "7 logs: a report shows at most 6 dives"),
        (["{csv}", "--out", "{folder}"], "is a folder; give the name of a file"),
    ],
)
def test_wrong_arguments_are_named(tmp_path: Path, words: list[str], message: str) -> None:
    filled = [word.format(csv=csv_log(tmp_path), folder=tmp_path) for word in words]
    done = CliRunner().invoke(app, ["report", *filled])
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)


PLAYED = """
const at = () => Number(document.querySelector('#track canvas').dataset.time);
const pixels = () => document.querySelector('#track canvas').toDataURL();
const slider = document.getElementById('time');
const done = arguments[arguments.length - 1];
const before = [at(), pixels()];
document.getElementById('play').click();
const began = performance.now();
const wait = () => {
  if (at() > 5 || performance.now() - began > 30000) {
    document.getElementById('play').click();
    const after = at(), value = Number(slider.value), moved = pixels() !== before[1];
    slider.value = 500; slider.dispatchEvent(new Event('input'));
    const cursor = document.querySelector('#motion .cursor');
    done({ before: before[0], after, value, moved, half: at(), cursor: cursor && !cursor.hidden,
           readout: document.getElementById('readout').textContent });
  } else setTimeout(wait, 50);
};
wait();
"""
"""JavaScript: play until 5 s of the dive have passed, then move the slider to its middle."""


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    folder = tmp_path_factory.mktemp("dives")
    (folder / "dives.html").write_text(dives.render([good(), untrimmed()]), encoding="utf-8")
    with opened(folder / "dives.html", folder / "profile") as page_shown:
        yield page_shown


@needs_chromium
@pytest.mark.process
@pytest.mark.timeout(200)
class BrowserTestCase:
    def test_dives_resized_and_turned_keep_their_layout(self, shown: Page) -> None:
        check_layout(shown)

    def test_playback_moves_vehicle_slider_and_cursor(self, shown: Page) -> None:
        seen: dict[str, Any] = shown.run_async(PLAYED)
        assert seen["before"] == 0.0
        assert seen["after"] > 5.0
        assert seen["value"] == pytest.approx(1000.0 * seen["after"] / 199.9, abs=1.0)
        assert seen["moved"]
        assert seen["half"] == pytest.approx(100.0, abs=0.2)
        assert seen["cursor"]
        assert seen["readout"].startswith("depth 2.8")
        assert shown.errors() == []

    def test_print_keeps_headings_with_charts_on_white_paper(self, shown: Page) -> None:
        check_print(shown)


def test_report_and_fly_give_the_same_verdict() -> None:
    shown = untrimmed()
    found = assessment.assess_log(shown.log)
    assert verdict.headline(shown.assessment) == verdict.headline(found)
