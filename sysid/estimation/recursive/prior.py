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
from sysid.refit import PriorKnowledge, prior_knowledge


def knowledge(prior: str | Path) -> Knowledge:
    """As `ground refit --prior` takes it. Raises VehicleError, ModelError, RefitError."""
    belief = prior_knowledge(prior)
    return _of_model(belief, belief.earlier) if belief.earlier else _of_vehicle(belief)


def _of_vehicle(belief: PriorKnowledge) -> Knowledge:
    zero = Prior(
        belief.config,
        {"yaw": 0.0, "pitch": 0.0},
        np.zeros(len(NAMES)),
        parameters.prior_covariance(),
    )
    return estimator.prior_knowledge(zero)


def _of_model(belief: PriorKnowledge, model: IdentifiedModel) -> Knowledge:
    biases = {
        plane: math.radians(degrees) for plane, degrees in model.vehicle.prior_biases_deg.items()
    }
    prior = Prior(belief.config, biases, np.array(model.joint.z), np.array(model.joint.covariance))
    levels = {plane: noise.from_model(level) for plane, level in model.noise.items()}
    return estimator.prior_knowledge(prior, levels)._replace(trimmed=frozenset(biases))
