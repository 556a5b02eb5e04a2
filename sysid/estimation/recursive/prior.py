"""Prior of the recursive estimator from a vehicle file or an earlier model."""

from pathlib import Path

import numpy as np

from sysid.estimation.map.problem import Prior
from sysid.estimation.recursive import estimator
from sysid.estimation.recursive.estimator import Knowledge
from sysid.models import noise, parameters
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES
from sysid.planes import Plane
from sysid.prior_knowledge import PriorKnowledge, prior_knowledge, prior_of


def knowledge(prior: str | Path) -> Knowledge:
    """Read the prior as `ground refit --prior` does.

    Parameters
    ----------
    prior : str or Path
        Name of a shipped vehicle, path of a vehicle file, or path of a ``model.json``.

    Returns
    -------
    Knowledge
        Knowledge before the first test.

    Raises
    ------
    VehicleFileError, ModelError, RefitError
        The file cannot be used.
    """
    known_vehicle = prior_knowledge(prior)
    return (
        _of_model(known_vehicle, known_vehicle.earlier)
        if known_vehicle.earlier
        else _of_vehicle(known_vehicle)
    )


def _of_vehicle(known_vehicle: PriorKnowledge) -> Knowledge:
    """Return the knowledge from a vehicle file: parameters at zero, actuator biases unknown."""
    prior = Prior(
        config=known_vehicle.config,
        biases_rad={Plane.YAW: 0.0, Plane.PITCH: 0.0},
        mean=np.zeros(len(NAMES)),
        covariance=parameters.prior_covariance(),
    )
    return estimator.prior_knowledge(prior)


def _of_model(known_vehicle: PriorKnowledge, model: IdentifiedModel) -> Knowledge:
    """Return the knowledge from estimate, covariance, noise levels and biases of a model."""
    prior = prior_of((), known_vehicle.config, model)
    levels = {plane: noise.from_model(level) for plane, level in model.noise.items()}
    return estimator.prior_knowledge(prior, levels)._replace(trimmed=frozenset(prior.biases_rad))
