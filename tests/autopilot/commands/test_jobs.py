"""Long-running commands and repetitions: executed once, with progress and result."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.commands.jobs import MAX_OPEN_JOBS, Jobs
from autopilot.commands.types import JobProgress, MavCommand
from autopilot.control import modes
from mavlink_io import dialect
from mavlink_io.codec import encode
from mavlink_io.request import MavlinkId
from tests.helpers.commands import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    FAILED,
    FIX,
    IN_PROGRESS,
    NAN,
    REJECTED,
    long,
    results,
    under_way,
)
from tests.helpers.fake_hil import Harness, Station


def test_flood_of_jobs_ends_no_job_of_another_requester() -> None:
    jobs, ended = Jobs(), list[MavlinkId]()
    operator, flooder = MavlinkId(255, 190), MavlinkId(254, 190)

    def begin(requester: MavlinkId, number: int) -> None:
        command = MavCommand(number, *(0.0,) * 7, scaled=False)
        running = JobProgress(IN_PROGRESS)
        jobs.begin(requester, command, lambda: running, lambda _: ended.append(requester), 0.0)

    begin(operator, 1)
    for number in range(2, 200):
        begin(flooder, number)
    assert set(ended) == {flooder}
    assert len(ended) == 199 - MAX_OPEN_JOBS


def test_excitation_reports_progress_until_its_end(
    harness: Harness, pass_time: Callable[[float], None]
) -> None:
    under_way(harness)
    assert results(harness.command(31010, 12, 5, NAN, NAN, 4, 1, NAN)) == [IN_PROGRESS]
    received = []
    for _ in range(4):
        pass_time(0.5)
        harness.tick(50, depth_m=5.0)
        harness.serve()
        received += [
            m
            for m in harness.station.pop_received()
            if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")
        ]
    progress = [(m.result, m.progress) for m in received if m.get_type() == "COMMAND_ACK"]
    assert [result for result, _ in progress] == [IN_PROGRESS, IN_PROGRESS, IN_PROGRESS, ACCEPTED]
    assert [percent for _, percent in progress[:3]] == pytest.approx([25, 50, 75], abs=2)
    assert received[-1].get_type() == "COMMAND_ACK", "events are sent before the acknowledgement"
    assert (received[-1].target_system, received[-1].target_component, received[-1].command) == (
        255,
        190,
        31010,
    )


def test_excitation_repeated_command_continues_other_is_refused(harness: Harness) -> None:
    under_way(harness)
    harness.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    started = harness.vehicle.state.test
    harness.tick(10, depth_m=5.0)
    again = harness.ask(long(31010, 12, 5, NAN, NAN, 10, 1, NAN, confirmation=1))
    assert (results(again), harness.vehicle.state.test) == ([IN_PROGRESS], started)
    assert results(harness.command(31010, 12, 6, NAN, NAN, 10, 1, NAN)) == [REJECTED]
    assert harness.vehicle.state.test == started


def test_excitation_repeated_after_end_gets_its_result(harness: Harness) -> None:
    under_way(harness)
    harness.command(31010, 12, 5, NAN, NAN, 2, 1, NAN)
    harness.tick(110, depth_m=5.0)
    harness.serve()
    assert harness.vehicle.state.test is None
    again = harness.ask(long(31010, 12, 5, NAN, NAN, 2, 1, NAN, confirmation=1))
    assert (results(again), harness.vehicle.state.test) == ([ACCEPTED], None)
    assert results(harness.command(31010, 12, 5, NAN, NAN, 2, 1, NAN)) == [IN_PROGRESS], (
        "a new command"
    )


@pytest.mark.parametrize("stop", [long(31010, 0), long(176, 1, 2), long(212, 0)])
def test_excitation_stopped_reports_cancelled(harness: Harness, stop: Any) -> None:
    under_way(harness)
    harness.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    received = harness.ask(stop)
    acknowledged = {(m.command, m.result) for m in received if m.get_type() == "COMMAND_ACK"}
    assert (31010, CANCELLED) in acknowledged
    assert harness.vehicle.state.test is None


def test_excitation_ended_by_failsafe_reports_failed(harness: Harness) -> None:
    under_way(harness)
    harness.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    harness.tick(300, depth_m=30.0)
    harness.serve()
    assert results(harness.station.pop_received())[-1] == FAILED


def test_command_cancel_ends_excitation_and_informs_requester(harness: Harness) -> None:
    under_way(harness)
    harness.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    cancel = dialect.by_name("COMMAND_CANCEL")
    frame = encode(cancel, (31010, 1, 1), 0, 255, 190)
    harness.station.pop_received()
    harness.station._outgoing.append(frame)
    harness.serve()
    assert results(harness.station.pop_received()) == [CANCELLED]
    assert harness.vehicle.state.test is None
    harness.station._outgoing.append(frame)
    harness.serve()
    assert harness.station.pop_received() == []


@pytest.mark.parametrize(("axis", "channel"), [(0, 11), (2, 11), (4, 12)])
def test_autotune_starts_excitation_of_sid_parameters(
    harness: Harness, axis: int, channel: int
) -> None:
    under_way(harness)
    assert results(harness.command(212, 1, axis)) == [IN_PROGRESS]
    test = harness.vehicle.state.test
    assert test is not None
    assert (test.axis, test.duration_s) == (channel, harness.vehicle.params.config.sid_record_s)


@pytest.mark.parametrize("parameters", [(1, 1), (1, 6), (2, 2), (NAN,)])
def test_autotune_unsupported_parameters_are_denied(
    harness: Harness, parameters: tuple[float, ...]
) -> None:
    under_way(harness)
    assert results(harness.command(212, *parameters)) == [DENIED]
    assert harness.vehicle.state.test is None


def test_relative_turn_repeated_is_executed_once(
    harness: Harness, pass_time: Callable[[float], None]
) -> None:
    under_way(harness)
    turn = 115, 30.0, 0.0, 1.0, 1.0
    before = harness.vehicle.state.setpoint.heading_rad
    assert results(harness.command(*turn)) == [ACCEPTED]
    pass_time(0.5)
    assert results(harness.command(*turn)) == [ACCEPTED]
    turned = math.degrees(harness.vehicle.state.setpoint.heading_rad - before)
    assert turned == pytest.approx(30.0)
    pass_time(1.0)
    assert results(harness.ask(long(*turn, confirmation=1))) == [ACCEPTED]
    assert math.degrees(harness.vehicle.state.setpoint.heading_rad - before) == pytest.approx(30.0)
    assert results(harness.command(*turn)) == [ACCEPTED]
    assert math.degrees(harness.vehicle.state.setpoint.heading_rad - before) == pytest.approx(60.0)


def test_mission_start_after_mode_change_is_executed_again(harness: Harness) -> None:
    harness.command(400, 1)
    item = mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 2, 93, 1, 1, 100, NAN, NAN, NAN, 0, 0, NAN, 0
    )
    harness.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    harness.ask(item)
    for _ in range(2):
        assert results(harness.command(300, 0, 0)) == [ACCEPTED]
        assert harness.vehicle.state.mode == modes.MISSION.number
        harness.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.HOLD.number))
        assert harness.vehicle.state.mode == modes.HOLD.number


def test_relative_turn_of_two_stations_is_executed_twice(
    pass_time: Callable[[float], None],
) -> None:
    harness = Harness(Station(255, 190), Station(250, 190))
    harness.tick(3, fix=FIX)
    under_way(harness)
    before = harness.vehicle.state.setpoint.heading_rad
    for station in harness.stations:
        harness.ask(long(115, 30.0, 0.0, 1.0, 1.0), station)
    assert math.degrees(harness.vehicle.state.setpoint.heading_rad - before) == pytest.approx(60.0)


def test_refused_command_repeated_is_executed(harness: Harness) -> None:
    assert results(harness.command(115, 30.0, 0.0, 1.0, 1.0)) == [REJECTED]
    under_way(harness)
    assert results(harness.command(115, 30.0, 0.0, 1.0, 1.0)) == [ACCEPTED]
