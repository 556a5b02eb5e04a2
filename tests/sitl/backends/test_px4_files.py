"""Files for PX4: the airframe, the parameter file, and the position messages."""

import math
import re
from pathlib import Path

import pytest

from mavlink_io import dialect
from sitl.backends import messages
from sitl.core.truth import Truth

FOLDER = Path(__file__).parents[3] / "examples" / "px4"
INT32, REAL32 = 6, 9
"""MAV_PARAM_TYPE."""


def airframe() -> dict[str, float]:
    text = (FOLDER / "60500_none_caribou").read_text(encoding="utf-8")
    return {name: float(value) for name, value in re.findall(r"^param set (\w+) (\S+)", text, re.M)}


def test_parameter_file_has_the_values_of_the_airframe() -> None:
    rows = [
        line.split("\t")
        for line in (FOLDER / "caribou.params").read_text(encoding="utf-8").splitlines()
        if not line.startswith("#")
    ]
    assert {row[2]: float(row[3]) for row in rows} == airframe()
    assert all(row[:2] == ["1", "1"] and len(row) == 5 for row in rows)
    for _, _, name, value, kind in rows:
        assert len(name) <= 16
        assert int(kind) == (REAL32 if "." in value else INT32), name


def test_airframe_assigns_the_default_outputs() -> None:
    """Default of ``--outputs``: servo 1 is the rudder, servo 2 the elevator, then motor 1."""
    values = airframe()
    assert [values[f"PWM_MAIN_FUNC{n}"] for n in (1, 2, 3)] == [201, 202, 101]
    assert (values["CA_SV_CS0_TYPE"], values["CA_SV_CS0_TRQ_Y"]) == (4, 1)
    assert (values["CA_SV_CS1_TYPE"], values["CA_SV_CS1_TRQ_P"]) == (3, 1)


def truth(down_m: float) -> Truth:
    return Truth(
        time_us=2_000_000,
        position_ned_m=(30.0, -20.0, down_m),
        attitude_q=(1.0, 0.0, 0.0, 0.0),
        velocity_ned_mps=(1.2, -0.4, 0.1),
        rates_radps=(0.0, 0.0, 0.0),
        specific_force_mps2=(0.0, 0.0, -9.8),
        water_velocity_ned_mps=(0.0, 0.0, 0.0),
        rudder_rad=0.0,
        elevator_rad=0.0,
        propeller_rps=0.0,
        pitch_disturbance_nm=0.0,
        yaw_disturbance_nm=0.0,
    )


def test_fix_under_water_is_at_the_true_place() -> None:
    values = messages.gps_values(messages.true_fix(truth(7.0), 42.35, -71.0))
    fix = dialect.by_name("HIL_GPS").record(*values)
    degree_m = math.pi / 180.0 * 6_371_000.0
    assert fix.fix_type == 3
    assert (fix.lat * 1e-7 - 42.35) * degree_m == pytest.approx(30.0, abs=0.1)
    east_m = (fix.lon * 1e-7 + 71.0) * degree_m * math.cos(math.radians(42.35))
    assert east_m == pytest.approx(-20.0, abs=0.1)
    assert (fix.alt, fix.vn, fix.ve, fix.vd) == (-7000, 120, -40, 10)
    assert (fix.eph, fix.epv) == (30, 30)


def test_pose_has_covariance_of_position_and_no_velocity() -> None:
    pose = dialect.by_name("ODOMETRY").record(*messages.true_pose_values(truth(7.0)))
    assert (pose.x, pose.y, pose.z) == (30.0, -20.0, 7.0)
    assert [pose.pose_covariance[n] for n in (0, 6, 11)] == pytest.approx([0.09] * 3)
    assert len(pose.pose_covariance) == len(pose.velocity_covariance) == 21
    assert math.isnan(pose.vx)
