"""Home position, and positions in COMMAND_INT."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.helpers.commands import (
    ACCEPTED,
    DENIED,
    IN_PROGRESS,
    INT32_MAX,
    NAN,
    results,
    under_way,
)
from tests.helpers.fake_hil import Harness, only, texts


def test_do_set_home_command_int_keeps_exact_position(harness: Harness) -> None:
    message = mavlink.MAVLink_command_int_message(
        1, 1, 0, 179, 0, 0, 0, 0, 0, 0, 415_123_456, -707_654_321, 0
    )
    assert results(harness.ask(message)) == [ACCEPTED]
    home = only(harness.command(512, 242), "HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (415_123_456, -707_654_321, 0)


def test_home_change_is_published_once(harness: Harness) -> None:
    received = harness.command(179, 0, 0, 0, 0, 41.25, -70.5, 0)
    assert only(received, "HOME_POSITION").latitude == 412_500_000
    assert only(received, "GPS_GLOBAL_ORIGIN").longitude == -705_000_000
    again = harness.command(179, 0, 0, 0, 0, 41.25, -70.5, 0)
    assert [m.get_type() for m in again] == ["COMMAND_ACK"]


@pytest.mark.parametrize(
    "message",
    [
        mavlink.MAVLink_set_home_position_message(
            1, 412_500_000, -705_000_000, 7000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0
        ),
        mavlink.MAVLink_set_gps_global_origin_message(1, 412_500_000, -705_000_000, 7000),
    ],
    ids=lambda message: str(message.get_type()),
)
def test_home_set_by_message_stays_at_surface(harness: Harness, message: Any) -> None:
    received = harness.ask(message)
    home = only(received, "HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (412_500_000, -705_000_000, 0)
    assert texts(received) == ["Home stays at the surface: altitude ignored"]
    assert {m.latitude for m in received if m.get_type() == "GPS_GLOBAL_ORIGIN"} == {412_500_000}


def test_do_set_home_without_position_is_denied(harness: Harness) -> None:
    message = mavlink.MAVLink_command_int_message(
        1, 1, 0, 179, 0, 0, 0, 0, 0, 0, INT32_MAX, INT32_MAX, NAN
    )
    assert results(harness.ask(message)) == [DENIED]


def test_command_int_excitation_has_integer_duration(harness: Harness) -> None:
    under_way(harness)
    message = mavlink.MAVLink_command_int_message(
        1, 1, 0, 31010, 0, 0, 12, 5.0, NAN, NAN, 8, 1, NAN
    )
    assert results(harness.ask(message)) == [IN_PROGRESS]
    assert harness.vehicle.state.test is not None
    assert harness.vehicle.state.test.duration_s == 8.0
