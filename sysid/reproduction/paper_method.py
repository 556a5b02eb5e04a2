"""The paper's identification method, for comparison with the MAP estimate.

It minimises rate errors of linear planes, without a prior and with a fixed delay: seven
coefficients in yaw, then eight in pitch that start from those of yaw. Moments of inertia are tied
to N_dr and M_de by the angular acceleration measured at the start of the steps. The coefficients
are not unique: the rate response of a plane has four free parameters in yaw and five in pitch.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import least_squares

from mavlink_io.jit import kernel
from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import RATE_HZ, Run
from sysid.models import greybox, linear_planes, parameters
from sysid.models.greybox import Actuator, PlaneTrajectory
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane
from sysid.reproduction.paper_tables import Table1Column

Array = NDArray[np.float64]

FREE: dict[Plane, tuple[str, ...]] = {
    Plane.YAW: ("Y_v", "N_v", "Y_r", "N_r", "Y_dr", "N_dr", "Y_vdot"),
    Plane.PITCH: ("Z_w", "M_w", "Z_q", "M_q", "Z_de", "M_de", "Z_wdot", "z_CM"),
}
"""Free coefficients of each plane."""
INERTIA = {Plane.YAW: ("I_zz", "N_dr", "N_rdot"), Plane.PITCH: ("I_yy", "M_de", "M_qdot")}
"""Inertia of each plane, moment of its surface and added inertia."""
SEED = {
    "Z_w": ("Y_v", 1.0),
    "M_w": ("N_v", -1.0),
    "Z_q": ("Y_r", -1.0),
    "M_q": ("N_r", 1.0),
    "Z_de": ("Y_dr", -1.0),
    "M_de": ("N_dr", 1.0),
    "Z_wdot": ("Y_vdot", 1.0),
}
"""Yaw coefficient from which each pitch coefficient starts, with the sign of the axes."""
FIRST_RESPONSE_S = 2.0
"""Time (s) after the delay over which the initial angular acceleration is measured."""
MIN_RESPONSE = 0.1
"""Smallest measured angular acceleration, as a share of the prior's."""
RANK_TOLERANCE = 1e-3
"""Singular values below this share of the largest count as zero."""

MIN_IMPROVEMENT = 1e-6
"""Relative decrease of the mean squared error from which a step counts as an improvement."""


class PlaneFit(NamedTuple):
    """Result of one plane."""

    coefficients: Table1Column
    acceleration_per_s2: float
    """Measured angular acceleration per radian of duct in the paper's axes (1/s^2).

    The paper gives -0.51 in yaw and -0.46 in pitch.
    """
    rank: int
    """Number of identifiable combinations of the free coefficients."""
    jacobian: Array
    """Derivatives of the rate errors by the logarithms of the coefficients, (samples, free)."""
    cost: float
    """Half the sum of squared rate errors, (deg/s)^2."""
    history_deg2ps2: tuple[float, ...]
    """Mean squared rate error of all runs at the start and after each improving step."""


def fit(
    runs: Sequence[Run], prior: VehicleConfig, actuators: dict[Plane, Actuator]
) -> dict[Plane, PlaneFit]:
    """Fit yaw, then pitch started from yaw; a plane without runs is omitted.

    Parameters
    ----------
    runs : Sequence of Run
        Test runs.
    prior : VehicleConfig
        Vehicle file: initial coefficients, speed and mass.
    actuators : dict
        Tailcone of each plane.

    Returns
    -------
    dict
        Result of each plane.
    """
    start = parameters.to_table_1_column(prior.linear)
    fits: dict[Plane, PlaneFit] = {}
    for plane in Plane:
        plane_runs = [run for run in runs if run.plane == plane]
        if plane_runs:
            fits[plane] = _fit_plane(plane_runs, plane, start, prior, actuators[plane])
            start = seed_pitch_from_yaw(fits[plane].coefficients)
    return fits


def seed_pitch_from_yaw(c: Table1Column) -> Table1Column:
    """Return pitch coefficients that mirror those of yaw."""
    return c._replace(**{name: sign * getattr(c, twin) for name, (twin, sign) in SEED.items()})


def motion(model: IdentifiedModel, actuator: Actuator, run: Run) -> PlaneTrajectory:
    """Simulate a run with the linear plane of a model that was identified by the paper's method."""
    coefficients = Table1Column(
        **{name: coefficient.value for name, coefficient in model.coefficients.items()}
    )
    return simulate(
        _plane(run.plane, coefficients, model.speed_mps, model.vehicle.mass_kg), actuator, run
    )


def departure(actuator: Actuator, run: Run) -> Array:
    """Return the duct angle over a run (rad), relative to its mean before the test."""
    delta = greybox.duct_angles(run.command_rad, actuator, 1.0 / RATE_HZ)
    return delta - (np.mean(delta[run.preroll]) if run.preroll.any() else 0.0)


class DiscretePlane(NamedTuple):
    """Linear plane over one sample: x[k+1] = Phi x[k] + Gamma delta[k]."""

    Phi: Array
    Gamma: Array


def step(plane: LinearPlane) -> DiscretePlane:
    """Return the exact discretisation for a duct angle that is constant over a sample."""
    n = plane.A.shape[0]
    block = expm(np.block([[plane.A, plane.B[:, None]], [np.zeros((1, n + 1))]]) / RATE_HZ)
    return DiscretePlane(np.ascontiguousarray(block[:n, :n]), block[:n, n].copy())


def states(over: DiscretePlane, delta: Array) -> Array:
    """Return the states under duct angles, from rest, (samples, states)."""
    return _recursion(over.Phi, over.Gamma, delta)


def simulate(plane: LinearPlane, actuator: Actuator, run: Run) -> PlaneTrajectory:
    """Simulate the linear plane under a run's commands."""
    n = plane.A.shape[0]
    states_over_run = states(step(plane), departure(actuator, run))
    start = greybox.initial_motion(run)
    depth = start.depth_m + (states_over_run[:, 3] if n > 3 else 0.0 * states_over_run[:, 0])
    return PlaneTrajectory(
        rate_radps=states_over_run[:, 1],
        angle_rad=start.angle_rad + states_over_run[:, 2],
        depth_m=depth,
        speed_mps=np.full(len(states_over_run), np.nan),
    )


@kernel
def _recursion(Phi: Array, Gamma: Array, delta: Array) -> Array:
    """Run x[k+1] = Phi x[k] + Gamma delta[k] from rest."""
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
    """Return the linear plane of a column of Table 1."""
    return linear_planes.linear_plane(plane, c, speed_mps, mass_kg)


def _fit_plane(
    runs: Sequence[Run], plane: Plane, start: Table1Column, prior: VehicleConfig, actuator: Actuator
) -> PlaneFit:
    """Fit the free coefficients of one plane.

    Minimises the sum of squared rate errors over the logarithms of the free coefficients.
    """
    names, speed_and_mass = FREE[plane], (prior.operating_point.speed_mps, prior.ballast.mass_kg)
    acceleration = first_acceleration(
        runs, _plane(plane, parameters.to_table_1_column(prior.linear), *speed_and_mass), actuator
    )

    def candidate(logs: Array) -> Table1Column:
        """Return the coefficients scaled by exp(logs), with tied inertia."""
        scaled = {
            name: getattr(start, name) * float(np.exp(x))
            for name, x in zip(names, logs, strict=True)
        }
        return tie_inertia(start._replace(**scaled), plane, acceleration)

    departures = [departure(actuator, run) for run in runs]

    history: list[float] = []

    def errors(logs: Array) -> Array:
        """Return the rate errors of all runs (deg/s); extend the history if they are smaller."""
        discrete = step(_plane(plane, candidate(logs), *speed_and_mass))
        simulated = [states(discrete, delta)[:, 1] for delta in departures]
        rate_errors = [
            (run.rate_radps - rate)[~run.preroll] for run, rate in zip(runs, simulated, strict=True)
        ]
        errors_degps = np.degrees(np.concatenate(rate_errors))
        mean = float(np.mean(np.square(errors_degps)))
        # the steps of the finite differences improve the error by less
        if not history or mean < history[-1] * (1.0 - MIN_IMPROVEMENT):
            history.append(mean)
        return errors_degps

    # Coefficients drift along unidentifiable directions; in logarithms they keep their sign, and
    # the bounds limit the drift.
    optimum = least_squares(
        errors, np.zeros(len(names)), bounds=(-1.5, 1.5), x_scale=0.1, max_nfev=40
    )
    singular_values = np.linalg.svd(optimum.jac, compute_uv=False)
    rank = int(np.count_nonzero(singular_values > RANK_TOLERANCE * singular_values[0]))
    return PlaneFit(
        coefficients=candidate(optimum.x),
        acceleration_per_s2=acceleration,
        rank=rank,
        jacobian=optimum.jac,
        cost=float(optimum.cost),
        history_deg2ps2=tuple(history),
    )


def tie_inertia(c: Table1Column, plane: Plane, acceleration_per_s2: float) -> Table1Column:
    """Return the coefficients with the inertia that gives the measured angular acceleration.

    I_zz = N_dr / a + N_rdot in yaw, I_yy = M_de / a + M_qdot in pitch.
    """
    inertia, moment, added = INERTIA[plane]
    return c._replace(**{inertia: getattr(c, moment) / acceleration_per_s2 + getattr(c, added)})


def first_acceleration(runs: Sequence[Run], plane: LinearPlane, actuator: Actuator) -> float:
    """Return the angular acceleration per radian of duct at the start of the tests (1/s^2).

    The value is in the paper's axes (negative): that of the prior plane, scaled by the least-
    squares ratio of measured to simulated rate.
    """
    discrete = step(plane)
    expected, measured = [], []
    for run in runs:
        start = int(np.searchsorted(run.time_s, 0.0))
        response = slice(start, start + int((actuator.delay_s + FIRST_RESPONSE_S) * RATE_HZ))
        delta = greybox.duct_angles(run.command_rad, actuator, 1.0 / RATE_HZ)
        expected.append(states(discrete, delta - delta[start])[response, 1])
        measured.append(
            run.rate_radps[response] - np.mean(run.rate_radps[max(0, start - 25) : start + 1])
        )
    x, y = np.concatenate(expected), np.concatenate(measured)
    scale = float(x @ y) / max(float(x @ x), 1e-12)
    return -float(plane.B[1]) * max(scale, MIN_RESPONSE)
