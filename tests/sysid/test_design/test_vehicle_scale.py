"""Ratios of a vehicle to Caribou, by which tests and disturbances are scaled."""

import pytest
from msgspec.structs import replace

from sitl.vehicle import config
from sysid.planes import Plane
from sysid.test_design.vehicle_scale import vehicle_scale

CARIBOU = config.load("caribou_nominal")


def test_vehicle_scale_of_reference_is_one() -> None:
    scale = vehicle_scale(CARIBOU, CARIBOU)
    assert (scale.time, scale.length, scale.thrust_pct) == (1.0, 1.0, 58.0)
    for plane in scale.planes.values():
        assert plane[:4] == (1.0, 1.0, 1.0, 1.0)
        assert plane.max_size_deg == pytest.approx(9.0)  # 60 % of 15 deg


def test_vehicle_scale_remus_is_quick_and_light() -> None:
    scale = vehicle_scale(config.load("remus100"), CARIBOU)
    assert scale.time == pytest.approx((1.333 / 1.54) / (3.543 / 1.3), rel=1e-3)
    yaw = scale.planes[Plane.YAW]
    # I_zz - N_rdot of 8.37 against 927 kg m2 (remus100.toml with strip theory, Table 1)
    assert yaw.moment == pytest.approx(8.37 / 927.0, rel=0.05)
    assert 1.5 < yaw.frequency < 2.5  # a tailcone of 8 rad/s and 0.1 s against 3 rad/s and 0.3 s


def test_vehicle_scale_gives_a_slower_vehicle_the_time_to_dive() -> None:
    """Half the speed: the same depth takes twice the time, also for a hull of half the length."""
    slow = replace(
        CARIBOU,
        operating_point=replace(
            CARIBOU.operating_point, speed_mps=0.5 * CARIBOU.operating_point.speed_mps
        ),
    )
    assert vehicle_scale(slow, CARIBOU).leg == pytest.approx(2.0)
    assert vehicle_scale(config.load("remus100"), CARIBOU).leg == 1.0
