"""Long-running commands and repetitions: executed once, with progress and result."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from mavlink_io import dialect
from mavlink_io.codec import encode
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
from tests.helpers.fake_hil import Deck, Station


def test_excitation_reports_progress_until_its_end(
    deck: Deck, pass_time: Callable[[float], None]
) -> None:
    under_way(deck)
    assert results(deck.command(31010, 12, 5, NAN, NAN, 4, 1, NAN)) == [IN_PROGRESS]
    received = []
    for _ in range(4):
        pass_time(0.5)
        deck.tick(50, depth_m=5.0)
        deck.serve()
        received += [
            m for m in deck.station.heard() if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")
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


def test_excitation_repeated_command_continues_other_is_refused(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    started = deck.vehicle.state.test
    deck.tick(10, depth_m=5.0)
    again = deck.ask(long(31010, 12, 5, NAN, NAN, 10, 1, NAN, confirmation=1))
    assert (results(again), deck.vehicle.state.test) == ([IN_PROGRESS], started)
    assert results(deck.command(31010, 12, 6, NAN, NAN, 10, 1, NAN)) == [REJECTED]
    assert deck.vehicle.state.test == started


def test_excitation_repeated_after_end_gets_its_result(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 2, 1, NAN)
    deck.tick(110, depth_m=5.0)
    deck.serve()
    assert deck.vehicle.state.test is None
    again = deck.ask(long(31010, 12, 5, NAN, NAN, 2, 1, NAN, confirmation=1))
    assert (results(again), deck.vehicle.state.test) == ([ACCEPTED], None)
    assert results(deck.command(31010, 12, 5, NAN, NAN, 2, 1, NAN)) == [IN_PROGRESS], (
        "a new command"
    )


@pytest.mark.parametrize("stop", [long(31010, 0), long(176, 1, 2), long(212, 0)])
def test_excitation_stopped_reports_cancelled(deck: Deck, stop: Any) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    received = deck.ask(stop)
    acknowledged = {(m.command, m.result) for m in received if m.get_type() == "COMMAND_ACK"}
    assert (31010, CANCELLED) in acknowledged
    assert deck.vehicle.state.test is None


def test_excitation_ended_by_failsafe_reports_failed(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    deck.tick(300, depth_m=30.0)
    deck.serve()
    assert results(deck.station.heard())[-1] == FAILED


def test_command_cancel_ends_excitation_and_informs_requester(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    cancel = dialect.by_name("COMMAND_CANCEL")
    frame = encode(cancel, (31010, 1, 1), 0, 255, 190)
    deck.station.heard()
    deck.station._outgoing.append(frame)
    deck.serve()
    assert results(deck.station.heard()) == [CANCELLED]
    assert deck.vehicle.state.test is None
    deck.station._outgoing.append(frame)
    deck.serve()
    assert deck.station.heard() == []


@pytest.mark.parametrize(("axis", "channel"), [(0, 11), (2, 11), (4, 12)])
def test_autotune_starts_excitation_of_sid_parameters(deck: Deck, axis: int, channel: int) -> None:
    under_way(deck)
    assert results(deck.command(212, 1, axis)) == [IN_PROGRESS]
    test = deck.vehicle.state.test
    assert test is not None
    assert (test.axis, test.duration_s) == (channel, deck.vehicle.params.config.sid_record_s)


@pytest.mark.parametrize("parameters", [(1, 1), (1, 6), (2, 2), (NAN,)])
def test_autotune_unsupported_parameters_are_denied(
    deck: Deck, parameters: tuple[float, ...]
) -> None:
    under_way(deck)
    assert results(deck.command(212, *parameters)) == [DENIED]
    assert deck.vehicle.state.test is None


def test_relative_turn_repeated_is_executed_once(
    deck: Deck, pass_time: Callable[[float], None]
) -> None:
    under_way(deck)
    turn = 115, 30.0, 0.0, 1.0, 1.0
    before = deck.vehicle.state.setpoint.heading_rad
    assert results(deck.command(*turn)) == [ACCEPTED]
    pass_time(0.5)
    assert results(deck.command(*turn)) == [ACCEPTED]
    turned = math.degrees(deck.vehicle.state.setpoint.heading_rad - before)
    assert turned == pytest.approx(30.0)
    pass_time(1.0)
    assert results(deck.ask(long(*turn, confirmation=1))) == [ACCEPTED]
    assert math.degrees(deck.vehicle.state.setpoint.heading_rad - before) == pytest.approx(30.0)
    assert results(deck.command(*turn)) == [ACCEPTED]
    assert math.degrees(deck.vehicle.state.setpoint.heading_rad - before) == pytest.approx(60.0)


def test_mission_start_after_mode_change_is_executed_again(deck: Deck) -> None:
    deck.command(400, 1)
    item = mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 2, 93, 1, 1, 100, NAN, NAN, NAN, 0, 0, NAN, 0
    )
    deck.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    deck.ask(item)
    for _ in range(2):
        assert results(deck.command(300, 0, 0)) == [ACCEPTED]
        assert deck.vehicle.state.mode == modes.MISSION.number
        deck.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.HOLD.number))
        assert deck.vehicle.state.mode == modes.HOLD.number


def test_relative_turn_of_two_stations_is_executed_twice(
    pass_time: Callable[[float], None],
) -> None:
    deck = Deck(Station(255, 190), Station(250, 190))
    deck.tick(3, fix=FIX)
    under_way(deck)
    before = deck.vehicle.state.setpoint.heading_rad
    for station in deck.stations:
        deck.ask(long(115, 30.0, 0.0, 1.0, 1.0), station)
    assert math.degrees(deck.vehicle.state.setpoint.heading_rad - before) == pytest.approx(60.0)


def test_refused_command_repeated_is_executed(deck: Deck) -> None:
    assert results(deck.command(115, 30.0, 0.0, 1.0, 1.0)) == [REJECTED]
    under_way(deck)
    assert results(deck.command(115, 30.0, 0.0, 1.0, 1.0)) == [ACCEPTED]
