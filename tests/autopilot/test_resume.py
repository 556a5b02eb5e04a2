"""Mission and state of a dive on disk."""

import json
import math
import os
import time
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.comms.sensor_clock import SensorClock
from autopilot.control import modes
from autopilot.control.setpoints import Circle, TrackLine
from autopilot.control.types import AutopilotState, MissionState
from autopilot.record_json import RecordError, from_json, to_json
from autopilot.resume import MAX_AGE_S, StateFiles, continued_state
from mavlink_io.mission_items import MissionItem
from tests.helpers.fake_hil import Harness

ITEMS = (MissionItem(0, 2, 93, p1=5.0), MissionItem(1, 2, 93, p1=math.nan))


class Inner(NamedTuple):
    where: complex
    path: TrackLine | Circle | None


class Outer(NamedTuple):
    number: int
    value: float
    inner: Inner
    parts: tuple[float, ...]
    pair: tuple[int, str]
    flag: bool


SAMPLE = Outer(1, 2.0, Inner(0j, None), (), (1, ""), True)
finite_or_not = st.floats(width=64)


@given(
    st.integers(-(2**70), 2**70),
    finite_or_not,
    st.complex_numbers(),
    st.sampled_from((None, TrackLine(1j, 2 + 0j), Circle(3j, 4.0))),
    st.lists(finite_or_not),
    st.text(),
)
def test_record_json_round_trip_keeps_every_value(
    number: int,
    value: float,
    where: complex,
    path: TrackLine | Circle | None,
    parts: list[float],
    text: str,
) -> None:
    record = Outer(number, value, Inner(where, path), tuple(parts), (1, text), True)
    assert repr(from_json(Outer, to_json(record))) == repr(record)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[" * 100_000,
        "{}",
        '{"number": 1}',
        to_json(Outer(1, 2.0, Inner(0j, None), (), (1, ""), True)).replace("true", "1"),
        to_json(Outer(1, 2.0, Inner(0j, None), (), (1, ""), True)).replace(
            '"number":1', '"number":true'
        ),
    ],
)
def test_record_json_of_another_structure_is_refused(text: str) -> None:
    with pytest.raises(RecordError):
        from_json(Outer, text)


def dived_state() -> AutopilotState:
    """Return an armed state after ticks under water, with a mission."""
    harness = Harness()
    harness.tick(50, depth_m=3.0)
    return harness.vehicle.state._replace(
        armed=True,
        mode=modes.MISSION.number,
        mission=MissionState(ITEMS, 1, 17, reached=0, previous_waypoint_m=1 + 2j),
    )


def store(folder: Path, state: AutopilotState, problems: list[str] | None = None) -> None:
    """Write a state as the main loop does, without an ordered end."""
    files = StateFiles(folder, 1, "udpin:a:1")
    files.load_mission()
    clock = SensorClock(5, 6, 7)
    report = [].append if problems is None else problems.append
    for _ in range(2):
        files._due.hasten()
        files.poll(lambda: state, clock, modes.HOLD.number, True, report)
        if files._writing is not None:
            files._writing.exception()
    assert files.close(None) == ""


def test_checkpoint_restores_estimate_progress_and_mode(tmp_path: Path) -> None:
    state = dived_state()
    store(tmp_path, state)
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    items = files.load_mission()
    assert repr(items) == repr(ITEMS)
    checkpoint = files.load_checkpoint()
    assert checkpoint is not None
    assert (checkpoint.clock, checkpoint.intended_mode) == (SensorClock(5, 6, 7), modes.HOLD.number)
    restored = continued_state(checkpoint, items)
    for field in ("time_us", "mode", "armed", "estimate", "loops", "mission", "setpoint", "home"):
        assert repr(getattr(restored, field)) == repr(getattr(state, field)), field


def test_disarmed_vehicle_leaves_no_checkpoint(tmp_path: Path) -> None:
    store(tmp_path, dived_state())
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    files.load_mission()
    assert files.load_checkpoint() is not None
    files.poll(lambda: dived_state()._replace(armed=False), SensorClock(), 0, False, print)
    assert files.close(None) == ""
    assert StateFiles(tmp_path, 1, "udpin:a:1").load_checkpoint() is None


def test_ordered_end_keeps_mission_and_removes_checkpoint(tmp_path: Path) -> None:
    store(tmp_path, dived_state())
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    assert files.close(ITEMS[:1]) == ""
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    assert files.load_mission() == ITEMS[:1]
    assert files.load_checkpoint() is None


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"written_unix_s": time.time() - 2.0 * MAX_AGE_S}, "old"),
        ({"hil": "udpin:b:2"}, "belongs to udpin:b:2"),
        ({"clock": None}, "no SensorClock"),
    ],
)
def test_checkpoint_that_cannot_be_continued_is_refused(
    tmp_path: Path, change: dict[str, object], reason: str
) -> None:
    store(tmp_path, dived_state())
    path = tmp_path / "checkpoint-1.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(RecordError, match=rf"checkpoint-1\.json: .*{reason}"):
        StateFiles(tmp_path, 1, "udpin:a:1").load_checkpoint()


def test_damaged_mission_is_named_and_kept_aside(tmp_path: Path) -> None:
    (tmp_path / "mission-1.json").write_text('{"items": [')
    with pytest.raises(RecordError, match=r"mission-1\.json: no JSON.*renamed to mission-1"):
        StateFiles(tmp_path, 1, "udpin:a:1").load_mission()
    assert (tmp_path / "mission-1.json.broken").exists()
    assert StateFiles(tmp_path, 1, "udpin:a:1").load_mission() == ()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_read_only_folder_is_reported_once(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    folder.mkdir(mode=0o500)
    problems: list[str] = []
    store(folder, dived_state(), problems)
    assert len(problems) == 1
    assert "Permission denied" in problems[0]


def test_folder_that_is_a_file_is_reported_once(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    problems: list[str] = []
    store(tmp_path / "state", dived_state(), problems)
    assert len(problems) == 1
    assert "the dive goes on" in problems[0]
