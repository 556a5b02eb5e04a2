"""What a vehicle file or an earlier model tells before the first test."""

import math
from pathlib import Path

import numpy as np

from sysid.estimation.map.fit import Prior
from sysid.estimation.recursive import estimator
from sysid.estimation.recursive.estimator import Knowledge
from sysid.models import noise, parameters
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES
from sysid.refit import Belief, belief_in


def knowledge(prior: str | Path) -> Knowledge:
    """As `ground refit --prior` takes it. Raises VehicleError, ModelError, RefitError."""
    belief = belief_in(prior)
    return _of_model(belief, belief.earlier) if belief.earlier else _of_vehicle(belief)


def _of_vehicle(belief: Belief) -> Knowledge:
    zero = Prior(
        belief.config,
        {"yaw": 0.0, "pitch": 0.0},
        np.zeros(len(NAMES)),
        parameters.prior_covariance(),
    )
    return estimator.learned(zero)


def _of_model(belief: Belief, model: IdentifiedModel) -> Knowledge:
    biases = {
        plane: math.radians(degrees) for plane, degrees in model.vehicle.prior_biases_deg.items()
    }
    prior = Prior(belief.config, biases, np.array(model.joint.z), np.array(model.joint.covariance))
    levels = {plane: noise.of_model(level) for plane, level in model.noise.items()}
    return estimator.learned(prior, levels)._replace(trimmed=frozenset(biases))
