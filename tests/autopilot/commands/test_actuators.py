"""Direct actuator commands: DO_SET_ACTUATOR in MANUAL, and ACTUATOR_TEST while disarmed."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.helpers.commands import ACCEPTED, DENIED, NAN, REJECTED, UNSUPPORTED, results
from tests.helpers.fake_hil import TICK_US, Deck, texts

ELEVATOR, PROPELLER = 34, 1
"""ACTUATOR_OUTPUT_FUNCTION: servo 2, motor 1."""


def test_do_set_actuator_applies_until_manual_mode_ends(
    deck: Deck, pass_time: Callable[[float], None]
) -> None:
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


def test_manual_control_replaces_do_set_actuator(deck: Deck) -> None:
    deck.command(400, 1)
    deck.command(176, 1, 1)
    deck.command(187, 0.5, 0.5, 0.5, NAN, NAN, NAN, 0)
    deck.ask(mavlink.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0))
    assert deck.server.stick == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("values", [(1.5, 0, 0), (0, 0, 0, 0.5), (0, 0, 0, 0, 0, 0, 1)])
def test_do_set_actuator_invalid_value_is_denied(deck: Deck, values: tuple[float, ...]) -> None:
    deck.command(400, 1)
    deck.command(176, 1, 1)
    assert results(deck.command(187, *values)) == [DENIED]


def outputs(deck: Deck, ticks: int) -> list[tuple[float, ...]]:
    seen = []
    for _ in range(ticks):
        deck.tick()
        seen.append(deck.vehicle.snapshot().actuators.controls[:3])
    return seen


def test_actuator_test_disarmed_lasts_its_duration(deck: Deck) -> None:
    assert results(deck.command(310, 0.5, 1.0, 0, 0, ELEVATOR)) == [ACCEPTED]
    seconds = 1_000_000 // TICK_US
    assert outputs(deck, seconds - 1) == [(0.0, 0.5, 0.0)] * (seconds - 1)
    assert outputs(deck, 2)[-1] == (0.0, 0.0, 0.0)
    assert not deck.vehicle.snapshot().actuators.armed


def test_actuator_test_ends_after_three_seconds_or_on_request(deck: Deck) -> None:
    deck.command(310, 0.5, 3600.0, 0, 0, PROPELLER)
    assert outputs(deck, 151)[-1] == (0.0, 0.0, 0.0)
    for end in ((NAN, 1.0), (0.5, 0.0), (0.5, NAN)):
        deck.command(310, 0.5, 3.0, 0, 0, PROPELLER)
        assert outputs(deck, 1) == [(0.0, 0.0, 0.5)]
        deck.command(310, *end, 0, 0, PROPELLER)
        assert outputs(deck, 1) == [(0.0, 0.0, 0.0)]


def test_actuator_test_of_two_channels_ends_at_arming(deck: Deck) -> None:
    deck.command(310, 0.5, 3.0, 0, 0, ELEVATOR)
    deck.command(310, -0.25, 3.0, 0, 0, ELEVATOR - 1)
    assert outputs(deck, 1) == [(-0.25, 0.5, 0.0)]
    deck.command(400, 1)
    deck.command(400, 0, 21196)
    assert outputs(deck, 1) == [(0.0, 0.0, 0.0)]


def test_actuator_test_armed_or_unknown_channel_is_refused(deck: Deck) -> None:
    assert results(deck.command(310, 0.5, 1.0, 0, 0, 99)) == [UNSUPPORTED]
    assert results(deck.command(310, 1.5, 1.0, 0, 0, ELEVATOR)) == [DENIED]
    deck.command(400, 1)
    received = deck.command(310, 0.5, 1.0, 0, 0, ELEVATOR)
    assert (results(received), texts(received)) == ([REJECTED], ["Actuator test refused: armed"])
