"""Loop analysis of one plane with any controller of the autopilot's measurements.

Covers opened loops, margins and the response to the disturbance. Cuts, limits and errors are those
of the PID redesign (``sysid.design.pid``).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.tick import TICK_S
from sysid.control_analysis import loop_state_space, modal
from sysid.control_analysis.loop_transfer import GRID_RADPS, Lag
from sysid.design import constraints
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel, outputs
from sysid.design.disturbance_response import NOISE_STEP_S, DisturbanceSource, disturbances
from sysid.design.lqg import controller as lqg_controller
from sysid.design.lqg.controller import ContinuousController
from sysid.design.specification import Spec
from sysid.models.linear_planes import LinearPlane
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

PADE_ORDER = 4
"""Order of the Pade delay in closed-loop poles."""
HIGH_GRID_RADPS: Array = np.linspace(GRID_RADPS[-1], math.pi / TICK_S, 40)
"""Frequencies (rad/s) from the end of the grid to half the sample rate."""


class _MeasuredDisturbance(NamedTuple):
    """A disturbance as the outputs show it."""

    outputs: ComplexArray
    """Outputs per unit of it without control, (frequencies, outputs)."""
    density: Array
    """Two-sided power spectral density on the grid."""


class MeasuredPlane(NamedTuple):
    """One plane of a vehicle with its measured outputs.

    Outputs: r, psi in yaw; q, theta, depth, depth rate in pitch.
    """

    plane: LinearPlane
    lag: Lag
    disturbances: tuple[_MeasuredDisturbance, ...]
    noise_radps: float
    """Square root of the gyro's noise density, rad/s per sqrt(Hz)."""
    command: ComplexArray
    """Response to the command, (frequencies, outputs)."""

    @property
    def names(self) -> tuple[str, str]:
        """Names of the cuts: at the surface, and at the error of heading or depth."""
        return ("elevator", "depth") if "depth" in self.plane.states else ("rudder", "heading")


def measured_plane(vehicle: DesignModel, plane: Plane) -> MeasuredPlane:
    """Return one plane of a design model with its measured outputs.

    Parameters
    ----------
    vehicle : DesignModel
        Planes, lags and disturbances.
    plane : Plane
        Plane.

    Returns
    -------
    MeasuredPlane
        Plane with the responses from command and disturbances to the outputs, on GRID_RADPS.
    """
    index = PLANES[plane].index
    linear, responses = vehicle.planes[index], vehicle.responses(plane)
    noise = math.radians(vehicle.disturbance[plane].rate_noise_degps) * math.sqrt(NOISE_STEP_S)
    return MeasuredPlane(
        plane=linear,
        lag=(vehicle.yaw_lag, vehicle.pitch_lag)[index],
        disturbances=tuple(
            _measured_disturbance(linear, source) for source in disturbances(vehicle, plane)
        ),
        noise_radps=noise,
        command=responses.command @ outputs(linear).T,
    )


def _measured_disturbance(plane: LinearPlane, source: DisturbanceSource) -> _MeasuredDisturbance:
    """Return a disturbance as the outputs show it; the depth rate is that of the measured depth."""
    measured = source.states @ outputs(plane).T
    if "depth" in plane.states:
        measured[:, 3] = 1j * GRID_RADPS * source.states[:, 3]
    return _MeasuredDisturbance(measured, source.density)


class Cuts(NamedTuple):
    """Open-loop transfer functions on the grid."""

    surface: ComplexArray
    """Loop opened at the surface command."""
    outer: ComplexArray
    """Loop opened at the error of heading or depth, inner loops closed."""


def cuts(plane: MeasuredPlane, controller: ContinuousController) -> Cuts:
    """Return the opened loops of a plane with a controller.

    Parameters
    ----------
    plane : MeasuredPlane
        Plane with its responses on GRID_RADPS.
    controller : ContinuousController
        Controller of the plane.

    Returns
    -------
    Cuts
        Loops opened at the surface and at the outer output, on GRID_RADPS.

    Notes
    -----
    With K_i the controller's response from output i to the command and G_i the plant's from the
    command to output i: L_surface = -sum_i K_i G_i. The outer loop takes the outputs of heading or
    depth, divided by one plus the loop over the inner outputs.
    """
    loops = -lqg_controller.response(controller, GRID_RADPS) * plane.command
    n_inner = 1 if plane.command.shape[1] == 2 else 2
    return Cuts(
        loops.sum(axis=1), loops[:, n_inner:].sum(axis=1) / (1.0 + loops[:, :n_inner].sum(axis=1))
    )


def violations(
    plane: MeasuredPlane,
    controller: ContinuousController,
    bounds: Bounds,
    finishing: Spec | None = None,
) -> ConstraintViolation:
    """Return the constraint violations of a plane with a controller.

    Parameters
    ----------
    plane : MeasuredPlane
        Plane with its outputs.
    controller : ContinuousController
        Controller.
    bounds : Bounds
        Stability bounds.
    finishing : Spec, optional
        Limits the residual error after an offset of the surface and, in pitch, after a change of
        buoyancy.

    Returns
    -------
    dict
        Relative violations; "stability" is the largest real part of the poles (rad/s).
    """
    loops, (surface, outer) = cuts(plane, controller), plane.names
    analysis = constraints.analyse(
        {surface: loops.surface, outer: loops.outer}, _close(plane, controller), outer
    )
    modes = analysis.modes
    violated = {
        "stability": float(np.max(modes.values.real)),
        **constraints.violations(analysis, bounds),
    }
    if finishing is None:
        return violated
    state = modal.OBSERVED_STATES[outer][outer]
    violated |= constraints.load_violation(modes, plane.plane.B, state, outer, finishing)
    if outer == "depth":
        violated |= constraints.load_violation(
            modes, np.eye(1, 4)[0], state, "depth with new buoyancy", finishing
        )
    return violated


def _close(plane: MeasuredPlane, controller: ContinuousController) -> loop_state_space.ClosedLoop:
    """Return the closed loop with a Pade delay."""
    A, B = loop_state_space.plane_with_tailcone(plane.plane, plane.lag, PADE_ORDER)
    C = np.zeros((plane.command.shape[1], len(B)))
    C[:, : len(plane.plane.B)] = outputs(plane.plane)
    return lqg_controller.close(controller, A, B, C)


class DisturbanceResponse(NamedTuple):
    """Standard deviations under the model's disturbance (rad, m, s)."""

    outputs: Array
    """Standard deviation of each measured output."""
    command_rad: float
    """Standard deviation of the command (rad)."""
    noise_rad: float
    """Standard deviation of the command caused by gyro noise alone (rad)."""
    noise_outputs: Array
    """Standard deviation of each output caused by gyro noise alone."""


def disturbance_response(
    plane: MeasuredPlane, controller: ContinuousController
) -> DisturbanceResponse:
    """Return the standard deviations under the model's disturbance.

    Notes
    -----
    With S = 1 / (1 - sum_i K_i G_i) and M_i the response of output i to a disturbance::

        u = S sum_i K_i M_i           y_i = M_i + G_i u
        sigma^2 = (1 / pi) integral of |.|^2 S_d dw                              (Parseval)

    The variances of all disturbances add. Gyro noise enters at the first output; above the grid the
    loop is taken as open.
    """
    feedback = lqg_controller.response(controller, GRID_RADPS)
    feedback_above_grid = lqg_controller.response(controller, HIGH_GRID_RADPS)
    sensitivity = 1.0 / (1.0 - (feedback * plane.command).sum(axis=1))
    powers = []
    for disturbance in plane.disturbances:
        command = (feedback * disturbance.outputs).sum(axis=1) * sensitivity
        signals = np.column_stack([disturbance.outputs + plane.command * command[:, None], command])
        powers.append([_power(signal, GRID_RADPS, disturbance.density) for signal in signals.T])
    *output_sds, command_sd = np.sqrt(np.sum(powers, axis=0))
    by_noise = feedback[:, 0] * sensitivity
    noise = _power(by_noise, GRID_RADPS) + _power(feedback_above_grid[:, 0], HIGH_GRID_RADPS)
    moved = [_power(signal, GRID_RADPS) for signal in (plane.command * by_noise[:, None]).T]
    return DisturbanceResponse(
        np.array(output_sds),
        float(command_sd),
        plane.noise_radps * math.sqrt(noise),
        plane.noise_radps * np.sqrt(moved),
    )


def _power(transfer: ComplexArray, frequencies_radps: Array, density: Array | float = 1.0) -> float:
    """Integrate |transfer|^2 density over positive frequencies (Parseval, two-sided density)."""
    return float(np.trapezoid(np.abs(transfer) ** 2 * density, frequencies_radps)) / math.pi
