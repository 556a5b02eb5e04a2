"""Correction of a model's response at crossover by held-out runs: change of gain and phase.

The held-out runs are fitted alone, from the model as the start and prior mean, with the covariance
of the prior before any test. The change of gain and phase at crossover is the error of the model as
far as unseen data determine it; its standard deviation shows how few runs there are.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import Run
from sysid.estimation.map import problem as problems
from sysid.estimation.map.datasets import datasets_of, max_leads_s
from sysid.estimation.map.fit import last_problem
from sysid.estimation.map.gauss_newton import descend
from sysid.estimation.map.problem import MapProblem, Prior
from sysid.models import delta_method, noise, parameters, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane
from sysid.validation import crossover
from sysid.validation.results import Correction

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

TOLERANCE = 1e-3
"""Predicted relative decrease of the cost that ends the fit."""


def corrections(
    model: IdentifiedModel,
    held_out: Sequence[Run],
    crossovers_radps: Mapping[Plane, float],
    prior: VehicleConfig | None = None,
) -> dict[Plane, Correction]:
    """Return the corrections of the planes with a crossover, held-out runs and a noise model.

    Parameters
    ----------
    model : IdentifiedModel
        Model to be tested.
    held_out : sequence of Run
        Runs that were not fitted.
    crossovers_radps : mapping of plane to float
        Crossover frequency of each plane, rad/s.
    prior : VehicleConfig, optional
        Prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    dict
        Correction of each plane.
    """
    runs_of_planes = {
        plane: [run for run in held_out if run.plane == plane] for plane in crossovers_radps
    }
    usable = {
        plane: runs for plane, runs in runs_of_planes.items() if runs and plane in model.noise
    }
    if not usable:
        return {}
    vague_prior = _original_prior(model, prior)
    problem = _problem(model, vague_prior, usable)
    optimum = descend(problem, vague_prior.mean, TOLERANCE)
    covariance = np.linalg.inv(optimum.score.information + np.linalg.inv(vague_prior.covariance))
    return _corrections(
        vague_prior, optimum.z, covariance, {plane: crossovers_radps[plane] for plane in usable}
    )


def _original_prior(model: IdentifiedModel, prior: VehicleConfig | None) -> Prior:
    """Return the prior with the model's estimate as the mean and the covariance before any test."""
    estimates = dict(zip(model.joint.names, model.joint.z, strict=True))
    return Prior(
        config=prediction.prior_vehicle(model, prior),
        biases_rad=model.vehicle.prior_biases_rad,
        mean=np.array([estimates.get(name, 0.0) for name in parameters.NAMES]),
        covariance=parameters.prior_covariance(),
    )


def _problem(
    model: IdentifiedModel, vague_prior: Prior, runs_of_planes: Mapping[Plane, Sequence[Run]]
) -> MapProblem:
    """Fit problem of the held-out runs with the model's noise levels."""
    vehicle = problems.vehicle(vague_prior, vague_prior.mean)
    runs = [run for group in runs_of_planes.values() for run in group]
    datasets = datasets_of(runs, vehicle, max_leads_s(runs, vehicle))
    levels = {plane: noise.from_model(model.noise[plane]) for plane in runs_of_planes}
    return last_problem(vague_prior, datasets, levels, vague_prior.mean)


def _corrections(
    vague_prior: Prior, z: Array, covariance: Array, frequencies_radps: Mapping[Plane, float]
) -> dict[Plane, Correction]:
    """Change of gain (dB) and phase (deg) of planes between the model and z, with sds."""

    def responses(perturbed_z: Array) -> ComplexArray:
        """Return the response of each plane at its frequency."""
        vehicle = problems.vehicle(vague_prior, perturbed_z)
        return np.concatenate(
            [
                crossover.response(vehicle, plane, np.array([frequency_radps]))
                for plane, frequency_radps in frequencies_radps.items()
            ]
        )

    nominal = responses(vague_prior.mean)

    def changes(perturbed_z: Array) -> Array:
        """Return the changes of gain (dB) of all planes, then those of phase (deg)."""
        ratios = responses(perturbed_z) / nominal
        return np.concatenate([20.0 * np.log10(np.abs(ratios)), np.degrees(np.angle(ratios))])

    sds = delta_method.propagate_sd(delta_method.slopes(changes, z), covariance)
    rows = zip(*np.split(changes(z), 2), *np.split(sds, 2), strict=True)
    return {
        plane: Correction(
            gain_db=float(gain_db),
            gain_sd_db=float(gain_sd_db),
            phase_deg=float(phase_deg),
            phase_sd_deg=float(phase_sd_deg),
        )
        for plane, (gain_db, phase_deg, gain_sd_db, phase_sd_deg) in zip(
            frequencies_radps, rows, strict=True
        )
    }
