"""What the autopilot measures of a plane, and what a law makes of it: loops cut open, margins,
answers to the sea.

The cuts, limits and errors are those of the PID redesign (``sysid.design.pid``), for any law from
the same measurements."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer, modal
from sysid.control_analysis.loop_transfer import GRID_RADPS, Lag
from sysid.data.segments import Plane
from sysid.design import constraints
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import NOISE_STEP_S, DesignModel, spectrum
from sysid.design.lqg import controller as laws
from sysid.design.lqg.controller import DiscreteController
from sysid.design.specification import Spec
from sysid.models.linear_planes import LinearPlane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

PADE_ORDER = 4
HIGH_GRID_RADPS: Array = np.linspace(GRID_RADPS[-1], math.pi / loop_transfer.TICK_S, 40)
"""From the end of the grid to half the tick's rate."""


class MeasuredPlane(NamedTuple):
    """One plane of a vehicle as a law meets it. Outputs: r, psi; in pitch q, theta, depth,
    depth'."""

    plane: LinearPlane
    lag: Lag
    density: Array
    """Of the sea, on the grid."""
    noise_radps: float
    """Square root of the gyro's density, rad/s per sqrt(Hz)."""
    command: ComplexArray
    """(frequencies, outputs) from command."""
    moment: ComplexArray
    """(frequencies, outputs) from a unit of angular acceleration."""

    @property
    def names(self) -> tuple[str, str]:
        """Of the cuts: at the surface, and at the error of heading or depth."""
        return ("elevator", "depth") if "depth" in self.plane.states else ("rudder", "heading")


def measured_plane(vehicle: DesignModel, plane: Plane) -> MeasuredPlane:
    linear = vehicle.planes.yaw if plane == "yaw" else vehicle.planes.pitch
    lag = vehicle.yaw_lag if plane == "yaw" else vehicle.pitch_lag
    responses = vehicle.yaw if plane == "yaw" else vehicle.pitch
    sea, measured = vehicle.sea[plane], outputs(linear).T
    noise = math.radians(sea.rate_noise_degps) * math.sqrt(NOISE_STEP_S)
    return MeasuredPlane(
        linear, lag, spectrum(sea), noise, responses.command @ measured, responses.moment @ measured
    )


def outputs(plane: LinearPlane) -> Array:
    """C: which combinations of a plane's states are measured."""
    rows = np.eye(len(plane.B))[1:]
    return rows if "depth" not in plane.states else np.vstack([rows, plane.A[3]])


class Cuts(NamedTuple):
    """Loop transfer functions: opened at the surface, and at heading or depth with the inner loops
    closed."""

    surface: ComplexArray
    outer: ComplexArray


def cuts(seen: MeasuredPlane, law: DiscreteController) -> Cuts:
    parts = -laws.response(law, GRID_RADPS) * seen.command
    inner = 1 if seen.command.shape[1] == 2 else 2
    return Cuts(
        parts.sum(axis=1), parts[:, inner:].sum(axis=1) / (1.0 + parts[:, :inner].sum(axis=1))
    )


def violations(
    seen: MeasuredPlane, law: DiscreteController, bounds: Bounds, finishing: Spec | None = None
) -> ConstraintViolation:
    """What the PID's loops are asked for, and that a change of buoyancy ends in time like an offset
    of the surface."""
    opened, (surface, outer) = cuts(seen, law), seen.names
    own = modal.modes_of(_close(seen, law))
    missed = {
        "stability": float(np.max(own.values.real)),
        **constraints.margin_violations(opened.surface, surface, bounds),
        **constraints.margin_violations(opened.outer, outer, bounds),
        **constraints.damping_violations(own, outer, bounds),
    }
    if finishing is None:
        return missed
    state = modal.OBSERVED_STATES[outer][outer]
    missed |= constraints.load_violation(own, seen.plane.B, state, outer, finishing)
    if outer == "depth":
        missed |= constraints.load_violation(
            own, np.eye(1, 4)[0], state, "depth with new buoyancy", finishing
        )
    return missed


def _close(seen: MeasuredPlane, law: DiscreteController) -> loop_transfer.ClosedLoop:
    A, B = loop_transfer.plane_with_tailcone(seen.plane, seen.lag, PADE_ORDER)
    C = np.zeros((seen.command.shape[1], len(B)))
    C[:, : len(seen.plane.B)] = outputs(seen.plane)
    return laws.close(law, A, B, C)


class DisturbanceResponse(NamedTuple):
    """Standard deviations in the model's sea (rad, m, s)."""

    outputs: Array
    command_rad: float
    noise_rad: float
    """Of the command by the gyro's noise alone."""


def disturbance_response(seen: MeasuredPlane, law: DiscreteController) -> DisturbanceResponse:
    feedback, beyond = laws.response(law, GRID_RADPS), laws.response(law, HIGH_GRID_RADPS)
    sensitivity = 1.0 / (1.0 - (feedback * seen.command).sum(axis=1))
    command = (feedback * seen.moment).sum(axis=1) * sensitivity
    replies = seen.moment + seen.command * command[:, None]
    noise = _power(feedback[:, 0] * sensitivity, GRID_RADPS) + _power(beyond[:, 0], HIGH_GRID_RADPS)
    return DisturbanceResponse(
        np.array([math.sqrt(_power(reply, GRID_RADPS, seen.density)) for reply in replies.T]),
        math.sqrt(_power(command, GRID_RADPS, seen.density)),
        seen.noise_radps * math.sqrt(noise),
    )


def _power(transfer: ComplexArray, frequencies_radps: Array, density: Array | float = 1.0) -> float:
    """Parseval, over positive frequencies of a two-sided density."""
    return float(np.trapezoid(np.abs(transfer) ** 2 * density, frequencies_radps)) / math.pi
