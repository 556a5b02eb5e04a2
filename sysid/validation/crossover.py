"""Where a model's loops cross unit gain, and how sure it is of gain and phase there: the delta
method on its loop."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains, Lag
from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.models import linear_planes
from sysid.models.parameters import CandidateVehicle
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, TABLE_3_INITIAL
from sysid.validation.results import Crossover

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LOOPS: dict[Plane, tuple[str, str]] = {"yaw": ("rudder", "HDG"), "pitch": ("elevator", "PTCH")}
"""Where a plane's loop is opened, and how the names of its gains begin."""
STEP = 1e-3
"""Of the central differences, in prior standard deviations."""


class UncertainVehicle(NamedTuple):
    """A vehicle that depends on z, where z is thought to lie, and how surely."""

    vehicle: Callable[[Array], CandidateVehicle]
    z: Array
    covariance: Array | None
    """None where nobody knows."""


def response(vehicle: CandidateVehicle, plane: Plane) -> ComplexArray:
    """From command to rate on ``GRID_RADPS``, small motion, without the autopilot's own
    sampling."""
    return np.asarray(_responses(vehicle, plane, 0.0).command[:, 1])


def _responses(
    vehicle: CandidateVehicle, plane: Plane, more_delay_s: float
) -> loop_transfer.Responses:
    actuator = vehicle.actuators[plane]
    lag = Lag(
        actuator.delay_s + more_delay_s, actuator.natural_frequency_radps, actuator.damping_ratio
    )
    return loop_transfer.responses(fit.linear_plane(vehicle, plane), lag)


def loop(vehicle: CandidateVehicle, plane: Plane, gains: Gains) -> ComplexArray:
    """The plane's loop, opened at its surface, on ``GRID_RADPS``."""
    found = _responses(vehicle, plane, loop_transfer.SAMPLING_S)
    cuts = (
        loop_transfer.heading_loops(found, gains)
        if plane == "yaw"
        else loop_transfer.depth_loops(found, gains)
    )
    return cuts[LOOPS[plane][0]]


def gains_for(first: CandidateVehicle) -> dict[str, float]:
    """Gains to judge by where those aboard are not known: the prototype's, as much weaker as the
    tail is livelier."""
    gains = dict(TABLE_3_INITIAL)
    for plane, (_, prefix) in LOOPS.items():
        turn = linear_planes.small_signal(fit.linear_plane(first, plane)).b1_per_s2
        for part in ("P", "D", "I"):
            gains[f"{prefix}_{part}"] *= CARIBOU_TURN_PER_S2 / turn
    return gains


def crossover(believed: UncertainVehicle, plane: Plane, gains: Gains) -> Crossover | None:
    """Under ``gains``, by name as in Table 3; None where the loop never reaches unit gain."""
    nominal = loop(believed.vehicle(believed.z), plane, gains)
    margins = loop_transfer.margins(nominal)
    if not (math.isfinite(margins.crossover_radps) and math.isfinite(margins.pm_deg)):
        return None
    turns = np.unwrap(np.angle(nominal))

    def figures(z: Array) -> Array:
        """Crossover, phase margin, and gain and phase at the nominal crossover, dB and degrees."""
        moved = loop(believed.vehicle(z), plane, gains)
        found = loop_transfer.margins(moved)
        phase = turns + np.angle(moved / nominal)
        return np.array(
            [
                found.crossover_radps,
                found.pm_deg,
                np.interp(margins.crossover_radps, GRID_RADPS, 20.0 * np.log10(np.abs(moved))),
                math.degrees(float(np.interp(margins.crossover_radps, GRID_RADPS, phase))),
            ]
        )

    sds: list[float] | list[None] = [None] * 4
    if believed.covariance is not None:
        sds = propagate_sd(figures, believed.z, believed.covariance).tolist()
    return Crossover(
        loop="rudder" if plane == "yaw" else "elevator",
        crossover_radps=margins.crossover_radps,
        crossover_sd_radps=sds[0],
        gain_sd_db=sds[2],
        phase_sd_deg=sds[3],
        pm_deg=margins.pm_deg,
        pm_sd_deg=sds[1],
    )


def propagate_sd(function: Callable[[Array], Array], z: Array, covariance: Array) -> Array:
    """Standard deviation of ``function(z)``, first order, central differences along the
    covariance's own axes."""
    values, axes = np.linalg.eigh(covariance)
    steps = [math.sqrt(v) * axis for v, axis in zip(np.maximum(values, 0.0), axes.T, strict=True)]
    moves = [
        (function(z + STEP * s) - function(z - STEP * s)) / (2.0 * STEP) for s in steps if np.any(s)
    ]
    return np.asarray(np.sqrt(np.sum(np.square(moves), axis=0)))


def response_sd(believed: UncertainVehicle, plane: Plane) -> tuple[Array, Array]:
    """Standard deviation of ``response`` on its grid, dB and degrees; zeros where nobody knows."""
    nominal = response(believed.vehicle(believed.z), plane)
    if believed.covariance is None:
        return np.zeros(nominal.size), np.zeros(nominal.size)

    def figures(z: Array) -> Array:
        ratio = response(believed.vehicle(z), plane) / nominal
        return np.concatenate([20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))])

    gain_db, phase_deg = np.split(propagate_sd(figures, believed.z, believed.covariance), 2)
    return gain_db, phase_deg
