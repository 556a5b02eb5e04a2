"""Loops whose gains have one free factor: zeros are placed by a rule, a root locus is drawn over
the factor.

The zero of proportional and rate feedback lies where the tailcone is still quick; the integrator's
far below it."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sysid.control_analysis import loop_transfer, root_locus
from sysid.control_analysis.loop_transfer import ClosedLoop, ComplexArray, Gains, Lag
from sysid.control_analysis.root_locus import OpenLoop
from sysid.design.design_model import DesignModel

PADE = 2
"""Order in root loci, as the paper's; margins are those of the true delay."""
ZEROS = (4.5, 5.5, 6.8, 8.3, 10.2, 12.5)
"""The tailcone's bandwidth over the zero. With the first, the lead is 66 degrees at half the
bandwidth, where the loop crosses; the others are for vehicles that are slow beside their tailcone,
and need the phase sooner."""
INTEGRAL_S = {"heading": 25.0, "depth": 30.0}
"""Proportional over integral gain: so long after a load's worst a third of it is left."""


class LoopStructure(NamedTuple):
    """One loop: what its gains are at a factor of one, and what stays."""

    loop: str
    """heading, pitch or depth."""
    free: Mapping[str, float]
    fixed: Mapping[str, float]

    def at(self, factor: float) -> dict[str, float]:
        """All gains of the loop."""
        return {**self.fixed, **{name: factor * gain for name, gain in self.free.items()}}

    def cuts(self, vehicle: DesignModel, gains: Gains) -> dict[str, ComplexArray]:
        """Loop transfer functions by where they are opened, with the true delay."""
        if self.loop == "heading":
            return loop_transfer.heading_loops(vehicle.yaw, gains)
        found = loop_transfer.depth_loops(vehicle.pitch, gains)
        return (
            {"elevator": found["pitch"]}
            if self.loop == "pitch"
            else {k: found[k] for k in ("elevator", "depth")}
        )

    def closed(self, vehicle: DesignModel, gains: Gains) -> ClosedLoop:
        if self.loop == "heading":
            return loop_transfer.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, gains, PADE)
        close = loop_transfer.close_pitch if self.loop == "pitch" else loop_transfer.close_depth
        return close(vehicle.planes.pitch, vehicle.pitch_lag, gains, PADE)

    def opened(self, vehicle: DesignModel) -> OpenLoop:
        """At a factor of one, where the factor acts."""
        closed = self.closed(vehicle, self.at(1.0))
        return (
            root_locus.open_at_depth(closed)
            if self.loop == "depth"
            else root_locus.open_at_duct(closed, 3)
        )


def loop_of(gain: str) -> str:
    """The loop that a gain is of."""
    return {"HDG": "heading", "PTCH": "pitch", "DPT": "depth"}[gain.split("_")[0]]


def heading(zero_radps: float) -> LoopStructure:
    integral = zero_radps / INTEGRAL_S["heading"]
    return LoopStructure("heading", {"HDG_P": zero_radps, "HDG_D": 1.0, "HDG_I": integral}, {})


def pitch(zero_radps: float) -> LoopStructure:
    """Without an integrator: the depth loop's carries what is constant."""
    return LoopStructure(
        "pitch",
        {"PTCH_P": zero_radps, "PTCH_D": 1.0},
        {"PTCH_I": 0.0, "DPT_P": 0.0, "DPT_D": 0.0, "DPT_I": 0.0},
    )


def depth(pitch_gains: Gains) -> LoopStructure:
    """Round a pitch loop; the pitch is depth's rate, so depth needs no lead of its own."""
    return LoopStructure(
        "depth", {"DPT_P": 1.0, "DPT_I": 1.0 / INTEGRAL_S["depth"]}, {**pitch_gains, "DPT_D": 0.0}
    )


def bandwidth_radps(lag: Lag) -> float:
    """Where lag and delay have taken 90 degrees: the tailcone's own limit to what a loop can do."""
    s, wn = 1j * loop_transfer.GRID_RADPS, lag.natural_frequency_radps
    duct = np.exp(-s * lag.delay_s) * wn**2 / (s**2 + 2.0 * lag.damping_ratio * wn * s + wn**2)
    return float(np.interp(math.pi / 2.0, -np.unwrap(np.angle(duct)), loop_transfer.GRID_RADPS))
