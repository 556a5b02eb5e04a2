import math
from functools import partial

import numpy as np
import pytest

from mavlink_io.mission_items import MissionItem
from sitl.vehicle import config
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES
from sysid.test_design import prior as beliefs
from sysid.test_design.prior import DesignPrior
from tests.helpers.missions import leg

HELD = {
    "HDG_P": 0.6,
    "HDG_D": 1.5,
    "HDG_I": 0.05,
    "HDG_IMAX": 0.12,
    "PTCH_P": 0.6,
    "PTCH_D": 1.6,
    "DPT_P": 0.2,
    "DPT_D": 0.6,
    "DPT_I": 0.02,
    "DPT_IMAX": 0.1,
}
"""Gains that hold the vehicle, with integrators that settle."""
UNSTABLE = {**HELD, "HDG_P": 4.0}
LAND = MissionItem(4, 2, 21)


def mission(depth_m: float, heading_deg: float, duration_s: float) -> tuple[MissionItem, ...]:
    return *leg(depth_m=depth_m, heading_deg=heading_deg, duration_s=duration_s), LAND


@pytest.fixture(scope="package")
def known() -> DesignPrior:
    """Return Caribou as in its file, trimmed, without play and without uncertainty."""
    trimmed = beliefs.with_trim(
        beliefs.from_file(config.load("caribou_nominal")), math.radians(6.0), math.radians(0.4)
    )
    mean = np.zeros(len(NAMES))
    mean[NAMES.index("backlash")] = -9.0
    return trimmed._replace(mean=mean, covariance=np.zeros((len(NAMES), len(NAMES))))


@pytest.fixture(scope="package")
def uncertain(known: DesignPrior) -> DesignPrior:
    """Return the same vehicle with uncertainty of every parameter."""
    return known._replace(covariance=0.04 * beliefs.from_file(known.config).covariance)


silent = partial(Noise, 0.0, 0.0, 0.0, 0.0, wave_radps2=0.0, force_mps15=0.0)
"""Noise model without disturbance and without sensor noise."""
