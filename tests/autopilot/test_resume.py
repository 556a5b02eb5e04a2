"""Plans and state of a dive on disk."""

import errno
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
from autopilot.control.fence import Fence, Place, Rally, Zone
from autopilot.control.setpoints import Circle, TrackLine
from autopilot.control.types import AutopilotState, MissionState
from autopilot.record_json import RecordError, from_json, to_json
from autopilot.resume import (
    MAX_AGE_S,
    PLAN_NAMES,
    StateFiles,
    _StoredPlan,
    continued_state,
    plans_of,
)
from mavlink_io.mission_items import FENCE_TYPE, MISSION_TYPE, RALLY_TYPE, MissionItem
from tests.helpers.fake_hil import Harness

ITEMS = (MissionItem(0, 2, 93, p1=5.0), MissionItem(1, 2, 93, p1=math.nan))
FENCE = Fence(
    (MissionItem(0, 6, 5003, p1=500.0, x=1, y=2, mission_type=FENCE_TYPE),),
    (Zone(True, (Place(1e-7, 2e-7),), 500.0),),
)
RALLY = Rally((MissionItem(0, 6, 5100, x=3, y=4, mission_type=RALLY_TYPE),), (Place(3e-7, 4e-7),))


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
        fence=FENCE,
        rally=RALLY,
    )


def store(folder: Path, state: AutopilotState, problems: list[str] | None = None) -> None:
    """Write a state as the main loop does, without an ordered end."""
    files = StateFiles(folder, 1, "udpin:a:1")
    load_plans(files)
    write(files, state, problems)
    assert files.close(None) == ""


def load_plans(files: StateFiles) -> dict[int, tuple[MissionItem, ...]]:
    """Load the plans as a start does."""
    return {kind: files.load_plan(kind) for kind in (MISSION_TYPE, FENCE_TYPE, RALLY_TYPE)}


def write(files: StateFiles, state: AutopilotState, problems: list[str] | None = None) -> None:
    """Write a state once and wait for it."""
    report = (problems if problems is not None else []).append
    for _ in range(2):
        files._writer._due.hasten()
        files.poll(lambda: state, SensorClock(5, 6, 7), modes.HOLD.number, True, report)
        if files._writer._write is not None:
            files._writer._write.exception()


def test_checkpoint_restores_estimate_progress_mode_and_plans(tmp_path: Path) -> None:
    state = dived_state()
    store(tmp_path, state)
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    assert repr(load_plans(files)) == repr(plans_of(state))
    checkpoint = files.load_checkpoint()
    assert checkpoint is not None
    assert (checkpoint.clock, checkpoint.intended_mode) == (SensorClock(5, 6, 7), modes.HOLD.number)
    loaded = AutopilotState(mission=MissionState(ITEMS), fence=FENCE, rally=RALLY)
    restored = continued_state(checkpoint, loaded)
    for field in (
        *("time_us", "mode", "armed", "estimate", "loops", "mission", "fence", "rally"),
        *("setpoint", "home"),
    ):
        assert repr(getattr(restored, field)) == repr(getattr(state, field)), field


def test_checkpoint_has_no_items_and_plans_are_written_once(tmp_path: Path) -> None:
    files, state = StateFiles(tmp_path, 1, "udpin:a:1"), dived_state()
    write(files, state)
    plans = [tmp_path / f"{name}-1.json" for name in ("mission", "fence", "rally")]
    inodes = [path.stat().st_ino for path in plans]
    held = [path.open() for path in plans]  # an inode in use is not given to a new file
    write(files, state._replace(time_us=1))
    assert [path.stat().st_ino for path in plans] == inodes
    assert '"items":[{' not in (tmp_path / "checkpoint-1.json").read_text()
    for file in held:
        file.close()
    assert files.close(None) == ""


def test_two_vehicles_in_one_folder_keep_their_own_plans(tmp_path: Path) -> None:
    store(tmp_path, dived_state())
    assert load_plans(StateFiles(tmp_path, 2, "udpin:a:1"))[FENCE_TYPE] == ()
    assert load_plans(StateFiles(tmp_path, 1, "udpin:a:1"))[FENCE_TYPE] == FENCE.items


def test_state_without_checkpoint_keeps_plans_and_surfaces(tmp_path: Path) -> None:
    vehicle = Harness().vehicle
    vehicle.surface_from(dived_state())
    assert vehicle.state.mode == modes.SURFACE.number
    assert (vehicle.state.fence, vehicle.state.rally) == (FENCE, RALLY)
    assert vehicle.state.mission.items == ITEMS


def test_disarmed_vehicle_leaves_no_checkpoint(tmp_path: Path) -> None:
    store(tmp_path, dived_state())
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    load_plans(files)
    assert files.load_checkpoint() is not None
    write(files, dived_state()._replace(armed=False))
    assert files.close(None) == ""
    assert StateFiles(tmp_path, 1, "udpin:a:1").load_checkpoint() is None


def test_ordered_end_keeps_plans_and_removes_checkpoint(tmp_path: Path) -> None:
    store(tmp_path, dived_state())
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    load_plans(files)
    plans = {MISSION_TYPE: ITEMS[:1], FENCE_TYPE: (), RALLY_TYPE: RALLY.items}
    assert files.close(plans) == ""
    files = StateFiles(tmp_path, 1, "udpin:a:1")
    assert load_plans(files) == plans
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


@pytest.mark.parametrize(
    ("kind", "text", "reason"),
    [
        (MISSION_TYPE, '{"items": [', "no JSON"),
        (FENCE_TYPE, to_json(_StoredPlan(ITEMS)), "another kind of plan"),
        (RALLY_TYPE, "[" * 100_000, "no JSON"),
    ],
)
def test_damaged_plan_is_named_and_kept_aside(
    tmp_path: Path, kind: int, text: str, reason: str
) -> None:
    name = f"{PLAN_NAMES[kind]}-1.json"
    for turn in (1, 2):
        (tmp_path / name).write_text(text + " " * turn)
        renamed = rf"{name}: .*{reason}.*renamed to {name}\.broken-{turn}"
        with pytest.raises(RecordError, match=renamed):
            StateFiles(tmp_path, 1, "udpin:a:1").load_plan(kind)
    for turn in (1, 2):
        assert (tmp_path / f"{name}.broken-{turn}").read_text() == text + " " * turn
    assert StateFiles(tmp_path, 1, "udpin:a:1").load_plan(kind) == ()


def fail_with(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Let every write of a file fail, as on a full disk or in a read-only folder."""

    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("mavlink_io.user_data_dir.os.open", refuse)


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (errno.ENOSPC, "No space left on device: {}; free space on the disk; the dive goes on"),
        (errno.EROFS, "Read-only file system: {}; make the folder writable; the dive goes on"),
        (errno.EACCES, "Permission denied: {}; make the folder writable; the dive goes on"),
    ],
)
def test_plan_that_cannot_be_written_is_reported_once_and_written_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, text: str
) -> None:
    problems: list[str] = []
    files, state = StateFiles(tmp_path, 1, "udpin:a:1"), dived_state()
    with monkeypatch.context() as disk:
        fail_with(disk, number)
        for _ in range(3):
            write(files, state, problems)
    place = tmp_path / "mission-1.json"
    assert problems == [f"Plans and state not stored: {text.format(place)}"]
    write(files, state, problems)
    assert len(problems) == 1
    assert files.close(None) == ""
    assert repr(load_plans(StateFiles(tmp_path, 1, "udpin:a:1"))) == repr(plans_of(state))


def test_folder_that_is_a_file_is_reported_once(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    problems: list[str] = []
    store(tmp_path / "state", dived_state(), problems)
    assert len(problems) == 1
    assert f"{tmp_path / 'state'}; check the disk; the dive goes on" in problems[0]
