"""The readiness check finds the reasons why a campaign cannot work, and none where it can."""

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec import structs

from ground.missions import plans
from ground.missions.script import Script, compile_items
from sitl.vehicle import config
from sysid.design import initial
from sysid.monte_carlo import readiness
from sysid.monte_carlo.readiness import Moments, Obstacle, Readiness
from sysid.planes import PLANES, Plane
from tests.sysid import sea

DISTURBED = Moments(
    slow_nm={Plane.YAW: 2.81, Plane.PITCH: 2.24},
    slow_time_s=3.0,
    wave_nm={Plane.YAW: 4.96, Plane.PITCH: 4.57},
    wave_frequency_hz=0.15,
    wave_damping=0.1,
)
"""sitl/scenarios/disturbed.toml, made for Caribou."""
CALM = DISTURBED._replace(slow_nm=dict.fromkeys(PLANES, 0.0), wave_nm=dict.fromkeys(PLANES, 0.0))
GAINS = {
    "remus100": (0.378, 0.668, 0.0151, 0.410, 0.594, 0.290, 0.0097, 13.6),
    "xfin_auv": (2.115, 3.065, 0.0846, 2.115, 3.065, 0.168, 0.0056, 15.0),
    "docs/my_vehicle.toml": (0.647, 0.758, 0.0259, 0.673, 0.788, 0.248, 0.0083, 15.0),
}
"""`ground vehicle gains`, rounded; the last is the travel, deg."""
OTHERS = {"PTCH_I": 0.0, "DPT_D": 0.0, "HDG_IMAX": 0.05, "PTCH_IMAX": 0.0, "DPT_IMAX": 0.1}
NAMES = ("HDG_P", "HDG_D", "HDG_I", "PTCH_P", "PTCH_D", "DPT_P", "DPT_I", "ACT_TRAVEL_DEG")


def obstacle(vehicle: str, moments: Moments, *missions: str) -> Obstacle | None:
    gains = dict(zip(NAMES, GAINS[vehicle], strict=True)) | OTHERS
    items = {name: plans.load_items(name) for name in missions}
    return readiness.find_obstacle(Readiness(config.load(vehicle), gains, moments, seed=1), items)


def test_obstacle_large_disturbance_is_failsafe() -> None:
    """The campaign of remus100 ended so in its first dive: `Failsafe: pitch -75 deg`."""
    reported = obstacle("remus100", DISTURBED, "trim")
    assert reported is not None
    assert reported.where == "trim"
    assert reported.reason.startswith("it ends with the failsafe 'pitch")
    # hypot(34.2, 19.4) deg/s2: moments over I_zz - N_rdot of 8.3 kg m2
    assert "39 deg/s²" in reported.reason


def test_obstacle_test_beyond_travel_is_rejection() -> None:
    reported = obstacle("remus100", CALM, "elevator_steps")
    refusal = "Mission item 32: magnitude 14 deg: must be within 13.6 deg, and not 0"
    assert reported == Obstacle("elevator_steps", f"the autopilot refuses the mission ({refusal})")


def test_obstacle_masked_tests_is_low_coherence() -> None:
    """That campaign was refused by its verdict: coherence about crossover 0.30 and 0.28."""
    reported = obstacle("docs/my_vehicle.toml", DISTURBED, "rudder_sweeps")
    assert reported is not None
    assert reported.where == "rudder tests"
    assert "the disturbance masks them: coherence about crossover" in reported.reason
    assert obstacle("docs/my_vehicle.toml", CALM, "rudder_sweeps") is None


def test_pairs_leave_out_the_tests_after_a_failsafe() -> None:
    """A calm dive ended after two of three sweeps: ValueError in place of a refusal."""
    caribou = config.load("caribou_nominal")
    runs = [
        sea.fly(caribou, Plane.YAW, sea.doublet(3.0), name=f"sweep/{n}", wave="doublet", seed=n)
        for n in range(3)
    ]
    for calm, disturbed in ((runs[:2], runs), (runs, runs[:2])):
        pairs = readiness._pairs(calm, disturbed, Plane.YAW)
        assert [pair.run for pair in pairs] == ["sweep/0", "sweep/1"]


def test_obstacle_heavy_vehicle_same_disturbance_is_none() -> None:
    assert obstacle("xfin_auv", DISTURBED, "trim", "rudder_sweeps") is None


@pytest.mark.parametrize(
    ("buoyancy_n", "elevator_gain", "reason"),
    [
        (30.0, 1.0, "cannot dive against its buoyancy of 30 N"),
        (3.0, 0.02, "gains of the first dive command"),
    ],
)
def test_obstacle_vehicle_that_stays_at_the_surface(
    buoyancy_n: float, elevator_gain: float, reason: str
) -> None:
    """It is commanded to its largest pitch against 30 N, and with small gains to a small one."""
    known = config.load("remus100")
    ballast = structs.replace(known.ballast, net_buoyancy_n=buoyancy_n)
    gains = dict(zip(NAMES, GAINS["remus100"], strict=True)) | OTHERS
    gains |= {name: elevator_gain * gains[name] for name in ("PTCH_P", "DPT_P", "DPT_I")}
    check = Readiness(structs.replace(known, ballast=ballast), gains, CALM, seed=1)
    reported = readiness.find_obstacle(check, {"trim": plans.load_items("trim")})
    assert reported is not None
    assert reason in reported.reason


@pytest.mark.parametrize(("pitch_deg", "reason"), [(-20.0, "buoyancy of 5 N"), (-10.0, "deg/s")])
def test_obstacle_dive_that_does_not_end_names_full_commands(pitch_deg: float, reason: str) -> None:
    """Pitch is limited to 20 deg; a slow vehicle held that without reaching its depth."""
    known = config.load("remus100")
    ballast = structs.replace(known.ballast, net_buoyancy_n=5.0)
    gains = dict(zip(NAMES, GAINS["remus100"], strict=True)) | OTHERS
    check = Readiness(structs.replace(known, ballast=ballast), gains, CALM, seed=1)
    dive = check.fly(plans.load_items("trim"))
    assert check.obstacle("trim", dive) is None
    pitch_rad = np.full_like(dive.log.setpoints.pitch_rad, math.radians(pitch_deg))
    setpoints = replace(dive.log.setpoints, pitch_rad=pitch_rad)
    late = dive._replace(finished=False, log=replace(dive.log, setpoints=setpoints))
    reported = check.obstacle("trim", late)
    assert reported is not None
    assert "does not end within its time" in reported.reason
    assert reason in reported.reason


@pytest.mark.slow
def test_heading_after_rudder_test_returns_on_nearly_unstable_hull() -> None:
    """A step of 4 deg turns this hull at 20 deg/s; it then circled at full rudder without end.

    Its slowest pole in yaw is at -0.03 1/s, so that the linear model turns twenty times as fast as
    the vehicle with full rudder.
    """
    file = str(Path(__file__).parents[3] / "benchmarks/campaigns/vehicles/short_fat.toml")
    gains, vehicle = initial.design_initial_gains(file).parameters, config.load(file)
    hold = {"depth_m": 3.0, "heading_deg": 0.0, "thrust_pct": gains["THR_CRUISE_PCT"]}
    step = {"signal": "step", "axis": "rudder", "duration_s": 10, "magnitude_deg": 4.1}
    mission = msgspec.convert(
        {
            "name": "turn",
            "step": [
                {**hold, "duration_s": 60.0},
                {"test": step},
                {**hold, "duration_s": 60.0},
                {"surface": True},
            ],
        },
        Script,
    )
    dive = Readiness(vehicle, gains, CALM, seed=1).fly(compile_items(mission), disturbance=0.0)
    attitude = dive.log.attitude
    last = (attitude.time_s > 110.0) & (attitude.time_s < 125.0)
    assert np.max(np.abs(attitude.r_radps)) > math.radians(15.0)
    assert np.max(np.abs(attitude.yaw_rad[last])) < math.radians(3.0)


def test_noise_levels_equal_moment_over_inertia() -> None:
    """Caribou: 4.96 N m over I_zz - N_rdot = 927 kg m2 (Table 1); sway adds less than 5 %."""
    from sysid.test_design import prior as design_priors

    prior = design_priors.from_file(config.load("caribou_nominal"))
    level = readiness.noise_levels(prior.vehicle(prior.mean), DISTURBED)[Plane.YAW]
    assert level.wave_radps2 == pytest.approx(4.96 / 927.0, rel=0.05)
    assert math.degrees(level.slow_radps2) == pytest.approx(0.174, abs=0.01)
