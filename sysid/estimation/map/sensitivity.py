"""Sensitivities of a plane's simulated states to all parameters at once, to first order.

Symbols: x states (u, v or w, rate, angle, z) in the paper's axes (m/s, rad/s, rad, m), delta duct
angle (rad), p parameters, S = dx/dz. Along a simulated trajectory x' = f(x, delta; p) the
sensitivities satisfy (Jategaonkar 2015, ch. 4)::

    S' = f_x S + f_delta d(delta)/dz + f_z,    S(0) = dx(0)/dz

f_x, f_delta and f_z are forward differences of the equations of motion that simulate, evaluated
once at every row of the trajectory. A parameter therefore costs one evaluation per step, where a
simulation of its own would cost four, and the initial state of every run.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel
from sitl.core import tailcone
from sitl.core.tailcone import TailconeAxis
from sitl.vehicle import propeller, runge_kutta
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.runge_kutta import STAGES
from sysid.data.segments import RATE_HZ
from sysid.estimation.map.datasets import Dataset
from sysid.models import greybox
from sysid.models.greybox import N_COUPLING
from sysid.models.parameters import CandidateVehicle, Part
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

STATES = 5
"""Number of states of one plane."""
FD_STEP = np.array([1e-6, 1e-6, 1e-6, 1e-6, 0.0])
"""Difference steps of the states (m/s, m/s, rad/s, rad, m); depth has no effect on the motion."""
FD_DUCT_STEP_RAD = 1e-6
"""Difference step of the duct angle, rad."""


class Trajectory(NamedTuple):
    """Simulation of one run."""

    track: Array
    """(rows, 5): u, v or w, rate, angle, z in the paper's axes, one row per step of the fit."""
    duct_rad: Array
    """(samples,), duct angle on the 50 Hz grid, rad."""
    thrust: Array
    """(rows,), fraction of full shaft speed."""
    cross_plane_inputs: Array
    """(rows, N_COUPLING), motion of the other plane."""
    first: Array
    """(5,), initial state."""


class Perturbation(NamedTuple):
    """Candidate vehicle one difference step away along one parameter."""

    column: int
    """Index of the parameter."""
    part: Part
    """Part that the parameter changes.

    Forces on the body, response of the duct to its command, or measured outputs.
    """
    vehicle: CandidateVehicle
    speeds_mps: Mapping[float, float]
    """Cruise speed by thrust, m/s; empty if the parameter does not change it."""
    backward: bool = False
    """Whether the step is negative, because the vehicle of a positive one is impossible."""


def simulate(
    vehicle: CandidateVehicle,
    plane: Plane,
    datasets: Sequence[Dataset],
    stride: int,
    speeds_mps: Mapping[float, float],
) -> list[Trajectory]:
    """Simulate the runs of one plane with a candidate.

    ``speeds_mps`` are the cruise speeds of the candidate by thrust, m/s.
    """
    inverse, full_rps = greybox.constraint(vehicle.model, plane), propeller.rps(1.0, vehicle.model)
    trajectories = []
    for data in datasets:
        run = data.run
        first = greybox.first_state(run, data.start, speeds_mps[float(run.thrust[0])])
        duct = greybox.duct_along(run, plane, vehicle.actuators[plane])
        cross_plane_inputs = data.cross_plane_inputs
        track = greybox.integrate(
            first,
            duct,
            run.thrust * full_rps,
            stride,
            1.0 / RATE_HZ,
            PLANES[plane].is_yaw,
            inverse,
            vehicle.model,
            cross_plane_inputs,
        )
        rows = slice(0, stride * len(track), stride)
        row_inputs = (
            np.zeros((len(track), N_COUPLING))
            if cross_plane_inputs is None
            else cross_plane_inputs[rows]
        )
        trajectories.append(
            Trajectory(
                track=track,
                duct_rad=duct,
                thrust=run.thrust[rows],
                cross_plane_inputs=row_inputs,
                first=first,
            )
        )
    return trajectories


def sensitivities(
    vehicle: CandidateVehicle,
    plane: Plane,
    datasets: Sequence[Dataset],
    trajectories: Sequence[Trajectory],
    perturbations: Sequence[Perturbation],
    step: float,
    stride: int,
) -> list[Array]:
    """Return the derivatives of each trajectory by the parameters, (rows, 5, columns) for each run.

    ``perturbations`` are the candidates that are ``step`` (prior standard deviations) away, one for
    each column.
    """
    # Forward differences of the derivative f(x, u; theta) of the states at all rows, u duct angle:
    # by each state (f(x + d e_i, u) - f(x, u)) / d, and so by u and each parameter of the body.
    columns = len(perturbations)
    tracks = np.concatenate([trajectory.track for trajectory in trajectories])
    ducts = np.concatenate(
        [trajectory.duct_rad[::stride][: len(trajectory.track)] for trajectory in trajectories]
    )
    dynamics = _SlopeInputs(
        track=tracks,
        duct_rad=ducts,
        thrust=np.concatenate([trajectory.thrust for trajectory in trajectories]),
        plane=plane,
        cross_plane_inputs=np.concatenate(
            [trajectory.cross_plane_inputs for trajectory in trajectories]
        ),
    )
    base, df_du = np.empty((len(tracks), STATES)), np.empty((len(tracks), STATES))
    df_dx = np.zeros((len(tracks), STATES, STATES))
    _input_slopes(*dynamics.arguments(vehicle), base, df_dx, df_du)
    df_dtheta = np.zeros((len(tracks), STATES, columns))
    for perturbation in perturbations:
        if perturbation.part == "body":
            arguments = dynamics.arguments(perturbation.vehicle)
            _parameter_slope(*arguments, base, step, perturbation.column, df_dtheta)
    axes = {
        perturbation.column: greybox.discretise(
            perturbation.vehicle.actuators[plane], 1.0 / RATE_HZ
        )
        for perturbation in perturbations
        if perturbation.part == "tailcone"
    }
    derivatives, row = [], 0
    for data, trajectory in zip(datasets, trajectories, strict=True):
        rows = slice(row, row + len(trajectory.track))
        du_dtheta, dx0_dtheta = _inputs(data, trajectory, perturbations, axes, step, columns)
        derivatives.append(
            _propagate(
                df_dx[rows],
                df_du[rows],
                df_dtheta[rows],
                du_dtheta,
                dx0_dtheta,
                stride,
                stride / RATE_HZ,
            )
        )
        row += len(trajectory.track)
    return derivatives


class _SlopeInputs(NamedTuple):
    """States and inputs at which the equations of motion are evaluated: all rows of all runs."""

    track: Array
    duct_rad: Array
    thrust: Array
    plane: Plane
    cross_plane_inputs: Array

    def arguments(
        self, vehicle: CandidateVehicle
    ) -> tuple[Array, Array, Array, bool, Array, VehicleModel, Array]:
        """Return the first arguments of `_input_slopes` and `_parameter_slope`."""
        return (
            self.track,
            self.duct_rad,
            self.thrust * propeller.rps(1.0, vehicle.model),
            PLANES[self.plane].is_yaw,
            greybox.constraint(vehicle.model, self.plane),
            vehicle.model,
            self.cross_plane_inputs,
        )


@kernel
def _input_slopes(
    track: Array,
    duct: Array,
    rps: Array,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    coupling: Array,
    base: Array,
    df_dx: Array,
    df_du: Array,
) -> None:
    """Write the derivatives f of the states, and their slopes by the states and the duct angle.

    base[row] = f(x, u), df_dx[row, :, i] = (f(x + d e_i, u) - f(x, u)) / d with d = FD_STEP[i]
    where d > 0; df_du is the same for u.
    """
    x, out = np.empty(STATES), np.empty(STATES)
    for row in range(len(track)):
        for i in range(-1, STATES + 1):  # base; each state; duct angle
            if 0 <= i < STATES and FD_STEP[i] == 0.0:
                continue
            for j in range(STATES):
                x[j] = track[row, j] + (FD_STEP[i] if i == j else 0.0)
            duct_rad = duct[row] + FD_DUCT_STEP_RAD if i == STATES else duct[row]
            greybox.plane_slopes(x, duct_rad, coupling[row], rps[row], is_yaw, inverse, model, out)
            for j in range(STATES):
                if i < 0:
                    base[row, j] = out[j]
                elif i < STATES:
                    df_dx[row, j, i] = (out[j] - base[row, j]) / FD_STEP[i]
                else:
                    df_du[row, j] = (out[j] - base[row, j]) / FD_DUCT_STEP_RAD


@kernel
def _parameter_slope(
    track: Array,
    duct: Array,
    rps: Array,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    coupling: Array,
    base: Array,
    step: float,
    column: int,
    df_dtheta: Array,
) -> None:
    """Write the slope of ``base`` by one parameter; the vehicle is one ``step`` away along it."""
    out = np.empty(STATES)
    for row in range(len(track)):
        greybox.plane_slopes(
            track[row], duct[row], coupling[row], rps[row], is_yaw, inverse, model, out
        )
        for j in range(STATES):
            df_dtheta[row, j, column] = (out[j] - base[row, j]) / step


def _inputs(
    data: Dataset,
    trajectory: Trajectory,
    perturbations: Sequence[Perturbation],
    axes: Mapping[int, TailconeAxis],
    step: float,
    columns: int,
) -> tuple[Array, Array]:
    """Return the slopes of duct angle (samples, columns) and initial state (5, columns).

    ``axes`` are the perturbed actuators by column.
    """
    run = data.run
    du_dtheta = np.zeros((trajectory.duct_rad.size, columns))
    dx0_dtheta = np.zeros((STATES, columns))
    history_rad = run.history_rad(run.plane)
    for column, axis in axes.items():
        _duct_slope(axis, history_rad, trajectory.duct_rad, step, column, du_dtheta)
    for perturbation in perturbations:
        if perturbation.speeds_mps:
            first = greybox.first_state(
                run, data.start, perturbation.speeds_mps[float(run.thrust[0])]
            )
            dx0_dtheta[:, perturbation.column] = (first - trajectory.first) / step
    return du_dtheta, dx0_dtheta


@kernel
def _duct_slope(
    axis: TailconeAxis,
    commands_rad: Array,
    duct_rad: Array,
    step: float,
    column: int,
    du_dtheta: Array,
) -> None:
    """Write the slope of the duct angle by one parameter; ``axis`` is one ``step`` away along it.

    The last commands belong to the samples of ``duct_rad``.
    """
    perturbed_rad = tailcone.respond(axis, commands_rad)
    earlier = commands_rad.size - duct_rad.size
    for k in range(duct_rad.size):
        du_dtheta[k, column] = (perturbed_rad[earlier + k] - duct_rad[k]) / step


@kernel
def _propagate(
    df_dx: Array,
    df_du: Array,
    df_dtheta: Array,
    du_dtheta: Array,
    dx0_dtheta: Array,
    stride: int,
    h: float,
) -> Array:
    """Integrate S' = df_dx S + df_du du_dtheta + df_dtheta by the classical Runge-Kutta method.

    Step h (s). The coefficients are linear between two rows; du_dtheta is the mean of the 50 Hz
    samples around each stage.
    """
    # Equations: module docstring; S in rows i (states) and columns c (parameters), flat in memory.
    rows, _, columns = df_dtheta.shape
    S = np.empty((rows, STATES * columns))
    S[0] = dx0_dtheta.reshape(-1)
    slopes, stage_row = np.empty((STAGES, STATES * columns)), np.empty(STATES * columns)
    stage_S = stage_row.reshape(STATES, columns)
    for row in range(1, rows):
        for stage in range(STAGES):
            fraction = runge_kutta.stage_fraction(stage)
            early, late = runge_kutta.samples_at(stage, (row - 1) * stride, stride)
            runge_kutta.stage_state(stage, S[row - 1], slopes, h, stage_row)
            slope = slopes[stage].reshape(STATES, columns)
            for i in range(STATES):
                weighted_df_du = (1.0 - fraction) * df_du[row - 1, i] + fraction * df_du[row, i]
                for c in range(columns):
                    slope[i, c] = (
                        (1.0 - fraction) * df_dtheta[row - 1, i, c]
                        + fraction * df_dtheta[row, i, c]
                        + 0.5 * weighted_df_du * (du_dtheta[early, c] + du_dtheta[late, c])
                    )
                for j in range(STATES - 1):
                    weighted_df_dx = (1.0 - fraction) * df_dx[row - 1, i, j] + fraction * df_dx[
                        row, i, j
                    ]
                    for c in range(columns):
                        slope[i, c] += weighted_df_dx * stage_S[j, c]
        runge_kutta.combine(S[row - 1], slopes, h, S[row])
    return S.reshape(rows, STATES, columns)
