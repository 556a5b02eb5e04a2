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
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel
from sitl.vehicle import propeller, runge_kutta
from sitl.vehicle.runge_kutta import STAGES
from sysid.data.segments import RATE_HZ
from sysid.estimation.map.datasets import Dataset
from sysid.models import greybox
from sysid.models.greybox import N_COUPLING
from sysid.models.parameters import CandidateVehicle
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
    part: Literal["body", "tailcone"]
    """Part that the parameter changes.

    Forces on the body, or response of the duct to its command.
    """
    vehicle: CandidateVehicle
    speeds_mps: Mapping[float, float]
    """Cruise speed by thrust, m/s; empty if the parameter does not change it."""


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
    base = dynamics.evaluate(vehicle)
    df_dx = np.zeros((len(tracks), STATES, STATES))
    for i in np.flatnonzero(FD_STEP):
        df_dx[:, :, i] = (
            dynamics.evaluate(vehicle, track=tracks + FD_STEP * (np.arange(STATES) == i)) - base
        ) / FD_STEP[i]
    df_du = (
        dynamics.evaluate(vehicle, duct_rad=ducts + FD_DUCT_STEP_RAD) - base
    ) / FD_DUCT_STEP_RAD
    df_dtheta = np.zeros((len(tracks), STATES, columns))
    for perturbation in perturbations:
        if perturbation.part == "body":
            df_dtheta[:, :, perturbation.column] = (
                dynamics.evaluate(perturbation.vehicle) - base
            ) / step
    derivatives, row = [], 0
    for data, trajectory in zip(datasets, trajectories, strict=True):
        rows = slice(row, row + len(trajectory.track))
        du_dtheta, dx0_dtheta = _inputs(data, trajectory, perturbations, step, columns)
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

    def evaluate(
        self, vehicle: CandidateVehicle, track: Array | None = None, duct_rad: Array | None = None
    ) -> Array:
        """Return the derivatives of the states (rows, 5).

        Track or duct angle may be replaced by perturbed ones.
        """
        return greybox.slopes_along(
            self.track if track is None else track,
            self.duct_rad if duct_rad is None else duct_rad,
            self.thrust * propeller.rps(1.0, vehicle.model),
            PLANES[self.plane].is_yaw,
            greybox.constraint(vehicle.model, self.plane),
            vehicle.model,
            self.cross_plane_inputs,
        )


def _inputs(
    data: Dataset,
    trajectory: Trajectory,
    perturbations: Sequence[Perturbation],
    step: float,
    columns: int,
) -> tuple[Array, Array]:
    """Return the slopes of duct angle (samples, columns) and initial state (5, columns)."""
    du_dtheta, dx0_dtheta = (
        np.zeros((trajectory.duct_rad.size, columns)),
        np.zeros((STATES, columns)),
    )
    run = data.run
    for perturbation in perturbations:
        if perturbation.part == "tailcone":
            duct = greybox.duct_along(run, run.plane, perturbation.vehicle.actuators[run.plane])
            du_dtheta[:, perturbation.column] = (duct - trajectory.duct_rad) / step
        if perturbation.speeds_mps:
            first = greybox.first_state(
                run, data.start, perturbation.speeds_mps[float(run.thrust[0])]
            )
            dx0_dtheta[:, perturbation.column] = (first - trajectory.first) / step
    return du_dtheta, dx0_dtheta


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
