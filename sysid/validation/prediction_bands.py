"""How far a run may stray from what a model predicts: the estimate's doubt, the sea and the sensors
together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid.data.segments import Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import STRIDE
from sysid.models import noise, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.validation import crossover, noise_floor
from sysid.validation.validate import DT_S, uncertain_vehicle

Array = NDArray[np.float64]


class Band(NamedTuple):
    """On a run's grid from LEAD_S before its test; one standard deviation, rad/s."""

    time_s: Array
    estimate_radps: Array
    """Of the predicted rate, from the estimate's covariance; zero where nobody knows it."""
    sea_radps: Array
    """Of the measured rate about a perfect prediction."""


def rate_band(model: IdentifiedModel, run: Run, prior: VehicleConfig | None = None) -> Band:
    """Of the predicted rate of a run. ``prior`` as for ``prediction.predict``."""
    belief = uncertain_vehicle(model, prior)
    flown = run.since(-prediction.LEAD_S)
    doubt = np.zeros(flown.time_s.size)
    if belief.covariance is not None:
        doubt = crossover.propagate_sd(
            lambda z: prediction.simulate(belief.vehicle(z), flown).rate_radps,
            belief.z,
            belief.covariance,
        )
    return Band(flown.time_s, doubt, _sea(model, flown, prior))


def _sea(model: IdentifiedModel, flown: Run, prior: VehicleConfig | None) -> Array:
    if flown.plane not in model.noise:
        return np.zeros(flown.time_s.size)
    belief = uncertain_vehicle(model, prior)
    linear = fit.linear_plane(belief.vehicle(belief.z), flown.plane)
    level = noise.from_model(model.noise[flown.plane])
    steps = flown.time_s.size // STRIDE + 1
    sd = np.sqrt(np.diag(noise_floor.rate_covariance(linear, level, DT_S, 0, steps)))
    return np.interp(np.arange(flown.time_s.size), STRIDE * np.arange(steps), sd)


def innovations(model: IdentifiedModel, run: Run, prior: VehicleConfig | None = None) -> Array:
    """Normalised innovations of the rate over a test, every ``DT_S``: white where model and noise
    model hold."""
    belief = uncertain_vehicle(model, prior)
    vehicle = belief.vehicle(belief.z)
    (residual,) = fit.residuals(vehicle, [fit.dataset(run)])
    level = noise.from_model(model.noise[run.plane])
    by = noise.build(fit.linear_plane(vehicle, run.plane), level, DT_S, len(residual))
    return noise.whiten_residual(residual, by)[int(np.count_nonzero(run.preroll)) // STRIDE :, 0]
