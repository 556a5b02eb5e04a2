"""Full deflection that one sensor alone asks for."""

import math

import pytest

from autopilot.control.deflection_limit import FULL_S, REDUCED, limit_deflection

TRAVEL_RAD = math.radians(15.0)
TICK_S = 0.02


def limited(command: float, confirming: float, seconds: float) -> list[float]:
    """Return the commands of a number of equal ticks, as fractions of the travel."""
    commands, full_s = [], 0.0
    for _ in range(round(seconds / TICK_S)):
        command_rad, full_s = limit_deflection(
            command * TRAVEL_RAD, confirming * TRAVEL_RAD, full_s, TRAVEL_RAD, TICK_S
        )
        commands.append(command_rad / TRAVEL_RAD)
    return commands


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("confirming", [-1.0, 0.0, 0.65])
def test_limit_unconfirmed_full_command_is_reduced(sign: float, confirming: float) -> None:
    commands = limited(sign, sign * confirming, 2.0)
    full = sum(abs(command) == 1.0 for command in commands)
    assert full * TICK_S == pytest.approx(FULL_S, abs=1.5 * TICK_S)
    assert commands[-1] == pytest.approx(sign * REDUCED)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_limit_confirmed_full_command_stays(sign: float) -> None:
    assert set(limited(sign, sign * 0.75, 5.0)) == {sign}


def test_limit_command_below_the_limit_stays() -> None:
    assert limited(0.79, -1.0, 5.0) == pytest.approx([0.79] * 250)


def test_limit_beyond_travel_counts_as_full() -> None:
    assert limited(3.0, 0.0, 1.0)[-1] == pytest.approx(REDUCED)


def test_limit_full_command_with_interruptions_is_reduced() -> None:
    """Two of three ticks ask for full travel: a third of the ticks add to the time."""
    full_s, commands = 0.0, []
    for tick in range(150):
        command = 0.5 if tick % 3 == 0 else 1.0
        command_rad, full_s = limit_deflection(
            command * TRAVEL_RAD, 0.0, full_s, TRAVEL_RAD, TICK_S
        )
        commands.append(command_rad / TRAVEL_RAD)
    assert min(commands[-2:]) == pytest.approx(REDUCED)
