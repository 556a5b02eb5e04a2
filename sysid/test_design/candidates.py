"""Candidate tests: the autopilot's signals, scaled to the vehicle's bandwidth.

The types follow the feasibility study of identification: steps for the static gain; 3-2-1-1, sweeps
and square waves for the crossover. With the loop on, the vehicle holds its course, so the length of
a test is not limited. Lengths are whole seconds, as in missions.

In a test of both surfaces, even tones belong to the rudder and odd tones to the elevator, so the
responses can be separated and each second of test time gives information about both planes. One
autopilot parameter sets the elevator's size as a share of the rudder's.
"""

import math
from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

from sysid.planes import Plane
from sysid.test_design.safety_margins import round_down
from sysid.test_design.simulate import Manoeuvre, Wave

NOMINAL_DEG = 3.0
"""Initial size (deg) of a candidate on a vehicle with Caribou's control effectiveness.

The final size follows from the limits.
"""
STEPS_S = (6, 12, 20)
"""Lengths of steps (s)."""
PULSES = (1.8, 3.0)
"""Length of the shortest pulse of a 3-2-1-1, in radians of the crossover frequency."""
CLOCKS = (0.3, 0.5)
"""Bits of a pseudo-random sequence per radian of the crossover frequency."""
BAND = (0.25, 2.5)
"""Lowest and highest frequency of sweeps and multisines, relative to the crossover frequency."""
HELD_OUT: Wave = "doublet"
"""Type of the validation test; it differs from all fitted tests."""
PAPER_SIZES_DEG = {
    Plane.YAW: (3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0, -9.0),
    Plane.PITCH: (2.0, 3.0, 4.0, 5.0, 7.0, 9.0, 12.0, 14.0),
}
"""Sizes of the paper's steps (deg); elevator steps are all nose up to stay clear of the bottom."""
PAPER_DURATION_S = {Plane.YAW: 20, Plane.PITCH: 8}
"""Lengths of the paper's steps (s)."""
PAPER_RECOVERY_S = 55.0
"""Time (s) until the vehicle is back on depth and course after these large steps."""


class Lengths(NamedTuple):
    """Lengths of tests (s)."""

    free_s: tuple[int, ...] = (20, 30, 45)
    """Multisines with the loop off."""
    held_s: tuple[int, ...] = (60, 100)
    """Tests with the loop on."""
    both_s: tuple[int, ...] = (100, 200)
    """Multisines of both surfaces at once with both loops on."""
    square_s: tuple[int, ...] = (20, 30)
    """Designed square waves with the loop off."""


def candidates(
    plane: Plane, crossover_radps: float, nominal_deg: float, lengths: Lengths
) -> list[Manoeuvre]:
    """Return all candidates of one plane at nominal size, except `square_waves`."""
    low, high = (round(share * crossover_radps / (2.0 * math.pi), 3) for share in BAND)
    clocks = [round(share * crossover_radps, 3) for share in CLOCKS]
    pulses = sorted({max(3, round(7.0 * pulse / crossover_radps)) for pulse in PULSES})
    shapes = [
        Manoeuvre(plane=plane, wave="step", size_deg=nominal_deg, duration_s=seconds)
        for seconds in STEPS_S
    ]
    shapes += [
        Manoeuvre(plane=plane, wave="3211", size_deg=nominal_deg, duration_s=seconds)
        for seconds in pulses
    ]
    shapes += [
        Manoeuvre(
            plane=plane,
            wave="multisine",
            size_deg=nominal_deg,
            duration_s=seconds,
            start_hz=low,
            stop_hz=high,
        )
        for seconds in lengths.free_s
    ]
    for seconds in lengths.held_s:
        closed_loop = Manoeuvre(
            plane=plane,
            wave="multisine",
            size_deg=nominal_deg,
            duration_s=seconds,
            start_hz=low,
            stop_hz=high,
            loop_on=True,
        )
        shapes += [closed_loop, closed_loop._replace(wave="chirp")]
        shapes += [
            closed_loop._replace(wave="prbs", start_hz=0.0, stop_hz=clock, seed=3)
            for clock in clocks
        ]
    return shapes


def square_waves(plane: Plane, nominal_deg: float, lengths: Lengths) -> list[Manoeuvre]:
    """Return plane, loop and length of the square waves to design."""
    open_loop = [
        Manoeuvre(plane=plane, wave="square", size_deg=nominal_deg, duration_s=seconds)
        for seconds in lengths.square_s
    ]
    return open_loop + [
        Manoeuvre(
            plane=plane, wave="square", size_deg=nominal_deg, duration_s=seconds, loop_on=True
        )
        for seconds in lengths.held_s
    ]


def dual_axis_tests(
    crossovers_radps: Sequence[float], nominal_deg: Sequence[float], lengths: Lengths
) -> list[Manoeuvre]:
    """Return multisines of both surfaces over the bands of both planes, at nominal size.

    The sequences hold the values of yaw, then of pitch.
    """
    low = round(BAND[0] * min(crossovers_radps) / (2.0 * math.pi), 3)
    high = round(BAND[1] * max(crossovers_radps) / (2.0 * math.pi), 3)
    rudder_deg, elevator_deg = nominal_deg
    shape = Manoeuvre(
        plane=Plane.YAW,
        wave="multisine",
        size_deg=rudder_deg,
        duration_s=0,
        start_hz=low,
        stop_hz=high,
        loop_on=True,
        elevator_deg=elevator_deg,
    )
    return [shape._replace(duration_s=seconds) for seconds in lengths.both_s]


def held_out_test(plane: Plane, crossover_radps: float, nominal_deg: float) -> Manoeuvre:
    """Return the validation test of one plane at nominal size."""
    return Manoeuvre(
        plane=plane,
        wave=HELD_OUT,
        size_deg=nominal_deg,
        duration_s=max(6, round(8.0 / crossover_radps)),
    )


def elevator_share(largest: Sequence[tuple[Manoeuvre, Manoeuvre]]) -> float:
    """Return the elevator's size over the rudder's, in whole percent, that suits all tests.

    Parameters
    ----------
    largest : Sequence
        Rudder and elevator half of each test at their largest safe size; at least one test.

    Returns
    -------
    float
        Median ratio, between 0.01 and 1.
    """
    ratios = sorted(elevator.size_deg / rudder.size_deg for rudder, elevator in largest)
    return min(100, max(1, math.floor(100.0 * ratios[len(ratios) // 2]))) / 100.0


def scale_to_limits(
    shape: Manoeuvre, rudder: Manoeuvre, elevator: Manoeuvre, share: float
) -> Manoeuvre:
    """Return `shape` at the largest size that both halves allow at this share."""
    size_deg = round_down(min(rudder.size_deg, elevator.size_deg / share))
    return shape._replace(size_deg=size_deg, elevator_deg=round(share * size_deg, 4))


def paper_steps(scale: dict[Plane, float], test_time_s: float) -> list[Manoeuvre]:
    """Return the paper's steps that fit into `test_time_s` (s), alternating between the planes.

    The steps start from trim and are not sized to limits. `scale` is the ratio of this vehicle's
    surface angle to Caribou's for the same effect. The sequence starts again after its last step.
    """
    manoeuvres: list[Manoeuvre] = []
    used_s = 0.0
    for number, plane in enumerate(cycle(Plane)):
        sizes, seconds = PAPER_SIZES_DEG[plane], PAPER_DURATION_S[plane]
        used_s += seconds + PAPER_RECOVERY_S
        if used_s > test_time_s:
            break
        size_deg = scale[plane] * sizes[number // len(Plane) % len(sizes)]
        manoeuvres.append(
            Manoeuvre(plane=plane, wave="step", size_deg=size_deg, duration_s=seconds)
        )
    return manoeuvres
