"""Sensitivities of a plane's simulated states to all parameters at once, to first order.

Symbols: x states (u, v or w, rate, angle, z) in the paper's axes (m/s, rad/s, rad, m), delta duct
angle (rad), p parameters, S = dx/dz. Along a simulated trajectory x' = f(x, delta; p) the
sensitivities satisfy (Jategaonkar 2015, ch. 4)::

    S' = f_x S + f_delta d(delta)/dz + f_z,    S(0) = dx(0)/dz

f_x, f_delta and f_z are forward differences of the equations of motion that simulate, evaluated
once at every row of the trajectory. A parameter therefore costs one evaluation per step, where a
simulation of its own would cost four, and the initial state of every run. Crossflow drag and the
wrench of the tail take most of an evaluation. They are computed again only where a state or a
parameter changes them.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel
from sitl.core import tailcone
from sitl.core.tailcone import TailconeAxis
from sitl.vehicle import forces, hydrodynamics, runge_kutta
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.runge_kutta import STAGES
from sitl.vehicle.vectors import Wrench
from sysid.data.runs import RATE_HZ
from sysid.estimation.map.datasets import Dataset
from sysid.models import greybox
from sysid.models.greybox import N_COUPLING
from sysid.models.parameters import CandidateVehicle, Part
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

STATES = 5
"""Number of states of one plane."""
ACCELERATIONS = 3
"""Number of the first states whose derivatives are accelerations: forces change no others."""
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
    inverse, full_rps = greybox.constraint(vehicle.model, plane), vehicle.model.propeller.full_rps
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
    each column: first those of the body, then those of the tailcone, then those of the sensors.
    """
    # Forward differences of the derivative f(x, u; theta) of the states at all rows, u duct angle:
    # by each state (f(x + d e_i, u) - f(x, u)) / d, and so by u and each parameter of the body.
    of_body = [perturbation for perturbation in perturbations if perturbation.part == "body"]
    of_tailcone = [
        perturbation for perturbation in perturbations if perturbation.part == "tailcone"
    ]
    tracks = np.concatenate([trajectory.track for trajectory in trajectories])
    ducts = np.concatenate(
        [trajectory.duct_rad[::stride][: len(trajectory.track)] for trajectory in trajectories]
    )
    motion = _Motion(
        track=tracks,
        duct_rad=ducts,
        thrust=np.concatenate([trajectory.thrust for trajectory in trajectories]),
        plane=plane,
        cross_plane_inputs=np.concatenate(
            [trajectory.cross_plane_inputs for trajectory in trajectories]
        ),
    )
    model = vehicle.model
    base = motion.evaluate(model)
    df_dx = np.zeros((len(tracks), STATES, STATES))
    for i in range(STATES):
        if FD_STEP[i] > 0.0:
            perturbed = motion._replace(track=tracks + FD_STEP[i] * (np.arange(STATES) == i))
            slopes = perturbed.evaluate(model, base, STATE_CHANGES[i]).slopes
            df_dx[:, :, i] = (slopes - base.slopes) / FD_STEP[i]
    rotated = motion._replace(duct_rad=ducts + FD_DUCT_STEP_RAD)
    df_du = (rotated.evaluate(model, base, DUCT_CHANGES).slopes - base.slopes) / FD_DUCT_STEP_RAD
    df_dtheta = np.empty((len(tracks), ACCELERATIONS, len(of_body)))
    for column, perturbation in enumerate(of_body):
        changed = perturbation.vehicle.model
        slopes = motion.evaluate(changed, base, _changes(model, changed)).slopes
        df_dtheta[:, :, column] = (slopes - base.slopes)[:, :ACCELERATIONS] / step
    axes = [
        greybox.discretise(perturbation.vehicle.actuators[plane], 1.0 / RATE_HZ)
        for perturbation in of_tailcone
    ]
    derivatives, row = [], 0
    all_du_dtheta = _duct_slopes(datasets, trajectories, axes, step)
    for data, trajectory, du_dtheta in zip(datasets, trajectories, all_du_dtheta, strict=True):
        rows = slice(row, row + len(trajectory.track))
        derivatives.append(
            _propagate(
                df_dx[rows],
                df_du[rows],
                df_dtheta[rows],
                du_dtheta,
                _initial_slopes(data, trajectory, perturbations, step),
                stride,
                stride / RATE_HZ,
            )
        )
        row += len(trajectory.track)
    return derivatives


class _Changes(NamedTuple):
    """Which of the two costly parts of the forces a change of state or model changes."""

    crossflow: bool
    """Crossflow drag of the hull."""
    tail: bool
    """Wrench of ring wing, propeller and fins."""


EVERYTHING = _Changes(crossflow=True, tail=True)
STATE_CHANGES = (
    _Changes(crossflow=False, tail=True),
    EVERYTHING,
    EVERYTHING,
    _Changes(crossflow=False, tail=False),
    _Changes(crossflow=False, tail=False),
)
"""What a change of axial speed, cross speed, rate, angle and z changes."""
DUCT_CHANGES = _Changes(crossflow=False, tail=True)
"""What a change of the duct angle changes."""


class _Derivatives(NamedTuple):
    """Derivatives of the states at all rows, and the two costly parts of the forces."""

    slopes: Array
    """(rows, 5)."""
    crossflow: Array
    """(rows, 6), see ``hydrodynamics.crossflow_drag``."""
    at_tail: Array
    """(rows, 6), see ``forces.at_tail``."""


class _Motion(NamedTuple):
    """States and inputs at which the equations of motion are evaluated: all rows of all runs."""

    track: Array
    duct_rad: Array
    thrust: Array
    plane: Plane
    cross_plane_inputs: Array

    def evaluate(
        self,
        model: VehicleModel,
        base: _Derivatives | None = None,
        changes: _Changes = EVERYTHING,
    ) -> _Derivatives:
        """Return the derivatives; what does not change is taken from ``base``."""
        arguments = (
            self.track,
            self.duct_rad,
            self.thrust * model.propeller.full_rps,
            PLANES[self.plane].is_yaw,
            model,
            self.cross_plane_inputs,
        )
        crossflow = base.crossflow if base and not changes.crossflow else _crossflow(*arguments)
        at_tail = base.at_tail if base and not changes.tail else _at_tail(*arguments)
        inverse = greybox.constraint(model, self.plane)
        slopes = _accelerate(*arguments, inverse, crossflow, at_tail)
        return _Derivatives(slopes, crossflow, at_tail)


def _changes(model: VehicleModel, changed: VehicleModel) -> _Changes:
    """Return which parts of the forces differ between two models."""
    tails = [(each.duct, each.fins, each.propeller) for each in (model, changed)]
    return _Changes(
        crossflow=not _is_equal(model.stations, changed.stations), tail=not _is_equal(*tails)
    )


def _is_equal(record: object, other: object) -> bool:
    """Return whether two records of numbers, arrays and records are equal."""
    if isinstance(record, tuple) and isinstance(other, tuple):
        return all(map(_is_equal, record, other))
    if isinstance(record, np.ndarray) and isinstance(other, np.ndarray):
        return record.tobytes() == other.tobytes()
    return record == other


@kernel
def _crossflow(
    track: Array,
    duct: Array,
    rps: Array,
    is_yaw: bool,
    model: VehicleModel,
    coupling: Array,
) -> Array:
    """Return the crossflow drag (rows, 6) at all rows."""
    wrenches = np.empty((len(track), 6))
    for row in range(len(track)):
        flow, _ = greybox.flow_and_tail(
            track[row], duct[row], coupling[row], rps[row], is_yaw, model
        )
        _, v, w, _, q, r = flow.nu_flow
        wrench = hydrodynamics.crossflow_drag(v, w, q, r, model.stations)
        for j in range(6):
            wrenches[row, j] = wrench[j]
    return wrenches


@kernel
def _at_tail(
    track: Array,
    duct: Array,
    rps: Array,
    is_yaw: bool,
    model: VehicleModel,
    coupling: Array,
) -> Array:
    """Return the wrench of the tail (rows, 6) at all rows."""
    wrenches = np.empty((len(track), 6))
    for row in range(len(track)):
        flow, tail = greybox.flow_and_tail(
            track[row], duct[row], coupling[row], rps[row], is_yaw, model
        )
        wrench = forces.at_tail(flow, tail, model)
        for j in range(6):
            wrenches[row, j] = wrench[j]
    return wrenches


@kernel
def _accelerate(
    track: Array,
    duct: Array,
    rps: Array,
    is_yaw: bool,
    model: VehicleModel,
    coupling: Array,
    inverse: Array,
    crossflow: Array,
    at_tail: Array,
) -> Array:
    """Return the derivatives of the states (rows, 5), with known crossflow drag and tail."""
    slopes = np.empty((len(track), STATES))
    for row in range(len(track)):
        flow, tail = greybox.flow_and_tail(
            track[row], duct[row], coupling[row], rps[row], is_yaw, model
        )
        wrench = forces.total_of(flow, tail, _wrench(crossflow[row]), _wrench(at_tail[row]), model)
        greybox.accelerate(flow, wrench, coupling[row], is_yaw, inverse, slopes[row])
    return slopes


@kernel
def _wrench(components: Array) -> Wrench:
    """Return a wrench from its components."""
    return (
        components[0],
        components[1],
        components[2],
        components[3],
        components[4],
        components[5],
    )


def _duct_slopes(
    datasets: Sequence[Dataset],
    trajectories: Sequence[Trajectory],
    axes: Sequence[TailconeAxis],
    step: float,
) -> list[Array]:
    """Return the slopes of the duct angle of each run by the tailcone's parameters.

    Shape (samples, axes) for each run. ``axes`` are the perturbed actuators.
    """
    histories_rad = [data.run.history_rad(data.run.plane) for data in datasets]
    commands_rad = np.concatenate(histories_rad)
    duct_rad = np.concatenate([trajectory.duct_rad for trajectory in trajectories])
    command_ends = np.cumsum([history.size for history in histories_rad])
    duct_ends = np.cumsum([trajectory.duct_rad.size for trajectory in trajectories])
    du_dtheta = np.empty((duct_rad.size, len(axes)))
    for column, axis in enumerate(axes):
        _duct_slope(axis, commands_rad, command_ends, duct_rad, duct_ends, step, column, du_dtheta)
    return np.split(du_dtheta, duct_ends[:-1])


@kernel
def _duct_slope(
    axis: TailconeAxis,
    commands_rad: Array,
    command_ends: NDArray[np.int64],
    duct_rad: Array,
    duct_ends: NDArray[np.int64],
    step: float,
    column: int,
    du_dtheta: Array,
) -> None:
    """Write the slope of the duct angle by one parameter; ``axis`` is one ``step`` away along it.

    The runs follow one another up to their ends. The last commands of a run belong to the samples
    of its duct angle.
    """
    command_start = duct_start = 0
    for run in range(duct_ends.size):
        command_end, duct_end = command_ends[run], duct_ends[run]
        perturbed_rad = tailcone.respond(axis, commands_rad[command_start:command_end])
        earlier = perturbed_rad.size - duct_end
        for k in range(duct_start, duct_end):
            du_dtheta[k, column] = (perturbed_rad[earlier + k] - duct_rad[k]) / step
        command_start, duct_start = command_end, duct_end


def _initial_slopes(
    data: Dataset,
    trajectory: Trajectory,
    perturbations: Sequence[Perturbation],
    step: float,
) -> Array:
    """Return the slopes of the initial state of a run by the parameters, (5, columns)."""
    dx0_dtheta = np.zeros((STATES, len(perturbations)))
    run = data.run
    for column, perturbation in enumerate(perturbations):
        if perturbation.speeds_mps:
            first = greybox.first_state(
                run, data.start, perturbation.speeds_mps[float(run.thrust[0])]
            )
            dx0_dtheta[:, column] = (first - trajectory.first) / step
    return dx0_dtheta


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
    samples around each stage. Forces change the accelerations only; df_dtheta (rows, 3, body) and
    du_dtheta (samples, tailcone) belong to the first columns, the others stay as they begin.
    """
    # Equations: module docstring; S in rows i (states) and columns c (parameters), flat in memory.
    rows, _, n_body = df_dtheta.shape
    n_tailcone, columns = du_dtheta.shape[1], dx0_dtheta.shape[1]
    S = np.empty((rows, STATES * columns))
    S[0] = dx0_dtheta.reshape(-1)
    slopes, stage_row = np.empty((STAGES, STATES * columns)), np.empty(STATES * columns)
    stage_S = stage_row.reshape(STATES, columns)
    weighted_df_dx, forcing = np.empty((STATES, STATES)), np.zeros((STATES, columns))
    for row in range(1, rows):
        for stage in range(STAGES):
            if stage != 2:  # both stages at the half step have the same coefficients
                fraction = runge_kutta.stage_fraction(stage)
                early, late = runge_kutta.samples_at(stage, (row - 1) * stride, stride)
                for i in range(STATES):
                    for j in range(STATES):
                        weighted_df_dx[i, j] = (1.0 - fraction) * df_dx[
                            row - 1, i, j
                        ] + fraction * df_dx[row, i, j]
                for i in range(ACCELERATIONS):
                    weighted_df_du = (1.0 - fraction) * df_du[row - 1, i] + fraction * df_du[row, i]
                    for c in range(n_body):
                        forcing[i, c] = (1.0 - fraction) * df_dtheta[
                            row - 1, i, c
                        ] + fraction * df_dtheta[row, i, c]
                    for c in range(n_tailcone):
                        forcing[i, n_body + c] = (
                            0.5 * weighted_df_du * (du_dtheta[early, c] + du_dtheta[late, c])
                        )
            runge_kutta.stage_state(stage, S[row - 1], slopes, h, stage_row)
            slope = slopes[stage].reshape(STATES, columns)
            for i in range(STATES):  # the last state, the depth, changes no slope
                a, b, c, d, _ = weighted_df_dx[i]
                for k in range(columns):
                    slope[i, k] = (
                        forcing[i, k]
                        + a * stage_S[0, k]
                        + b * stage_S[1, k]
                        + c * stage_S[2, k]
                        + d * stage_S[3, k]
                    )
        runge_kutta.combine(S[row - 1], slopes, h, S[row])
    return S.reshape(rows, STATES, columns)
