"""The vehicles that a model allows for, to be rehearsed with: draws from what it says of z."""

from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import SHIPPED, VehicleConfig
from sysid.models import model_file as models
from sysid.models.parameters import NAMES, CandidateVehicle, feasible_samples
from sysid.test_design import prior as beliefs
from sysid.test_design.prior import DesignPrior

Array = NDArray[np.float64]

MAX_DRAWS_PER_SAMPLE = 10
"""For every vehicle that is wanted: some draws are of none that can be."""


class NoCovarianceError(ValueError):
    """A model that does not say how sure it is, or of what; the message says what would."""


def read(path: str | Path, prior: VehicleConfig | None = None) -> DesignPrior:
    """What a ``model.json`` believes. ``prior`` is needed when it was refitted from a vehicle file
    that is not shipped.

    Raises:
        ModelError, UnknownError: each in one line.
    """
    model = models.read(path)
    if model.method != "map" or not np.any(model.joint.covariance):
        raise NoCovarianceError(
            f"{path}: method = {model.method!r}, joint.covariance is zero or none: it does not tell"
            " which vehicles are possible; refit the logs by --method map"
        )
    if model.joint.names != NAMES:
        raise NoCovarianceError(
            f"{path}: joint.names are not this version's parameters; refit its logs"
        )
    if prior is None and model.vehicle.prior not in SHIPPED:
        raise NoCovarianceError(
            f"{path}: vehicle.prior = {model.vehicle.prior!r} is not shipped; give its file by"
            " --prior"
        )
    return beliefs.from_model(
        model, prior or vehicle_files.load(model.vehicle.prior), Path(path).name
    )


def draw(belief: DesignPrior, count: int, seed: int) -> list[Array]:
    """``count`` values of z, the same for the same seed. Raises UnknownError where hardly any can
    be a vehicle."""
    draws = np.random.default_rng(seed).standard_normal(
        (MAX_DRAWS_PER_SAMPLE * count, belief.mean.size)
    )
    found = list(
        islice(feasible_samples(belief.vehicle, belief.mean, belief.covariance, draws), count)
    )
    if len(found) == count:
        return [drawn.z for drawn in found]
    raise NoCovarianceError(
        f"{belief.name}: joint.covariance allows for hardly any vehicle that can be; fly more tests"
    )


def trims_deg(vehicle: CandidateVehicle) -> dict[str, float]:
    """The parameters that a trim flight would leave aboard."""
    return {
        "TRIM_RUD_DEG": float(np.degrees(beliefs.level_flight(vehicle, "yaw").trim_rad)),
        "TRIM_ELE_DEG": float(np.degrees(beliefs.level_flight(vehicle, "pitch").trim_rad)),
    }
