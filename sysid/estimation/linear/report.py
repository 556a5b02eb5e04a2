"""From planes to ``model.json``: the planes as they were found, and the physical vehicle that is
nearest to the prior.

Motion in a plane fixes fewer numbers than a vehicle has coefficients. The report moves the prior's
as little as can be (in its own standard deviations) for its small-signal planes to be the
identified ones."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from sysid.data.segments import Plane, Run
from sysid.estimation.linear import estimate as estimates
from sysid.estimation.linear import intervals, records
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.estimate import Method, PlaneEstimate
from sysid.estimation.map.fit import Fit, Prior, Progress
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

Array = NDArray[np.float64]

HELD_SD_SHARE = 0.01
"""Of the planes' standard deviations: how nearly the nearest vehicle must have them."""
STEPS = 20
STEP_Z = 1e-3
"""Of the slopes of a plane's values by z."""
MISFIT_SD = 1.0
"""A plane that no vehicle near the prior has is missed by this much or more, in its standard
deviations."""


def identify(
    runs: Sequence[Run],
    prior: Prior,
    prior_name: str,
    method: Method,
    progress: Progress | None = None,
) -> IdentifiedModel:
    """Each plane that has runs, by itself.

    Raises:
        NotUniqueError: the runs do not name one plant.
        ValueError: there is no run.
    """
    report = progress or (lambda what, share: None)
    planes = [plane for plane in model_export.PLANES if any(run.plane == plane for run in runs)]
    if not planes:
        raise ValueError(
            "no run is left to fit; record rudder or elevator tests, or relax the screening"
        )
    found: dict[Plane, PlaneEstimate] = {}
    for number, plane in enumerate(planes):
        report(f"fit, {plane}", number / len(planes))
        chosen = [
            records.linear_run(run, estimates.LEADS_S[method]) for run in runs if run.plane == plane
        ]
        found[plane] = estimates.estimate(chosen, records.linear_prior(prior, plane), method)
    report("fit", 1.0)
    return of_estimates(found, prior, prior_name, method)


def of_estimates(
    found: dict[Plane, PlaneEstimate], prior: Prior, prior_name: str, method: Method
) -> IdentifiedModel:
    """The model of planes found by ``method``; a plane that was not tested is the prior's, moved by
    what they share."""
    nearest = _nearest(found, prior)
    model = model_export.from_fit(nearest, prior, prior_name)
    told = {plane: _reported_numbers(plane, estimate, nearest) for plane, estimate in found.items()}
    return msgspec.structs.replace(
        model,
        method=method,
        planes={**model.planes, **{plane: _plane(plane, *told[plane]) for plane in found}},
        design={**model.design, **{plane: _covariance(plane, told[plane][1]) for plane in found}},
        coefficients={name: _status(c, name, set(found)) for name, c in model.coefficients.items()},
        notes=(*model.notes, *_misfit_notes(found, prior, nearest.z), *_wide_interval_notes(found)),
    )


def _nearest(found: dict[Plane, PlaneEstimate], prior: Prior) -> Fit:
    """The vehicle nearest to the prior whose planes are the estimates, by Gauss-Newton."""
    certain, z = np.linalg.inv(prior.covariance), prior.mean.copy()
    held = block_diag(
        *(_plane_weights(plane, estimate.covariance) for plane, estimate in found.items())
    )
    for _ in range(STEPS):
        slopes, errors = _linearise(found, prior, z)
        information = slopes.T @ held @ slopes
        gradient = slopes.T @ held @ errors - certain @ (z - prior.mean)
        step = np.linalg.solve(information + certain, gradient)
        z = z + step / max(1.0, float(np.max(np.abs(step))))
        if np.max(np.abs(step)) < 1e-6:
            break
    slopes, _ = _linearise(found, prior, z)
    told = block_diag(*(np.linalg.inv(estimate.covariance) for estimate in found.values()))
    information = slopes.T @ told @ slopes
    return Fit(
        z=z,
        covariance=np.linalg.inv(information + certain),
        data_information=information,
        vehicle=parameters.candidate_vehicle(prior.config, prior.biases_rad, z),
        noise={plane: estimate.level for plane, estimate in found.items() if estimate.level},
        experiments=dict.fromkeys(found, ()),
        cost=sum(estimate.cost for estimate in found.values()),
        start_costs=_start_costs(found),
        at_bounds=(),
        evaluations=sum(estimate.evaluations for estimate in found.values()),
    )


def _start_costs(found: dict[Plane, PlaneEstimate]) -> tuple[float, ...]:
    """Of the planes together, start by start."""
    return tuple(
        float(sum(costs)) for costs in zip(*(e.start_costs for e in found.values()), strict=True)
    )


def _plane_weights(plane: Plane, covariance: Array) -> Array:
    """Weights that hold a plane's values, but for the lag: both planes have found one, and the
    vehicle has one."""
    rows = np.ones(len(covariance), dtype=np.bool_)
    rows[plants.lag(plane)] = False
    weights = np.zeros_like(covariance)
    weights[np.ix_(rows, rows)] = np.linalg.inv(covariance[np.ix_(rows, rows)]) / HELD_SD_SHARE**2
    weights[np.ix_(~rows, ~rows)] = np.linalg.inv(covariance[np.ix_(~rows, ~rows)])
    return weights


def _linearise(found: dict[Plane, PlaneEstimate], prior: Prior, z: Array) -> tuple[Array, Array]:
    """(slopes of all planes' values by z, what they miss of the estimates)."""
    slopes, errors = [], []
    for plane, estimate in found.items():
        here = records.values_at(prior, z, plane).values
        slope = np.zeros((here.size, len(NAMES)))
        for i in parameters.parameters_of_planes([plane]):
            away = z.copy()
            away[i] += STEP_Z
            slope[:, i] = (records.values_at(prior, away, plane).values - here) / STEP_Z
        slopes.append(slope)
        errors.append(estimate.plant.values - here)
    return np.vstack(slopes), np.concatenate(errors)


def _reported_numbers(plane: Plane, estimate: PlaneEstimate, nearest: Fit) -> tuple[Array, Array]:
    """Derived numbers and their covariance in a model file's units: the bias as the duct's own
    angle, in degrees."""
    frame, values = estimate.plant
    numbers = plants.derived(frame, values)
    covariance = plants.propagate(frame, values, estimate.covariance)
    if plane == "pitch":
        numbers[-1] = nearest.vehicle.actuators["pitch"].bias_rad
    degrees = np.ones(numbers.size)
    degrees[-1] = math.degrees(1.0)
    return numbers * degrees, covariance * np.outer(degrees, degrees)


def _names(plane: Plane) -> tuple[str, ...]:
    return (*plants.derived_names(plane)[:-1], "actuator_bias_deg")


def _plane(plane: Plane, numbers: Array, covariance: Array) -> PlaneModel:
    sds = np.sqrt(np.diag(covariance))
    told = {
        name: Reported(float(v), float(sd))
        for name, v, sd in zip(_names(plane), numbers, sds, strict=True)
    }
    return PlaneModel(restoring_per_s2=told.pop("restoring_per_s2", None), **told)


def _covariance(plane: Plane, covariance: Array) -> ParameterCovariance:
    return ParameterCovariance(_names(plane), tuple(tuple(row) for row in covariance.tolist()))


def _status(c: Coefficient, name: str, tested: set[Plane]) -> Coefficient:
    """What a tested plane's motion moved, but cannot tell from others, is unidentifiable."""
    moved = name in NAMES and bool(set(parameters.PARAMETERS[NAMES.index(name)].planes) & tested)
    if moved and c.shrink is not None and c.shrink > MAX_POSTERIOR_TO_PRIOR_SD:
        return msgspec.structs.replace(c, status="unidentifiable")
    return c


def _misfit_notes(found: dict[Plane, PlaneEstimate], prior: Prior, z: Array) -> list[str]:
    """Values of an estimate that no vehicle of the prior's shape has."""
    notes = []
    for plane, estimate in found.items():
        away = records.values_at(prior, z, plane).values - estimate.plant.values
        sds = np.sqrt(np.diag(estimate.covariance))
        worst = int(np.argmax(np.abs(away / sds)))
        if abs(away[worst]) > MISFIT_SD * sds[worst]:
            name = plants.names(plane)[worst]
            notes.append(
                f"{plane}: the coefficients miss the plane's {name} by"
                f" {abs(away[worst] / sds[worst]):.1f} sd"
            )
    return notes


def _wide_interval_notes(found: dict[Plane, PlaneEstimate]) -> list[str]:
    """Where one standard deviation says too little."""
    return [
        f"{plane}: {name} lies in {low:.3g} to {high:.3g} (95 %, profile likelihood)"
        for plane, estimate in found.items()
        for name, low, high in intervals.wide_intervals(estimate)
    ]
