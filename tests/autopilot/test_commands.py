"""Commands one by one, as pymavlink sends and hears them: what is done, what is refused, and what is said of it."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot import announcer, modes, server, services
from autopilot.mav_cmd import upkeep
from autopilot.params import ParamTable
from autopilot.types import Severity
from link import dialect
from link.codec import encode
from link.records import GpsFix
from tests.autopilot.deck import HPA_PER_M, SURFACE_HPA, TICK_US, Deck, Station, only, texts

NAN = math.nan
FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
ACCEPTED, REJECTED, DENIED = 0, 1, 2
UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = 3, 4, 5, 6
INT32_MAX = 2**31 - 1
ELEVATOR, PROPELLER = 34, 1
"""ACTUATOR_OUTPUT_FUNCTION: servo 2, motor 1."""


@pytest.fixture
def deck() -> Deck:
    deck = Deck()
    deck.tick(3, fix=FIX)
    deck.serve()
    deck.station.heard()
    return deck


@pytest.fixture
def pass_time(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Lets the wall clock jump."""
    now = [server.wall_s()]
    for module in (server, services, announcer):
        monkeypatch.setattr(module, "wall_s", lambda: now[0])

    def pass_time(seconds: float) -> None:
        now[0] += seconds

    return pass_time


def under_way(deck: Deck, depth_m: float = 5.0) -> None:
    deck.command(400, 1)
    deck.command(176, 1, 2)
    deck.tick(200, depth_m=depth_m)


def results(messages: list[Any]) -> list[int]:
    return [m.result for m in messages if m.get_type() == "COMMAND_ACK"]


def long(command: int, *parameters: float, confirmation: int = 0) -> Any:
    filled = [*parameters, *[NAN] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(1, 1, command, confirmation, *filled)


# Long jobs


def test_a_test_is_in_progress_until_it_has_run_its_time(deck: Deck, pass_time: Callable[[float], None]) -> None:
    under_way(deck)
    assert results(deck.command(31010, 12, 5, NAN, NAN, 4, 1, NAN)) == [IN_PROGRESS]
    heard = []
    for _ in range(4):
        pass_time(0.5)
        deck.tick(50, depth_m=5.0)
        deck.serve()
        heard += [m for m in deck.station.heard() if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")]
    progress = [(m.result, m.progress) for m in heard if m.get_type() == "COMMAND_ACK"]
    assert [result for result, _ in progress] == [IN_PROGRESS, IN_PROGRESS, IN_PROGRESS, ACCEPTED]
    assert [percent for _, percent in progress[:3]] == pytest.approx([25, 50, 75], abs=2)
    assert heard[-1].get_type() == "COMMAND_ACK", "what happened is told before the acknowledgement"
    assert (heard[-1].target_system, heard[-1].target_component, heard[-1].command) == (255, 190, 31010)


def test_a_test_that_is_repeated_is_the_same_test_and_another_is_refused(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    started = deck.vehicle.state.test
    deck.tick(10, depth_m=5.0)
    again = deck.ask(long(31010, 12, 5, NAN, NAN, 10, 1, NAN, confirmation=1))
    assert (results(again), deck.vehicle.state.test) == ([IN_PROGRESS], started)
    assert results(deck.command(31010, 12, 6, NAN, NAN, 10, 1, NAN)) == [REJECTED]
    assert deck.vehicle.state.test == started


def test_a_test_whose_end_was_not_heard_is_not_begun_again(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 2, 1, NAN)
    deck.tick(110, depth_m=5.0)
    deck.serve()
    assert deck.vehicle.state.test is None
    again = deck.ask(long(31010, 12, 5, NAN, NAN, 2, 1, NAN, confirmation=1))
    assert (results(again), deck.vehicle.state.test) == ([ACCEPTED], None)
    assert results(deck.command(31010, 12, 5, NAN, NAN, 2, 1, NAN)) == [IN_PROGRESS], "a new wish"


@pytest.mark.parametrize("stop", [long(31010, 0), long(176, 1, 2), long(212, 0)])
def test_a_test_that_is_stopped_is_cancelled(deck: Deck, stop: Any) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    heard = deck.ask(stop)
    acknowledged = {(m.command, m.result) for m in heard if m.get_type() == "COMMAND_ACK"}
    assert (31010, CANCELLED) in acknowledged
    assert deck.vehicle.state.test is None


def test_a_test_that_a_failsafe_ends_has_failed(deck: Deck) -> None:
    under_way(deck)
    deck.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    deck.tick(300, depth_m=30.0)
    deck.serve()
    assert results(deck.station.heard())[-1] == FAILED


def test_command_cancel_ends_a_test_and_tells_who_asked(deck: Deck) -> None:
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
def test_autotune_plays_the_test_that_the_parameters_describe(deck: Deck, axis: int, channel: int) -> None:
    under_way(deck)
    assert results(deck.command(212, 1, axis)) == [IN_PROGRESS]
    test = deck.vehicle.state.test
    assert test is not None
    assert (test.axis, test.duration_s) == (channel, deck.vehicle.params.config.sid_record_s)


@pytest.mark.parametrize("parameters", [(1, 1), (1, 6), (2, 2), (NAN,)])
def test_autotune_of_what_she_cannot_do_is_denied(deck: Deck, parameters: tuple[float, ...]) -> None:
    under_way(deck)
    assert results(deck.command(212, *parameters)) == [DENIED]
    assert deck.vehicle.state.test is None


# What is repeated


def test_a_turn_by_so_much_is_made_once_however_often_it_is_sent(
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


def test_what_was_left_in_between_is_taken_up_again(deck: Deck) -> None:
    deck.command(400, 1)
    item = mavlink.MAVLink_mission_item_int_message(1, 1, 0, 2, 93, 1, 1, 100, NAN, NAN, NAN, 0, 0, NAN, 0)
    deck.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    deck.ask(item)
    for _ in range(2):
        assert results(deck.command(300, 0, 0)) == [ACCEPTED]
        assert deck.vehicle.state.mode == modes.MISSION.number
        deck.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.HOLD.number))
        assert deck.vehicle.state.mode == modes.HOLD.number


def test_two_stations_may_each_turn_her(pass_time: Callable[[float], None]) -> None:
    deck = Deck(Station(255, 190), Station(250, 190))
    deck.tick(3, fix=FIX)
    under_way(deck)
    before = deck.vehicle.state.setpoint.heading_rad
    for station in deck.stations:
        deck.ask(long(115, 30.0, 0.0, 1.0, 1.0), station)
    assert math.degrees(deck.vehicle.state.setpoint.heading_rad - before) == pytest.approx(60.0)


def test_what_was_refused_is_tried_again(deck: Deck) -> None:
    assert results(deck.command(115, 30.0, 0.0, 1.0, 1.0)) == [REJECTED]
    under_way(deck)
    assert results(deck.command(115, 30.0, 0.0, 1.0, 1.0)) == [ACCEPTED]


# Actuators


def test_actuators_are_set_by_hand_in_manual_until_it_is_left(deck: Deck, pass_time: Callable[[float], None]) -> None:
    assert results(deck.command(187, 0.5, NAN, NAN, NAN, NAN, NAN, 0)) == [REJECTED]
    deck.command(400, 1)
    assert results(deck.command(187, 0.5, NAN, NAN, NAN, NAN, NAN, 0)) == [REJECTED]
    deck.command(176, 1, 1)
    assert results(deck.command(187, 0.5, NAN, NAN, NAN, NAN, NAN, 0)) == [ACCEPTED]
    assert results(deck.command(187, NAN, -0.25, 1.0, 0, 0, 0, 0)) == [ACCEPTED]
    pass_time(60.0)
    assert deck.server.stick == (0.5, -0.25, 1.0)
    deck.command(176, 1, 2)
    assert deck.server.stick is None
    deck.command(176, 1, 1)
    assert deck.server.stick is None


def test_a_stick_takes_over_from_actuators_that_were_set(deck: Deck) -> None:
    deck.command(400, 1)
    deck.command(176, 1, 1)
    deck.command(187, 0.5, 0.5, 0.5, NAN, NAN, NAN, 0)
    deck.ask(mavlink.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0))
    assert deck.server.stick == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("values", [(1.5, 0, 0), (0, 0, 0, 0.5), (0, 0, 0, 0, 0, 0, 1)])
def test_actuators_that_are_not_there_are_denied(deck: Deck, values: tuple[float, ...]) -> None:
    deck.command(400, 1)
    deck.command(176, 1, 1)
    assert results(deck.command(187, *values)) == [DENIED]


def outputs(deck: Deck, ticks: int) -> list[tuple[float, ...]]:
    seen = []
    for _ in range(ticks):
        deck.tick()
        seen.append(deck.vehicle.snapshot().actuators.controls[:3])
    return seen


def test_an_actuator_is_tested_for_its_time_while_disarmed(deck: Deck) -> None:
    assert results(deck.command(310, 0.5, 1.0, 0, 0, ELEVATOR)) == [ACCEPTED]
    seconds = 1_000_000 // TICK_US
    assert outputs(deck, seconds - 1) == [(0.0, 0.5, 0.0)] * (seconds - 1)
    assert outputs(deck, 2)[-1] == (0.0, 0.0, 0.0)
    assert not deck.vehicle.snapshot().actuators.armed


def test_a_test_never_lasts_more_than_three_seconds_and_ends_when_told(deck: Deck) -> None:
    deck.command(310, 0.5, 3600.0, 0, 0, PROPELLER)
    assert outputs(deck, 151)[-1] == (0.0, 0.0, 0.0)
    for end in ((NAN, 1.0), (0.5, 0.0), (0.5, NAN)):
        deck.command(310, 0.5, 3.0, 0, 0, PROPELLER)
        assert outputs(deck, 1) == [(0.0, 0.0, 0.5)]
        deck.command(310, *end, 0, 0, PROPELLER)
        assert outputs(deck, 1) == [(0.0, 0.0, 0.0)]


def test_two_actuators_may_be_tested_at_once_and_arming_ends_it(deck: Deck) -> None:
    deck.command(310, 0.5, 3.0, 0, 0, ELEVATOR)
    deck.command(310, -0.25, 3.0, 0, 0, ELEVATOR - 1)
    assert outputs(deck, 1) == [(-0.25, 0.5, 0.0)]
    deck.command(400, 1)
    deck.command(400, 0, 21196)
    assert outputs(deck, 1) == [(0.0, 0.0, 0.0)]


def test_no_actuator_is_tested_while_armed_or_where_there_is_none(deck: Deck) -> None:
    assert results(deck.command(310, 0.5, 1.0, 0, 0, 99)) == [UNSUPPORTED]
    assert results(deck.command(310, 1.5, 1.0, 0, 0, ELEVATOR)) == [DENIED]
    deck.command(400, 1)
    heard = deck.command(310, 0.5, 1.0, 0, 0, ELEVATOR)
    assert (results(heard), texts(heard)) == ([REJECTED], ["Actuator test refused: armed"])


# At the quay


def test_defaults_come_back_and_every_link_hears_them() -> None:
    deck = Deck(Station(255, 190), Station(250, 190))
    deck.tick(3)
    for name, value in ((b"HDG_P", 0.75), (b"DPT_P", 0.2)):
        deck.ask(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))
    deck.stations[1].heard()
    assert results(deck.command(245, 2, -1)) == [ACCEPTED]
    assert deck.vehicle.params.config == ParamTable().config
    told = {m.param_id: m.param_value for m in deck.stations[1].heard() if m.get_type() == "PARAM_VALUE"}
    assert told == pytest.approx({"HDG_P": 0.65, "DPT_P": 0.13})


def test_storage_is_asked_for_only_while_disarmed_and_only_what_there_is(deck: Deck) -> None:
    for parameters in ((0, 0), (1, 1), (NAN, NAN), (-1, -1)):
        assert results(deck.command(245, *parameters)) == [ACCEPTED]
    assert results(deck.command(245, 9)) == [DENIED]
    deck.command(400, 1)
    deck.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 0.75, 9))
    assert results(deck.command(245, 2)) == [REJECTED]
    assert deck.vehicle.params.get("HDG_P") == 0.75


def test_storage_may_clear_the_mission(deck: Deck) -> None:
    deck.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    deck.ask(mavlink.MAVLink_mission_item_int_message(1, 1, 0, 2, 93, 1, 1, 10, NAN, NAN, NAN, 0, 0, NAN, 0))
    assert only(deck.command(512, 42), "MISSION_CURRENT").total == 1
    assert results(deck.command(245, -1, 2)) == [ACCEPTED]
    assert only(deck.command(512, 42), "MISSION_CURRENT").total == 0xFFFF


def test_the_air_pressure_is_calibrated_at_the_surface(deck: Deck) -> None:
    weather_hpa = SURFACE_HPA - 20.0
    deck.tick(300, depth_m=-20.0 / HPA_PER_M)
    assert deck.vehicle.state.estimate.depth_m == pytest.approx(-0.2, abs=0.01)
    heard = deck.command(241, 0, 0, 1, 0, 0, 0, 0)
    assert results(heard) == [ACCEPTED]
    assert texts(heard)[0].startswith("Ground pressure is 993.")
    assert only(heard, "PARAM_VALUE").param_value == pytest.approx(weather_hpa, abs=0.5)
    deck.tick(300, depth_m=-20.0 / HPA_PER_M)
    assert deck.vehicle.state.estimate.depth_m == pytest.approx(0.0, abs=0.005)


def test_water_is_not_taken_for_weather(deck: Deck) -> None:
    deck.tick(300, depth_m=(upkeep.MOST_CHANGE_HPA + 5.0) / HPA_PER_M)
    heard = deck.command(241, 0, 0, 1, 0, 0, 0, 0)
    assert results(heard) == [REJECTED]
    assert "is no change of weather" in texts(heard)[0]
    assert deck.vehicle.params.get("EST_SURF_HPA") == SURFACE_HPA


@pytest.mark.parametrize("wanted", [(1,), (0, 1), (0, 0, 0, 0, 1), (0, 0, 0, 0, 2), (1, 0, 1)])
def test_other_calibrations_are_denied_in_words(deck: Deck, wanted: tuple[float, ...]) -> None:
    heard = deck.command(241, *wanted, *[0.0] * (7 - len(wanted)))
    assert results(heard) == [DENIED]
    assert texts(heard)


def test_a_calibration_is_cancelled_by_nothing_but_zeros(deck: Deck) -> None:
    assert results(deck.command(241, *[0.0] * 7)) == [ACCEPTED]


# COMMAND_INT and its coordinates


def test_home_is_set_with_a_float32_degree_or_an_exact_integer(deck: Deck) -> None:
    message = mavlink.MAVLink_command_int_message(1, 1, 0, 179, 0, 0, 0, 0, 0, 0, 415_123_456, -707_654_321, 0)
    assert results(deck.ask(message)) == [ACCEPTED]
    home = only(deck.command(512, 242), "HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (415_123_456, -707_654_321, 0)


def test_home_is_told_as_it_moves(deck: Deck) -> None:
    heard = deck.command(179, 0, 0, 0, 0, 41.25, -70.5, 0)
    assert only(heard, "HOME_POSITION").latitude == 412_500_000
    assert only(heard, "GPS_GLOBAL_ORIGIN").longitude == -705_000_000
    again = deck.command(179, 0, 0, 0, 0, 41.25, -70.5, 0)
    assert [m.get_type() for m in again] == ["COMMAND_ACK"]


@pytest.mark.parametrize(
    "message",
    [
        mavlink.MAVLink_set_home_position_message(1, 412_500_000, -705_000_000, 7000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0),
        mavlink.MAVLink_set_gps_global_origin_message(1, 412_500_000, -705_000_000, 7000),
    ],
    ids=lambda message: str(message.get_type()),
)
def test_home_and_origin_may_be_set_by_message_and_stay_at_the_surface(deck: Deck, message: Any) -> None:
    heard = deck.ask(message)
    home = only(heard, "HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (412_500_000, -705_000_000, 0)
    assert texts(heard) == ["Home stays at the surface: altitude ignored"]
    assert {m.latitude for m in heard if m.get_type() == "GPS_GLOBAL_ORIGIN"} == {412_500_000}


def test_a_place_that_is_not_given_is_no_place(deck: Deck) -> None:
    message = mavlink.MAVLink_command_int_message(1, 1, 0, 179, 0, 0, 0, 0, 0, 0, INT32_MAX, INT32_MAX, NAN)
    assert results(deck.ask(message)) == [DENIED]


def test_a_tests_duration_is_whole_seconds_in_a_command_int(deck: Deck) -> None:
    under_way(deck)
    message = mavlink.MAVLink_command_int_message(1, 1, 0, 31010, 0, 0, 12, 5.0, NAN, NAN, 8, 1, NAN)
    assert results(deck.ask(message)) == [IN_PROGRESS]
    assert deck.vehicle.state.test is not None
    assert deck.vehicle.state.test.duration_s == 8.0


def test_repositioning_without_a_place_holds_and_with_one_is_not_done(deck: Deck) -> None:
    under_way(deck)
    pause = mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, NAN, INT32_MAX, INT32_MAX, NAN)
    assert results(deck.ask(pause)) == [ACCEPTED]
    assert deck.vehicle.state.mode == modes.HOLD.number
    assert results(deck.command(192, -1, 1, 0, NAN, 41.5, -70.7, 0)) == [UNSUPPORTED]


# Intervals


def test_the_heartbeats_interval_can_be_read_and_not_changed(deck: Deck) -> None:
    assert only(deck.command(510, 0), "MESSAGE_INTERVAL").interval_us == 1_000_000
    assert results(deck.command(511, 0, 0)) == [ACCEPTED]
    assert results(deck.command(511, 0, 1_000_000)) == [ACCEPTED]
    for interval in (-1, 200_000):
        assert results(deck.command(511, 0, interval)) == [DENIED]


def test_old_stream_requests_change_nothing_and_are_not_answered(deck: Deck) -> None:
    before = [link.schedule.interval_us(30) for link in deck.server.links]
    answers = deck.ask(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    assert [m.get_type() for m in answers] == ["HEARTBEAT"], "the greeting of a newcomer, and nothing else"
    assert [link.schedule.interval_us(30) for link in deck.server.links] == before


def test_numbers_of_the_loops_come_to_who_asks(deck: Deck) -> None:
    under_way(deck)
    deck.command(511, 251, 100_000)
    deck.command(511, 350, 100_000)
    deck.station.heard()
    deck.tick(10, depth_m=5.0)
    heard = deck.station.heard()
    named = {m.name: m.value for m in heard if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert set(named) == {"DPT_ERR", "PTCH_ERR", "HDG_ERR", "SID_IN", "SID_FREQ"}
    trace = deck.vehicle.snapshot().trace
    assert named["DPT_ERR"] == pytest.approx(trace.depth_error_m, abs=0.05)
    arrays = [m for m in heard if m.get_type() == "DEBUG_FLOAT_ARRAY"]
    assert len(arrays) == 2
    assert (arrays[-1].name, arrays[-1].array_id) == ("TRACE", 1)
    assert arrays[-1].data[: len(trace)] == pytest.approx(list(trace), abs=0.05)


# Texts


def test_a_flood_of_texts_is_cut_and_what_is_critical_is_not(deck: Deck, pass_time: Callable[[float], None]) -> None:
    for number in range(100):
        deck.vehicle.say(f"text {number}")
    deck.vehicle.say("Leak detected", Severity.EMERGENCY)
    deck.serve()
    said = texts(deck.station.heard())
    assert said[:3] == ["text 0", "text 1", "text 2"]
    assert 15 <= len(said) <= 25
    assert said[-1] == "Leak detected"
    assert f"{100 - (len(said) - 2)} messages left out" in said
    pass_time(10.0)
    deck.vehicle.say("later")
    deck.serve()
    assert texts(deck.station.heard()) == ["later"]
