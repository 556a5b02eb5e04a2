"""What a vehicle file or an earlier model tells before the first test."""

import math
from pathlib import Path

import numpy as np

from sysid import parameters
from sysid.fit import Prior
from sysid.model import IdentifiedModel, NoiseModel
from sysid.noise import Noise
from sysid.online import estimator
from sysid.online.estimator import Knowledge
from sysid.parameters import NAMES
from sysid.refit import Belief, belief_in


def knowledge(prior: str | Path) -> Knowledge:
    """As `ground refit --prior` takes it. Raises VehicleError, ModelError, RefitError."""
    belief = belief_in(prior)
    return _of_model(belief, belief.earlier) if belief.earlier else _of_vehicle(belief)


def _of_vehicle(belief: Belief) -> Knowledge:
    zero = Prior(belief.config, {"yaw": 0.0, "pitch": 0.0}, np.zeros(len(NAMES)), parameters.prior_covariance())
    return estimator.learned(zero)


def _of_model(belief: Belief, model: IdentifiedModel) -> Knowledge:
    biases = {plane: math.radians(degrees) for plane, degrees in model.vehicle.prior_biases_deg.items()}
    prior = Prior(belief.config, biases, np.array(model.joint.z), np.array(model.joint.covariance))
    levels = {plane: _levels(level) for plane, level in model.noise.items()}
    return estimator.learned(prior, levels)._replace(trimmed=frozenset(biases))


def _levels(model: NoiseModel) -> Noise:
    return Noise(
        rate_radps=math.radians(model.rate_noise_degps),
        angle_rad=math.radians(model.angle_noise_deg),
        depth_m=model.depth_noise_m,
        slow_radps2=math.radians(model.slow_accel_degps2),
        slow_time_s=model.slow_time_s,
        wave_radps2=math.radians(model.wave_accel_degps2),
        wave_frequency_hz=model.wave_frequency_hz,
        wave_damping=model.wave_damping,
        force_mps15=model.force_noise_mps15,
    )
