"""Loops with one free gain factor: zeros are placed by a rule, the root locus gives the factor.

The zero of proportional and rate feedback is placed below the tailcone's bandwidth; the zero of the
integrator is far below it.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sysid.control_analysis import loop_state_space, loop_transfer, root_locus
from sysid.control_analysis.loop_state_space import ClosedLoop
from sysid.control_analysis.loop_transfer import ComplexArray, Gains, Lag
from sysid.control_analysis.root_locus import OpenLoop
from sysid.design.design_model import DesignModel

PADE = 2
"""Order of the Pade delay in root loci, as in the paper; margins use the true delay."""
ZEROS, LOW_ZEROS = (4.5, 5.5, 6.8, 8.3, 10.2, 12.5), (15.3, 18.8, 23.0)
"""Candidate ratios of the tailcone's bandwidth to the zero, and those of the last attempt.

With the first ratio the lead is 66 deg at half the bandwidth, where the loop crosses unit gain. The
larger ratios suit vehicles that are slow compared with their tailcone, or unstable, and need phase
at lower frequencies.
"""
CUTS = {
    "heading": {"rudder": "rudder", "heading": "heading"},
    "pitch": {"elevator": "pitch"},
    "depth": {"elevator": "elevator", "depth": "depth"},
}
"""Places where each loop is opened, with the names of their transfer functions."""
INTEGRAL_S = {"heading": 25.0, "pitch": 30.0, "depth": 30.0}
"""Ratio of proportional to integral gain (s), of a pitch loop with an integrator.

After this time a third of a load's largest error is left.
"""


class LoopStructure(NamedTuple):
    """One loop: gains that scale with the factor, and fixed gains."""

    loop: str
    """Name of the loop: heading, pitch or depth."""
    free: Mapping[str, float]
    """Gains at a factor of one, by name."""
    fixed: Mapping[str, float]
    """Gains that do not scale, by name."""

    def at(self, factor: float) -> dict[str, float]:
        """Return all gains of the loop at a factor."""
        return {**self.fixed, **{name: factor * gain for name, gain in self.free.items()}}

    def cuts(self, vehicle: DesignModel, gains: Gains) -> dict[str, ComplexArray]:
        """Return the open-loop transfer functions by place, with the true delay."""
        plane, _ = loop_state_space.LOOPS[self.loop]
        loops = loop_transfer.open_loops(plane, vehicle.responses(plane), gains)
        return {place: loops[name] for place, name in CUTS[self.loop].items()}

    def closed(self, vehicle: DesignModel, gains: Gains) -> ClosedLoop:
        """Return the closed loop with a Pade delay."""
        lags = vehicle.yaw_lag, vehicle.pitch_lag
        return loop_state_space.close_loop(self.loop, vehicle.planes, lags, gains, PADE)

    def opened(self, vehicle: DesignModel) -> OpenLoop:
        """Return the loop at a factor of one, opened where the factor acts."""
        closed = self.closed(vehicle, self.at(1.0))
        return (
            root_locus.open_at_depth(closed)
            if self.loop == "depth"
            else root_locus.open_at_duct(closed, 3)
        )


def loop_of(gain: str) -> str:
    """Return the loop to which a gain belongs."""
    return {"HDG": "heading", "PTCH": "pitch", "DPT": "depth"}[gain.split("_")[0]]


def heading(zero_radps: float) -> LoopStructure:
    """Return the heading loop with a zero at `zero_radps`."""
    integral = zero_radps / INTEGRAL_S["heading"]
    return LoopStructure("heading", {"HDG_P": zero_radps, "HDG_D": 1.0, "HDG_I": integral}, {})


def pitch(zero_radps: float, *, integral: bool = False) -> LoopStructure:
    """Return the pitch loop, by default without integrator: that of the depth loop suffices."""
    per_second = 1.0 / INTEGRAL_S["pitch"] if integral else 0.0
    return LoopStructure(
        "pitch",
        {"PTCH_P": zero_radps, "PTCH_D": 1.0, "PTCH_I": zero_radps * per_second},
        {"DPT_P": 0.0, "DPT_D": 0.0, "DPT_I": 0.0},
    )


def depth(pitch_gains: Gains) -> LoopStructure:
    """Return the depth loop around a pitch loop.

    Pitch is the rate of depth, so the depth loop needs no lead of its own.
    """
    return LoopStructure(
        "depth", {"DPT_P": 1.0, "DPT_I": 1.0 / INTEGRAL_S["depth"]}, {**pitch_gains, "DPT_D": 0.0}
    )


def bandwidth_radps(lag: Lag) -> float:
    """Return the frequency (rad/s) at which lag and delay reach 90 degrees of phase lag.

    It limits the crossover frequency of any loop through this tailcone.
    """
    s, wn_radps = 1j * loop_transfer.GRID_RADPS, lag.natural_frequency_radps
    duct = (
        np.exp(-s * lag.delay_s)
        * wn_radps**2
        / (s**2 + 2.0 * lag.damping_ratio * wn_radps * s + wn_radps**2)
    )
    return float(np.interp(math.pi / 2.0, -np.unwrap(np.angle(duct)), loop_transfer.GRID_RADPS))
