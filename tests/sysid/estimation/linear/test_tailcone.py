"""Derivatives of the duct angle against differences, at rate limit and stops too."""

import math

import numpy as np
import pytest

from sysid.estimation.linear import tailcone
from sysid.models.greybox import Actuator

VALUES = {"delay_s": 1e-4, "bias_rad": 1e-4, "natural_frequency_radps": 1e-5, "damping_ratio": 1e-6}
"""Values of the tailcone in their order, with difference steps over which the angle is linear."""
FREE = Actuator(0.311, 3.0, 0.6, 0.01, math.radians(30.0), math.radians(90.0))


@pytest.mark.parametrize(
    "actuator",
    [
        FREE,
        FREE._replace(rate_radps=math.radians(12.0)),
        FREE._replace(travel_rad=math.radians(7.0)),
        FREE._replace(delay_s=0.0),
    ],
    ids=["free", "rate limited", "at its stops", "at once"],
)
def test_angle_sensitivity_matches_differences(actuator: Actuator) -> None:
    command = np.repeat(np.random.default_rng(1).normal(0.0, math.radians(6.0), 12), 60)
    sensitivity = tailcone.angle_sensitivity(command, actuator)
    np.testing.assert_array_equal(sensitivity.angle_rad, tailcone.angles(command, actuator))
    for slope, (name, step) in zip(sensitivity.slopes, VALUES.items(), strict=True):
        perturbed = actuator._replace(**{name: getattr(actuator, name) + step})
        expected = (tailcone.angles(command, perturbed) - sensitivity.angle_rad) / step
        # A difference is wrong if a limit begins or ends within its step.
        close = np.abs(slope - expected) < 1e-3 * np.max(np.abs(expected))
        assert np.mean(close) > 0.97, name
        assert np.max(np.abs(slope)) > 1e-3
