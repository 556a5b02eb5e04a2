"""Vehicles sampled from a model's posterior of z for simulation."""

from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mavlink_io.errors import ErrorCode, InputError
from sitl.vehicle.config import VehicleConfig
from sysid.models import model_file as models
from sysid.models import prediction
from sysid.models.parameters import MAX_DRAWS_PER_SAMPLE, NAMES, CandidateVehicle, feasible_samples
from sysid.planes import Plane
from sysid.test_design import prior as design_priors
from sysid.test_design.prior import DesignPrior

Array = NDArray[np.float64]


class NoCovarianceError(InputError):
    """The model has no usable covariance; the message gives the remedy."""

    code = ErrorCode.NO_COVARIANCE


def read(path: str | Path, prior: VehicleConfig | None = None) -> DesignPrior:
    """Read the posterior of a ``model.json``.

    Parameters
    ----------
    path : str or Path
        Model file.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.

    Returns
    -------
    DesignPrior
        Posterior of the model.

    Raises
    ------
    ModelError, NoCovarianceError
        The file is invalid or has no usable covariance; the message has one line.
    """
    model = models.read(path)
    if model.method != "map" or not np.any(model.joint.covariance):
        raise NoCovarianceError(
            f"{path}: method = {model.method!r}, joint.covariance is zero or missing: vehicles"
            " cannot be sampled from it; refit the logs with --method map"
        )
    if model.joint.names != NAMES:
        raise NoCovarianceError(
            f"{path}: joint.names are not this version's parameters; refit its logs"
        )
    return design_priors.from_model(model, prediction.prior_vehicle(model, prior), Path(path).name)


def draw(posterior: DesignPrior, count: int, seed: int) -> list[Array]:
    """Return `count` values of z, the same for the same seed.

    Raises NoCovarianceError if hardly any draw is a possible vehicle.
    """
    draws = np.random.default_rng(seed).standard_normal(
        (MAX_DRAWS_PER_SAMPLE * count, posterior.mean.size)
    )
    samples = list(
        islice(
            feasible_samples(posterior.vehicle, posterior.mean, posterior.covariance, draws), count
        )
    )
    if len(samples) == count:
        return [sample.z for sample in samples]
    raise NoCovarianceError(
        f"{posterior.name}: joint.covariance gives hardly any possible vehicle; fly more tests"
    )


def trims_deg(vehicle: CandidateVehicle) -> dict[str, float]:
    """Return the trim parameters that a trim flight would give.

    Parameters
    ----------
    vehicle : CandidateVehicle
        The vehicle.

    Returns
    -------
    dict
        TRIM_RUD_DEG and TRIM_ELE_DEG (deg).
    """
    return {
        "TRIM_RUD_DEG": float(np.degrees(design_priors.level_flight(vehicle, Plane.YAW).trim_rad)),
        "TRIM_ELE_DEG": float(
            np.degrees(design_priors.level_flight(vehicle, Plane.PITCH).trim_rad)
        ),
    }
