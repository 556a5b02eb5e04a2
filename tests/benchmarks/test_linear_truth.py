"""Noise of the linear study: white for the cells of white noise."""

import math

import numpy as np
import pytest

from benchmarks.identification import linear_truth
from benchmarks.identification.linear_truth import Draw
from sysid.estimation.linear import linear_model
from sysid.planes import Plane

BLOCK = 50
"""Samples whose mean is taken: white noise has 1/sqrt(50) of its standard deviation then."""


@pytest.mark.parametrize(
    ("draw", "is_white"), [(linear_truth.white, True), (linear_truth.coloured, False)]
)
def test_angle_drifts_only_in_coloured_noise(draw: Draw, is_white: bool) -> None:
    """With a drift in its white noise, output error had 85 % of the numbers in its intervals."""
    plane = linear_model.linear_plane(linear_truth.true_plant("xfin_auv", Plane.YAW))
    (run,) = draw(plane, [6000], np.random.default_rng(1))
    angle = run[-2000:, 1]  # the initial motion has ended
    means = angle.reshape(-1, BLOCK).mean(axis=1)
    white_sd = float(np.std(np.diff(angle))) / math.sqrt(2.0)
    ratio = float(np.std(means)) * math.sqrt(BLOCK) / white_sd
    assert (ratio < 1.4) == is_white
