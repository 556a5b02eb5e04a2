"""Actuators by hand under way, and one by one on the bench."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.helpers.commands import ACCEPTED, DENIED, NAN, REJECTED, UNSUPPORTED, results
from tests.helpers.fake_hil import TICK_US, Deck, texts

ELEVATOR, PROPELLER = 34, 1
"""ACTUATOR_OUTPUT_FUNCTION: servo 2, motor 1."""


def test_actuators_are_set_by_hand_in_manual_until_it_is_left(
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
