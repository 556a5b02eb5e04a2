"""Vehicles at parameters far from the prior."""

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.models import parameters
from sysid.models.parameters import INERTIAS, NAMES, PARAMETERS
from sysid.planes import Plane

NO_BIAS = {Plane.YAW: 0.0, Plane.PITCH: 0.0}
ROW = {"I_zz": 5, "I_yy": 4}


@pytest.mark.parametrize("vehicle", ["caribou_nominal", "remus100", "xfin_auv"])
@pytest.mark.parametrize("name", INERTIAS)
@pytest.mark.parametrize("z_inertia", [-4.0, -2.5, 1.0, 4.0])
def test_inertia_ratio_applies_to_body_and_added_inertia(
    vehicle: str, name: str, z_inertia: float
) -> None:
    """At the lower bound the sum is 0.45 of the prior's, less than the added inertia alone."""
    z = np.zeros(len(NAMES))
    z[NAMES.index(name)] = z_inertia
    prior = config.load(vehicle)
    before = parameters.candidate_vehicle(prior, NO_BIAS, np.zeros(len(NAMES))).model.inertia
    after = parameters.candidate_vehicle(prior, NO_BIAS, z).model.inertia
    ratio = np.exp(PARAMETERS[NAMES.index(name)].prior_sd * z_inertia)
    row = ROW[name]
    assert after.M[row, row] == pytest.approx(ratio * before.M[row, row], rel=1e-12)
    assert np.linalg.eigvalsh(after.M_RB).min() > 0.0
    assert after.M_A[row, row] > 0.0
    others = [i for i in range(6) if i != row]
    assert np.array_equal(after.M[np.ix_(others, others)], before.M[np.ix_(others, others)])
