"""How a plane's simulated runs move with each parameter, to first order and all parameters at once.

Along a simulated track x' = f(x, duct; p) the sensitivities S = dx/dz obey S' = f_x S + f_duct
d(duct)/dz + f_z (Jategaonkar 2015, ch. 4). The slopes of f are differences of the very equations
that simulate, taken once at every step; so one candidate costs a step's evaluation where a run of
its own would cost four, with every run's start."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import propeller
from sitl.vehicle.jit import kernel
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map.datasets import Dataset
from sysid.models import greybox
from sysid.models.greybox import N_COUPLING
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]

STATES = 5
FD_STEP = np.array([1e-6, 1e-6, 1e-6, 1e-6, 0.0])
"""Steps of the differences by the states; depth acts on nothing."""
FD_DUCT_STEP_RAD = 1e-6


class Trajectory(NamedTuple):
    """One run as a candidate flies it."""

    track: Array
    """(rows, 5): u, v or w, rate, angle, z, one row a step; the paper's axes."""
    duct_rad: Array
    """(samples,) on the 50 Hz grid."""
    thrust: Array
    """(rows,), fraction of full."""
    around: Array
    """(rows, AROUND)."""
    first: Array
    """(5,): where it starts."""


class Perturbation(NamedTuple):
    """A candidate moved by a small step of one parameter."""

    column: int
    part: Literal["body", "tailcone"]
    """What that changes: the forces, or how the duct follows its command."""
    vehicle: CandidateVehicle
    speeds_mps: Mapping[float, float]
    """Cruise speeds by thrust, where they change."""


def simulate(
    vehicle: CandidateVehicle,
    plane: Plane,
    experiments: Sequence[Dataset],
    stride: int,
    speeds_mps: Mapping[float, float],
) -> list[Trajectory]:
    """The runs of one plane, flown by a candidate; ``speeds_mps`` are its cruise speeds by
    thrust."""
    inverse, full_rps = greybox.constraint(vehicle.model, plane), propeller.rps(1.0, vehicle.model)
    found = []
    for what in experiments:
        run = what.run
        first = greybox.first_state(run, what.start, speeds_mps[float(run.thrust[0])])
        duct = greybox.duct_along(run, plane, vehicle.actuators[plane])
        around = what.around
        track = greybox.integrate(
            first,
            duct,
            run.thrust * full_rps,
            stride,
            1.0 / RATE_HZ,
            plane == "yaw",
            inverse,
            vehicle.model,
            around,
        )
        rows = slice(0, stride * len(track), stride)
        near = np.zeros((len(track), N_COUPLING)) if around is None else around[rows]
        found.append(Trajectory(track, duct, run.thrust[rows], near, first))
    return found


def sensitivities(
    vehicle: CandidateVehicle,
    plane: Plane,
    experiments: Sequence[Dataset],
    flown: Sequence[Trajectory],
    moved: Sequence[Perturbation],
    step: float,
    stride: int,
) -> list[Array]:
    """Of each flight, (rows, 5, columns): the derivatives of its track by z, one column for each of
    ``moved``.

    ``moved`` are the candidates a ``step`` away.
    """
    columns = len(moved)
    tracks = np.concatenate([flight.track for flight in flown])
    ducts = np.concatenate([flight.duct_rad[::stride][: len(flight.track)] for flight in flown])
    slopes = _SlopeInputs(
        tracks,
        ducts,
        np.concatenate([f.thrust for f in flown]),
        plane,
        np.concatenate([f.around for f in flown]),
    )
    base = slopes.of(vehicle)
    by_state = np.zeros((len(tracks), STATES, STATES))
    for i in np.flatnonzero(FD_STEP):
        by_state[:, :, i] = (
            slopes.of(vehicle, track=tracks + FD_STEP * (np.arange(STATES) == i)) - base
        ) / FD_STEP[i]
    by_duct = (slopes.of(vehicle, duct_rad=ducts + FD_DUCT_STEP_RAD) - base) / FD_DUCT_STEP_RAD
    by_parameter = np.zeros((len(tracks), STATES, columns))
    for each in moved:
        if each.part == "body":
            by_parameter[:, :, each.column] = (slopes.of(each.vehicle) - base) / step
    found, row = [], 0
    for what, flight in zip(experiments, flown, strict=True):
        rows = slice(row, row + len(flight.track))
        turned, started = _inputs(what, flight, moved, step, columns)
        found.append(
            _propagate(
                by_state[rows],
                by_duct[rows],
                by_parameter[rows],
                turned,
                started,
                stride,
                stride / RATE_HZ,
            )
        )
        row += len(flight.track)
    return found


class _SlopeInputs(NamedTuple):
    """Where the equations of motion are to be evaluated: all rows of all runs."""

    track: Array
    duct_rad: Array
    thrust: Array
    plane: Plane
    around: Array

    def of(
        self, vehicle: CandidateVehicle, track: Array | None = None, duct_rad: Array | None = None
    ) -> Array:
        return greybox.slopes_along(
            self.track if track is None else track,
            self.duct_rad if duct_rad is None else duct_rad,
            self.thrust * propeller.rps(1.0, vehicle.model),
            self.plane == "yaw",
            greybox.constraint(vehicle.model, self.plane),
            vehicle.model,
            self.around,
        )


def _inputs(
    what: Dataset, flight: Trajectory, moved: Sequence[Perturbation], step: float, columns: int
) -> tuple[Array, Array]:
    """How duct angle (samples, columns) and first state (5, columns) of a run move with each
    parameter."""
    turned, started = np.zeros((flight.duct_rad.size, columns)), np.zeros((STATES, columns))
    run = what.run
    for each in moved:
        if each.part == "tailcone":
            duct = greybox.duct_along(run, run.plane, each.vehicle.actuators[run.plane])
            turned[:, each.column] = (duct - flight.duct_rad) / step
        if each.speeds_mps:
            first = greybox.first_state(run, what.start, each.speeds_mps[float(run.thrust[0])])
            started[:, each.column] = (first - flight.first) / step
    return turned, started


@kernel
def _propagate(
    by_state: Array,
    by_duct: Array,
    by_parameter: Array,
    turned: Array,
    started: Array,
    stride: int,
    h: float,
) -> Array:
    """Classical Runge-Kutta on S' = by_state S + by_duct turned + by_parameter, whose slopes are
    lines in between."""
    rows, _, columns = by_parameter.shape
    found = np.empty((rows, 5, columns))
    found[0] = started
    slope, between, total = np.empty((5, columns)), np.empty((5, columns)), np.empty((5, columns))
    for row in range(1, rows):
        a = (row - 1) * stride
        before = found[row - 1]
        total[:] = 0.0
        for stage in range(4):
            late = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            one = a + int(late * stride)
            two = a + stride - int((1.0 - late) * stride)
            for i in range(5):
                for c in range(columns):
                    between[i, c] = before[i, c] + (late * h * slope[i, c] if stage > 0 else 0.0)
            for i in range(5):
                input_ = (1.0 - late) * by_duct[row - 1, i] + late * by_duct[row, i]
                for c in range(columns):
                    slope[i, c] = (
                        (1.0 - late) * by_parameter[row - 1, i, c]
                        + late * by_parameter[row, i, c]
                        + 0.5 * input_ * (turned[one, c] + turned[two, c])
                    )
                for j in range(4):
                    gain = (1.0 - late) * by_state[row - 1, i, j] + late * by_state[row, i, j]
                    for c in range(columns):
                        slope[i, c] += gain * between[j, c]
            weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
            for i in range(5):
                for c in range(columns):
                    total[i, c] += weight * slope[i, c]
        for i in range(5):
            for c in range(columns):
                found[row, i, c] = before[i, c] + total[i, c]
    return found
