"""The tests that could be flown in one plane: the autopilot's own signals, scaled to how fast the
vehicle is.

Which ones: identification's feasibility study (steps for the static gain; 3-2-1-1, sweeps and
square waves for the crossover). With the loop on the vehicle keeps her course, and a test may last
as long as one likes. Lengths are whole seconds, as missions have them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from sysid.data.segments import Plane
from sysid.test_design.simulate import Manoeuvre, Wave

NOMINAL_DEG = 3.0
"""Size at which a shape is first tried, for a vehicle that turns as Caribou does; limits decide on
the last one."""
STEPS_S = (6, 12, 20)
PULSES = (1.8, 3.0)
"""Length of the shortest pulse of a 3-2-1-1, in radians of the crossover frequency."""
CLOCKS = (0.3, 0.5)
"""Bits of a pseudo-random sequence in a radian of the crossover frequency."""
BAND = (0.25, 2.5)
"""Lowest and highest frequency of sweeps and multisines, over the crossover's."""
HELD_OUT: Wave = "doublet"
"""Never fitted, so that what is held out is of another type than whatever was."""


class Lengths(NamedTuple):
    """Of tests, in seconds."""

    free_s: tuple[int, ...] = (20, 30, 45)
    """Multisines with the loop off."""
    held_s: tuple[int, ...] = (60, 100)
    """Whatever has the loop on."""
    both_s: tuple[int, ...] = (100, 200)
    """Multisines of both surfaces at once, their loops on."""
    square_s: tuple[int, ...] = (20, 30)
    """Designed square waves with the loop off."""


def candidates(
    plane: Plane, crossover_radps: float, nominal_deg: float, lengths: Lengths
) -> list[Manoeuvre]:
    """All of one plane at their nominal size but designed square waves (``square_waves``)."""
    low, high = (round(share * crossover_radps / (2.0 * math.pi), 3) for share in BAND)
    clocks = [round(share * crossover_radps, 3) for share in CLOCKS]
    pulses = sorted({max(3, round(7.0 * pulse / crossover_radps)) for pulse in PULSES})
    shapes = [Manoeuvre(plane, "step", nominal_deg, seconds) for seconds in STEPS_S]
    shapes += [Manoeuvre(plane, "3211", nominal_deg, seconds) for seconds in pulses]
    shapes += [
        Manoeuvre(plane, "multisine", nominal_deg, seconds, low, high) for seconds in lengths.free_s
    ]
    for seconds in lengths.held_s:
        held = Manoeuvre(plane, "multisine", nominal_deg, seconds, low, high, loop_on=True)
        shapes += [held, held._replace(wave="chirp")]
        shapes += [
            held._replace(wave="prbs", start_hz=0.0, stop_hz=clock, seed=3) for clock in clocks
        ]
    return shapes


def square_waves(plane: Plane, nominal_deg: float, lengths: Lengths) -> list[Manoeuvre]:
    """Plane, loop and length of the square waves that are to be designed."""
    free = [Manoeuvre(plane, "square", nominal_deg, seconds) for seconds in lengths.square_s]
    return free + [
        Manoeuvre(plane, "square", nominal_deg, seconds, loop_on=True) for seconds in lengths.held_s
    ]


def dual_axis_tests(
    crossovers_radps: Sequence[float], nominal_deg: Sequence[float], lengths: Lengths
) -> list[Manoeuvre]:
    """Over the bands of both planes, yaw's numbers first; the sizes are nominal."""
    low = round(BAND[0] * min(crossovers_radps) / (2.0 * math.pi), 3)
    high = round(BAND[1] * max(crossovers_radps) / (2.0 * math.pi), 3)
    rudder_deg, elevator_deg = nominal_deg
    shape = Manoeuvre(
        "yaw", "multisine", rudder_deg, 0, low, high, loop_on=True, elevator_deg=elevator_deg
    )
    return [shape._replace(duration_s=seconds) for seconds in lengths.both_s]


def held_out_test(plane: Plane, crossover_radps: float, nominal_deg: float) -> Manoeuvre:
    return Manoeuvre(plane, HELD_OUT, nominal_deg, max(6, round(8.0 / crossover_radps)))
