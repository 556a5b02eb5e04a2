"""The paper's own identification, to be set beside ours: rate error, linear planes, no prior, no
delay estimated.

Seven coefficients in yaw first, then eight in pitch that start from yaw's; moments of inertia are
tied to N_dr and M_de by the angular acceleration measured at the start of the steps. Motion alone
cannot give this many: the rate response of a plane has four free numbers in yaw and five in pitch.
The fit is therefore one of many that explain the data equally well."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import least_squares

from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.jit import kernel
from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.models import greybox, linear_planes, parameters
from sysid.models.greybox import Actuator, PlaneTrajectory
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.reproduction.paper_tables import Table1Column

Array = NDArray[np.float64]

FREE: dict[Plane, tuple[str, ...]] = {
    "yaw": ("Y_v", "N_v", "Y_r", "N_r", "Y_dr", "N_dr", "Y_vdot"),
    "pitch": ("Z_w", "M_w", "Z_q", "M_q", "Z_de", "M_de", "Z_wdot", "z_CM"),
}
SEED = {
    "Z_w": ("Y_v", 1.0),
    "M_w": ("N_v", -1.0),
    "Z_q": ("Y_r", -1.0),
    "M_q": ("N_r", 1.0),
    "Z_de": ("Y_dr", -1.0),
    "M_de": ("N_dr", 1.0),
    "Z_wdot": ("Y_vdot", 1.0),
}
"""Pitch coefficient from its yaw twin, with the sign that half the paper's axes give it."""
FIRST_RESPONSE_S = 2.0
"""After the delay: the part of a test from which the initial angular acceleration is read."""
MIN_RESPONSE = 0.1
"""Of the prior's angular acceleration; tests that move the vehicle less hold no answer."""
RANK_TOLERANCE = 1e-3
"""Singular values below this share of the largest are no information: the coefficients then shift
without a trace."""


class PlaneFit(NamedTuple):
    coefficients: Table1Column
    acceleration_per_s2: float
    """Measured angular acceleration per radian of duct, the paper's axes (the paper: -0.51 yaw,
    -0.46 pitch)."""
    rank: int
    jacobian: Array
    """Of the rate errors by the logarithms of the free coefficients, (samples, free)."""
    cost: float


def fit(
    runs: Sequence[Run], prior: VehicleConfig, actuators: dict[Plane, Actuator]
) -> dict[Plane, PlaneFit]:
    """Yaw, then pitch started from yaw; a plane without runs is left out."""
    coefficients = parameters.to_table_1_column(prior.linear)
    fits: dict[Plane, PlaneFit] = {}
    for plane in ("yaw", "pitch"):
        chosen = [run for run in runs if run.plane == plane]
        if chosen:
            start = (
                seed_pitch_from_yaw(coefficients)
                if plane == "pitch" and "yaw" in fits
                else coefficients
            )
            fits[plane] = _fit_plane(chosen, plane, start, prior, actuators[plane])
            coefficients = fits[plane].coefficients
    return fits


def seed_pitch_from_yaw(c: Table1Column) -> Table1Column:
    """Pitch coefficients as the mirror image of yaw's."""
    return c._replace(**{name: sign * getattr(c, twin) for name, (twin, sign) in SEED.items()})


def motion(model: IdentifiedModel, actuator: Actuator, run: Run) -> PlaneTrajectory:
    """A run by the linear plane of a model that was identified the paper's way, behind a
    tailcone."""
    c = Table1Column(**{name: found.value for name, found in model.coefficients.items()})
    return simulate(_plane(run.plane, c, model.speed_mps, model.vehicle.mass_kg), actuator, run)


def departure(actuator: Actuator, run: Run) -> Array:
    """Duct angle over a run, from where the vehicle balanced before the test."""
    delta = greybox.duct_angles(run.command_rad, actuator, 1.0 / RATE_HZ)
    return delta - (np.mean(delta[run.preroll]) if run.preroll.any() else 0.0)


class DiscretePlane(NamedTuple):
    """A linear plane over one sample: x' = Phi x + Gamma delta."""

    Phi: Array
    Gamma: Array


def step(plane: LinearPlane) -> DiscretePlane:
    """The exact step under a duct angle held over it."""
    n = plane.A.shape[0]
    transition = expm(np.block([[plane.A, plane.B[:, None]], [np.zeros((1, n + 1))]]) / RATE_HZ)
    return DiscretePlane(np.ascontiguousarray(transition[:n, :n]), transition[:n, n].copy())


def states(over: DiscretePlane, delta: Array) -> Array:
    """States under duct angles, from rest, (samples, states)."""
    return _recursion(over.Phi, over.Gamma, delta)


def simulate(plane: LinearPlane, actuator: Actuator, run: Run) -> PlaneTrajectory:
    """The linear plane under a run's commands."""
    n, x, start = (
        plane.A.shape[0],
        states(step(plane), departure(actuator, run)),
        greybox.initial_motion(run),
    )
    depth = start.depth_m + (x[:, 3] if n > 3 else 0.0 * x[:, 0])
    return PlaneTrajectory(x[:, 1], start.angle_rad + x[:, 2], depth, np.full(len(x), np.nan))


@kernel
def _recursion(Phi: Array, Gamma: Array, delta: Array) -> Array:
    n = Phi.shape[0]
    x = np.zeros((delta.size, n))
    for k in range(delta.size - 1):
        for i in range(n):
            total = Gamma[i] * delta[k]
            for j in range(n):
                total += Phi[i, j] * x[k, j]
            x[k + 1, i] = total
    return x


def _plane(plane: Plane, c: Table1Column, speed_mps: float, mass_kg: float) -> LinearPlane:
    return (linear_planes.yaw_plane if plane == "yaw" else linear_planes.pitch_plane)(
        c, speed_mps, mass_kg
    )


def _fit_plane(
    runs: Sequence[Run], plane: Plane, start: Table1Column, prior: VehicleConfig, actuator: Actuator
) -> PlaneFit:
    names, about = FREE[plane], (prior.operating_point.speed_mps, prior.ballast.mass_kg)
    acceleration = first_acceleration(
        runs, _plane(plane, parameters.to_table_1_column(prior.linear), *about), actuator
    )

    def candidate(logs: Array) -> Table1Column:
        moved = {
            name: getattr(start, name) * float(np.exp(x))
            for name, x in zip(names, logs, strict=True)
        }
        return tie_inertia(start._replace(**moved), plane, acceleration)

    departures = [departure(actuator, run) for run in runs]

    def errors(logs: Array) -> Array:
        over = step(_plane(plane, candidate(logs), *about))
        simulated = [states(over, delta)[:, 1] for delta in departures]
        missed = [
            (run.rate_radps - rate)[~run.preroll] for run, rate in zip(runs, simulated, strict=True)
        ]
        return np.degrees(np.concatenate(missed))

    # The coefficients drift along what the data cannot tell; the bounds keep them on the vehicle's
    # side of zero.
    found = least_squares(
        errors, np.zeros(len(names)), bounds=(-1.5, 1.5), x_scale=0.1, max_nfev=40
    )
    singular = np.linalg.svd(found.jac, compute_uv=False)
    rank = int(np.count_nonzero(singular > RANK_TOLERANCE * singular[0]))
    return PlaneFit(candidate(found.x), acceleration, rank, found.jac, float(found.cost))


def tie_inertia(c: Table1Column, plane: Plane, acceleration_per_s2: float) -> Table1Column:
    """Inertia such that a step of the duct gives the measured angular acceleration."""
    if plane == "yaw":
        return c._replace(I_zz=c.N_dr / acceleration_per_s2 + c.N_rdot)
    return c._replace(I_yy=c.M_de / acceleration_per_s2 + c.M_qdot)


def first_acceleration(runs: Sequence[Run], plane: LinearPlane, actuator: Actuator) -> float:
    """Angular acceleration per radian of duct at the start of the tests, the paper's axes
    (negative).

    The prior plane's own, scaled by how much faster than that plane the vehicle began to turn.
    """
    over = step(plane)
    expected, measured = [], []
    for run in runs:
        first = int(np.searchsorted(run.time_s, 0.0))
        answer = slice(first, first + int((actuator.delay_s + FIRST_RESPONSE_S) * RATE_HZ))
        delta = greybox.duct_angles(run.command_rad, actuator, 1.0 / RATE_HZ)
        expected.append(states(over, delta - delta[first])[answer, 1])
        measured.append(
            run.rate_radps[answer] - np.mean(run.rate_radps[max(0, first - 25) : first + 1])
        )
    x, y = np.concatenate(expected), np.concatenate(measured)
    scale = float(x @ y) / max(float(x @ x), 1e-12)
    return -float(plane.B[1]) * max(scale, MIN_RESPONSE)
