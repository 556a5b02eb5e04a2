"""Model file from linear estimates: the planes as estimated, and the nearest physical vehicle.

The motion of a plane determines fewer numbers than a vehicle has coefficients. The vehicle is the
one nearest to the prior, in prior standard deviations, whose small-signal planes are the estimated
ones. With theta(z) the planes' values at z, theta_e the estimates, W their weights, m and P the
prior::

    min_z { (theta(z) - theta_e)' W (theta(z) - theta_e) + (z - m)' P^-1 (z - m) }

by Gauss-Newton steps.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from sysid.data.runs import Run
from sysid.estimation import profile_likelihood
from sysid.estimation.linear import estimate as estimates
from sysid.estimation.linear import linear_model, records
from sysid.estimation.linear.estimate import Method, PlaneEstimate
from sysid.estimation.linear.linear_model import LinearModelStructure
from sysid.estimation.linear.multistart import DELAY
from sysid.estimation.map.fit import Fit, Progress
from sysid.estimation.map.intervals import WIDE_RELATIVE_SD, ParameterInterval
from sysid.estimation.map.problem import Prior
from sysid.estimation.profile_likelihood import LeastSquaresEstimate
from sysid.models import model_export, parameters
from sysid.models.model_file import (
    MAX_POSTERIOR_TO_PRIOR_SD,
    Coefficient,
    IdentifiedModel,
    ParameterCovariance,
    PlaneModel,
)
from sysid.models.model_file import ParameterEstimate as Reported
from sysid.models.parameters import NAMES
from sysid.planes import Plane

Array = NDArray[np.float64]

HELD_SD_SHARE = 0.01
"""Standard deviation with which the vehicle must match the planes, over that of the estimates."""
STEPS = 20
"""Maximum number of Gauss-Newton steps."""
STEP_Z = 1e-3
"""Difference step of a plane's values by z, in prior standard deviations."""
MISFIT_SD = 1.0
"""Distance of the vehicle from an estimate, in the estimate's sd, from which on it is reported."""


def identify(
    runs: Sequence[Run],
    prior: Prior,
    prior_name: str,
    method: Method,
    progress: Progress | None = None,
) -> IdentifiedModel:
    """Estimate each plane that has runs, and build the model.

    Parameters
    ----------
    runs : sequence of Run
        Runs of one or both planes.
    prior : Prior
        Prior of the physical parameters.
    prior_name : str
        Name of the prior in the model file.
    method : {'output-error', 'filter-error'}
        Estimation method.
    progress : callable, optional
        Called with the present step and the completed share, 0 to 1.

    Returns
    -------
    IdentifiedModel
        Model of this method.

    Raises
    ------
    NotUniqueError
        The runs leave a combination of values undetermined.
    ValueError
        There is no run.
    """
    report = progress or (lambda what, share: None)
    planes = [plane for plane in Plane if any(run.plane == plane for run in runs)]
    if not planes:
        raise ValueError("no run is left to fit; record rudder or elevator tests")
    plane_estimates: dict[Plane, PlaneEstimate] = {}
    for index, plane in enumerate(planes):
        report(f"fit, {plane}", index / len(planes))
        plane_runs = [
            records.linear_run(run, estimates.LEADS_S[method]) for run in runs if run.plane == plane
        ]
        plane_estimates[plane] = estimates.estimate(
            plane_runs, records.linear_prior(prior, plane), method
        )
    report("fit", 1.0)
    return of_estimates(plane_estimates, prior, prior_name, method)


def of_estimates(
    plane_estimates: dict[Plane, PlaneEstimate], prior: Prior, prior_name: str, method: Method
) -> IdentifiedModel:
    """Build the model from the estimates.

    A plane without runs is the prior's, changed by shared parameters.
    """
    nearest = _nearest(plane_estimates, prior)
    model = model_export.from_fit(nearest, prior, prior_name)
    reported = {
        plane: _reported_numbers(plane, estimate, nearest)
        for plane, estimate in plane_estimates.items()
    }
    return msgspec.structs.replace(
        model,
        method=method,
        convergence=msgspec.structs.replace(
            model.convergence,
            failures=(
                *model.convergence.failures,
                *(f for estimate in plane_estimates.values() for f in estimate.failures),
            ),
        ),
        planes={
            **model.planes,
            **{plane: _plane(plane, *reported[plane]) for plane in plane_estimates},
        },
        design={
            **model.design,
            **{plane: _covariance(plane, reported[plane][1]) for plane in plane_estimates},
        },
        coefficients={
            name: _status(c, name, set(plane_estimates)) for name, c in model.coefficients.items()
        },
        notes=(
            *model.notes,
            *_zero_delay_notes(plane_estimates),
            *_misfit_notes(plane_estimates, prior, nearest.z),
            *(
                str(interval)
                for plane, estimate in plane_estimates.items()
                for interval in _wide_intervals(plane, estimate)
            ),
        ),
    )


def _nearest(plane_estimates: dict[Plane, PlaneEstimate], prior: Prior) -> Fit:
    """Return the vehicle nearest to the prior whose planes are the estimates, by Gauss-Newton."""
    prior_information, z = np.linalg.inv(prior.covariance), prior.mean.copy()
    weights = block_diag(
        *(_plane_weights(plane, estimate.covariance) for plane, estimate in plane_estimates.items())
    )
    for _ in range(STEPS):
        slopes, errors = _linearise(plane_estimates, prior, z)
        information = slopes.T @ weights @ slopes
        gradient = slopes.T @ weights @ errors - prior_information @ (z - prior.mean)
        step = np.linalg.solve(information + prior_information, gradient)
        z = z + step / max(1.0, float(np.max(np.abs(step))))
        if np.max(np.abs(step)) < 1e-6:
            break
    slopes, _ = _linearise(plane_estimates, prior, z)
    plane_information = block_diag(
        *(np.linalg.inv(estimate.covariance) for estimate in plane_estimates.values())
    )
    information = slopes.T @ plane_information @ slopes
    return Fit(
        z=z,
        covariance=np.linalg.inv(information + prior_information),
        data_information=information,
        vehicle=parameters.candidate_vehicle(prior.config, prior.biases_rad, z),
        noise={
            plane: estimate.level for plane, estimate in plane_estimates.items() if estimate.level
        },
        datasets=dict.fromkeys(plane_estimates, ()),
        cost=sum(estimate.cost for estimate in plane_estimates.values()),
        start_costs=_start_costs(plane_estimates),
        at_bounds=(),
        evaluations=sum(estimate.evaluations for estimate in plane_estimates.values()),
    )


def _start_costs(plane_estimates: dict[Plane, PlaneEstimate]) -> tuple[float, ...]:
    """Sum of the planes' costs, start by start."""
    return tuple(
        float(sum(costs))
        for costs in zip(
            *(plane_estimate.start_costs for plane_estimate in plane_estimates.values()),
            strict=True,
        )
    )


def _plane_weights(plane: Plane, covariance: Array) -> Array:
    """Return the weights that hold a plane's values.

    The lag keeps its own weight: both planes estimate the same lag.
    """
    is_held = np.ones(len(covariance), dtype=np.bool_)
    is_held[linear_model.lag(plane)] = False
    weights = np.zeros_like(covariance)
    weights[np.ix_(is_held, is_held)] = (
        np.linalg.inv(covariance[np.ix_(is_held, is_held)]) / HELD_SD_SHARE**2
    )
    weights[np.ix_(~is_held, ~is_held)] = np.linalg.inv(covariance[np.ix_(~is_held, ~is_held)])
    return weights


def _linearise(
    plane_estimates: dict[Plane, PlaneEstimate], prior: Prior, z: Array
) -> tuple[Array, Array]:
    """Return the derivatives of all planes' values by z, and estimates minus values."""
    slopes, errors = [], []
    for plane, estimate in plane_estimates.items():
        plane_values = records.values_at(prior, z, plane).values
        slope = np.zeros((plane_values.size, len(NAMES)))
        for i in parameters.parameters_of_planes([plane]):
            perturbed_z = z.copy()
            perturbed_z[i] += STEP_Z
            slope[:, i] = (
                records.values_at(prior, perturbed_z, plane).values - plane_values
            ) / STEP_Z
        slopes.append(slope)
        errors.append(estimate.model.values - plane_values)
    return np.vstack(slopes), np.concatenate(errors)


def _reported_numbers(plane: Plane, estimate: PlaneEstimate, nearest: Fit) -> tuple[Array, Array]:
    """Return the derived numbers and covariance in the units of a model file.

    The bias is the duct angle in degrees.
    """
    frame, values = estimate.model
    numbers = linear_model.derived(frame, values)
    covariance = linear_model.propagate(frame, values, estimate.covariance)
    if linear_model.OFFSETS[plane]:
        numbers[-1] = nearest.vehicle.actuators[plane].bias_rad
    delay = linear_model.derived_names(plane).index(DELAY)
    if numbers[delay] == 0.0:
        covariance[delay, :] = covariance[:, delay] = 0.0
    unit_factors = np.ones(numbers.size)
    unit_factors[-1] = math.degrees(1.0)
    return numbers * unit_factors, covariance * np.outer(unit_factors, unit_factors)


def _names(plane: Plane) -> tuple[str, ...]:
    """Return the names of the reported numbers."""
    return (*linear_model.derived_names(plane)[:-1], "actuator_bias_deg")


def _plane(plane: Plane, numbers: Array, covariance: Array) -> PlaneModel:
    """Record of a plane for the model file."""
    sds = np.sqrt(np.diag(covariance))
    reported = {
        name: Reported(float(v), float(sd) if sd else None)
        for name, v, sd in zip(_names(plane), numbers, sds, strict=True)
    }
    return PlaneModel(restoring_per_s2=reported.pop("restoring_per_s2", None), **reported)


def _covariance(plane: Plane, covariance: Array) -> ParameterCovariance:
    """Record of the covariance for the model file."""
    return ParameterCovariance(_names(plane), tuple(tuple(row) for row in covariance.tolist()))


def _status(coefficient: Coefficient, name: str, tested: set[Plane]) -> Coefficient:
    """Mark coefficients as unidentifiable that a tested plane depends on but does not determine."""
    is_tested = name in NAMES and bool(
        set(parameters.PARAMETERS[NAMES.index(name)].planes) & tested
    )
    if (
        is_tested
        and coefficient.posterior_to_prior_sd is not None
        and coefficient.posterior_to_prior_sd > MAX_POSTERIOR_TO_PRIOR_SD
    ):
        return msgspec.structs.replace(coefficient, status="unidentifiable")
    return coefficient


def _zero_delay_notes(plane_estimates: dict[Plane, PlaneEstimate]) -> list[str]:
    """Report delays at their limit of zero."""
    return [
        f"{plane}: {DELAY} is at its limit of zero and has no standard deviation"
        for plane, estimate in plane_estimates.items()
        if estimate.model.values[linear_model.names(plane).index(DELAY)] == 0.0
    ]


def _misfit_notes(plane_estimates: dict[Plane, PlaneEstimate], prior: Prior, z: Array) -> list[str]:
    """Report values of an estimate that no vehicle near the prior has."""
    notes = []
    for plane, estimate in plane_estimates.items():
        misfit = records.values_at(prior, z, plane).values - estimate.model.values
        sds = np.sqrt(np.diag(estimate.covariance))
        worst = int(np.argmax(np.abs(misfit / sds)))
        if abs(misfit[worst]) > MISFIT_SD * sds[worst]:
            name = linear_model.names(plane)[worst]
            notes.append(
                f"{plane}: the coefficients miss the plane's {name} by"
                f" {abs(misfit[worst] / sds[worst]):.1f} sd"
            )
    return notes


def _wide_intervals(plane: Plane, estimate: PlaneEstimate) -> Iterator[ParameterInterval]:
    """Yield the intervals of the derived numbers with a large relative sd, without the bias."""
    frame, values = estimate.model
    derived = linear_model.derived(frame, values)
    sds = np.sqrt(np.diag(linear_model.propagate(frame, values, estimate.covariance)))
    problem = LeastSquaresEstimate(*estimate.objective, estimate.lowest, estimate.highest)
    for i, name in enumerate(linear_model.derived_names(frame.plane)[:-1]):
        if name == DELAY and derived[i] == 0.0:
            continue
        if sds[i] > WIDE_RELATIVE_SD * abs(derived[i]):
            low, high = profile_likelihood.interval(
                problem, values, _derived_number(frame, i), float(sds[i])
            )
            yield ParameterInterval(plane=plane, name=name, low=low, high=high)


def _derived_number(frame: LinearModelStructure, index: int) -> Callable[[Array], float]:
    """Return a derived number as a function of the values."""
    return lambda values: float(linear_model.derived(frame, values)[index])
