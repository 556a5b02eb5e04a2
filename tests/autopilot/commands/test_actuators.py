"""Direct actuator commands: DO_SET_ACTUATOR in MANUAL, and ACTUATOR_TEST while disarmed."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.helpers.commands import ACCEPTED, DENIED, NAN, REJECTED, UNSUPPORTED, results
from tests.helpers.fake_hil import TICK_US, Harness, texts

ELEVATOR, PROPELLER = 34, 1
"""ACTUATOR_OUTPUT_FUNCTION: servo 2, motor 1."""


def test_do_set_actuator_applies_until_manual_mode_ends(
    harness: Harness, pass_time: Callable[[float], None]
) -> None:
    assert results(harness.command(187, 0.5, NAN, NAN, NAN, NAN, NAN, 0)) == [REJECTED]
    harness.command(400, 1)
    assert results(harness.command(187, 0.5, NAN, NAN, NAN, NAN, NAN, 0)) == [REJECTED]
    harness.command(176, 1, 1)
    assert results(harness.command(187, 0.5, NAN, NAN, NAN, NAN, NAN, 0)) == [ACCEPTED]
    assert results(harness.command(187, NAN, -0.25, 1.0, 0, 0, 0, 0)) == [ACCEPTED]
    pass_time(60.0)
    assert harness.server.stick == (0.5, -0.25, 1.0)
    harness.command(176, 1, 2)
    assert harness.server.stick is None
    harness.command(176, 1, 1)
    assert harness.server.stick is None


def test_manual_control_replaces_do_set_actuator(harness: Harness) -> None:
    harness.command(400, 1)
    harness.command(176, 1, 1)
    harness.command(187, 0.5, 0.5, 0.5, NAN, NAN, NAN, 0)
    harness.ask(mavlink.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0))
    assert harness.server.stick == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("values", [(1.5, 0, 0), (0, 0, 0, 0.5), (0, 0, 0, 0, 0, 0, 1)])
def test_do_set_actuator_invalid_value_is_denied(
    harness: Harness, values: tuple[float, ...]
) -> None:
    harness.command(400, 1)
    harness.command(176, 1, 1)
    assert results(harness.command(187, *values)) == [DENIED]


def outputs(harness: Harness, ticks: int) -> list[tuple[float, ...]]:
    seen = []
    for _ in range(ticks):
        harness.tick()
        seen.append(harness.vehicle.snapshot().actuators.controls[:3])
    return seen


def test_actuator_test_disarmed_lasts_its_duration(harness: Harness) -> None:
    assert results(harness.command(310, 0.5, 1.0, 0, 0, ELEVATOR)) == [ACCEPTED]
    seconds = 1_000_000 // TICK_US
    assert outputs(harness, seconds - 1) == [(0.0, 0.5, 0.0)] * (seconds - 1)
    assert outputs(harness, 2)[-1] == (0.0, 0.0, 0.0)
    assert not harness.vehicle.snapshot().actuators.armed


def test_actuator_test_ends_after_three_seconds_or_on_request(harness: Harness) -> None:
    harness.command(310, 0.5, 3600.0, 0, 0, PROPELLER)
    assert outputs(harness, 151)[-1] == (0.0, 0.0, 0.0)
    for end in ((NAN, 1.0), (0.5, 0.0), (0.5, NAN)):
        harness.command(310, 0.5, 3.0, 0, 0, PROPELLER)
        assert outputs(harness, 1) == [(0.0, 0.0, 0.5)]
        harness.command(310, *end, 0, 0, PROPELLER)
        assert outputs(harness, 1) == [(0.0, 0.0, 0.0)]


def test_actuator_test_of_two_channels_ends_at_arming(harness: Harness) -> None:
    harness.command(310, 0.5, 3.0, 0, 0, ELEVATOR)
    harness.command(310, -0.25, 3.0, 0, 0, ELEVATOR - 1)
    assert outputs(harness, 1) == [(-0.25, 0.5, 0.0)]
    harness.command(400, 1)
    harness.command(400, 0, 21196)
    assert outputs(harness, 1) == [(0.0, 0.0, 0.0)]


def test_actuator_test_armed_or_unknown_channel_is_refused(harness: Harness) -> None:
    assert results(harness.command(310, 0.5, 1.0, 0, 0, 99)) == [UNSUPPORTED]
    assert results(harness.command(310, 1.5, 1.0, 0, 0, ELEVATOR)) == [DENIED]
    harness.command(400, 1)
    received = harness.command(310, 0.5, 1.0, 0, 0, ELEVATOR)
    assert (results(received), texts(received)) == ([REJECTED], ["Actuator test refused: armed"])
