"""What runs that were not fitted would change about a model's response at crossover: its gain and
its phase.

The held-out runs are fitted by themselves, from the model and with as vague a belief about it as
there was before any test. Where they lead away from the model, the model is wrong, as far as unseen
data can tell: the change of gain and phase at crossover, with the doubt that so few runs leave."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.segments import Plane, Run
from sysid.estimation.map import fit
from sysid.estimation.map import problem as problems
from sysid.estimation.map.datasets import with_coupling_inputs
from sysid.estimation.map.fit import STRIDE, Prior
from sysid.estimation.map.gauss_newton import descend
from sysid.estimation.map.problem import MapProblem
from sysid.models import noise, parameters
from sysid.models.model_file import IdentifiedModel
from sysid.validation import crossover
from sysid.validation.results import Correction

Array = NDArray[np.float64]

TOLERANCE = 1e-3
"""Share of the cost that a step of the fit must promise."""


def corrections(
    model: IdentifiedModel,
    held_out: Sequence[Run],
    crossovers_radps: Mapping[Plane, float],
    prior: VehicleConfig | None = None,
) -> dict[Plane, Correction]:
    """Of the response from command to rate in each plane that has a crossover, held-out runs and a
    noise model."""
    groups = {plane: [run for run in held_out if run.plane == plane] for plane in crossovers_radps}
    told = {plane: group for plane, group in groups.items() if group and plane in model.noise}
    if not told:
        return {}
    belief = _original_prior(model, prior)
    problem = _problem(model, belief, told)
    end = descend(problem, belief.mean, TOLERANCE)
    covariance = np.linalg.inv(end.score.information + np.linalg.inv(belief.covariance))
    return {
        plane: _correction(belief, plane, end.z, covariance, crossovers_radps[plane])
        for plane in told
    }


def _original_prior(model: IdentifiedModel, prior: VehicleConfig | None) -> Prior:
    known = dict(zip(model.joint.names, model.joint.z, strict=True))
    return Prior(
        prior or vehicle_files.load(model.vehicle.prior),
        {plane: math.radians(bias) for plane, bias in model.vehicle.prior_biases_deg.items()},
        np.array([known.get(name, 0.0) for name in parameters.NAMES]),
        parameters.prior_covariance(),
    )


def _problem(
    model: IdentifiedModel, belief: Prior, told: Mapping[Plane, Sequence[Run]]
) -> MapProblem:
    at = problems.vehicle(belief, belief.mean)
    experiments = {
        plane: tuple(with_coupling_inputs(at, fit.dataset(run)) for run in runs)
        for plane, runs in told.items()
    }
    levels = {plane: noise.from_model(model.noise[plane]) for plane in told}
    return MapProblem(
        belief, experiments, problems.filters(at, experiments, levels, STRIDE), levels, STRIDE
    )


def _correction(
    belief: Prior, plane: Plane, z: Array, covariance: Array, at_radps: float
) -> Correction:
    nominal = crossover.response(problems.vehicle(belief, belief.mean), plane)

    def change(moved: Array) -> Array:
        """Of gain and phase, dB and degrees."""
        ratio = crossover.response(problems.vehicle(belief, moved), plane) / nominal
        gain_db = np.interp(at_radps, GRID_RADPS, 20.0 * np.log10(np.abs(ratio)))
        return np.array(
            [gain_db, np.degrees(np.interp(at_radps, GRID_RADPS, np.unwrap(np.angle(ratio))))]
        )

    (gain_db, phase_deg), (gain_sd_db, phase_sd_deg) = (
        change(z),
        crossover.propagate_sd(change, z, covariance),
    )
    return Correction(float(gain_db), float(gain_sd_db), float(phase_deg), float(phase_sd_deg))
