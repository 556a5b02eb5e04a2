"""A recorded dive again, with its own disturbance."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autopilot.control import params
from autopilot.control.lqg import LqgControllers
from autopilot.control.types import Home, VehicleEstimate
from ground.missions import plans
from mavlink_io.mission_items import FENCE_TYPE, RALLY_TYPE, MavCmd, MissionItem
from mavlink_io.tick import TICK_S
from sysid.data.dataset import Log, LogError, LogEvent, Position
from sysid.data.events import Armed
from sysid.monte_carlo import instruments, replay, samples, simulate
from sysid.monte_carlo.simulate import Sea, SimulatedDive
from sysid.test_design import prior as priors
from tests.helpers.lqg import lqg_controllers

PRIOR = priors.read("caribou_nominal")
MODEL = PRIOR.vehicle(PRIOR.mean)
ITEMS = plans.load_items("combined")
PLAN = replay.DivePlan(ITEMS)
CHANGE = {"DPT_P": 0.065, "HDG_P": 0.4}
"""Half the depth gain and two thirds of the heading gain."""
OTHER_Z = PRIOR.mean + np.array([0.5, -0.5, 0.5, *[0.0] * (PRIOR.mean.size - 3)])
"""Vehicle that flies: half a standard deviation from the model in three parameters."""
TRIMS = samples.trims_deg(PRIOR.vehicle(OTHER_Z))


def fly(
    values: dict[str, float], seed: int, controllers: LqgControllers | None = None
) -> SimulatedDive:
    """Fly the other vehicle."""
    config = replace(params.config({**TRIMS, **values}), lqg_controllers=controllers)
    vehicle = PRIOR.vehicle(OTHER_Z)
    return simulate.fly(vehicle, PRIOR.noise, ITEMS, config, Sea(), (seed,))


def recorded(dive: SimulatedDive) -> Log:
    """Return the log of a dive as ground records it: with parameters and arming."""
    events = (LogEvent(0.0, Armed()), *dive.log.events)
    return replace(dive.log, parameters=TRIMS, events=events)


@pytest.mark.slow
def test_unchanged_parameters_reproduce_the_dive() -> None:
    log = recorded(fly({}, seed=4))
    again = replay.replay(log, MODEL, PLAN, {})
    # Without the recorded disturbance the replay is no copy: the same dive in a calm sea.
    calm = replay._deviation(replay._at_ticks(log), replay._of(fly({}, seed=5)))
    assert again.fidelity.heading_deg < 0.3 * calm.heading_deg
    assert again.fidelity.heading_deg < 0.5
    assert again.fidelity.pitch_deg < 0.5
    assert again.fidelity.depth_m < 0.05
    assert again.effect == (0.0,) * 5


@pytest.mark.slow
def test_changed_parameters_have_the_effect_of_a_true_dive() -> None:
    before, after = fly({}, seed=4), fly(CHANGE, seed=4)
    again = replay.replay(recorded(before), MODEL, PLAN, CHANGE)
    truth = replay._deviation(replay._of(before), replay._of(after))
    for predicted, true in zip(again.effect[:3], truth[:3], strict=True):
        assert predicted == pytest.approx(true, rel=0.3)
    error = replay._deviation(replay._of(after), replay._of(again.changed))
    assert error.depth_m < 0.3 * truth.depth_m
    assert error.heading_deg < 0.3 * truth.heading_deg


@pytest.mark.slow
def test_lqg_dive_is_reproduced_with_its_controllers_only() -> None:
    controllers = lqg_controllers()
    log = recorded(fly({}, seed=4, controllers=controllers))
    again = replay.replay(log, MODEL, PLAN, {}, replay.Controllers(controllers, None))
    assert again.fidelity.depth_m < 0.05
    assert again.fidelity.heading_deg < 0.5
    # The PID loops of the other replay fly another path.
    assert again.effect.depth_m > 4.0 * again.fidelity.depth_m


def test_innovations_give_the_disturbing_moment() -> None:
    """A yaw moment of 10 N m with a period of 20 s acts on the model's own vehicle."""
    ticks = np.arange(0.0, 400.0, TICK_S)
    moment = 10.0 * np.sin(2 * math.pi * ticks / 20.0)
    acting = np.zeros((ticks.size, 6))
    acting[:, 5] = moment
    config = params.config(samples.trims_deg(MODEL))
    craft = replay._craft(MODEL, 0.0, instruments.field_nwu(config))
    dive = simulate.fly_with(craft, replay._continued(acting), replay._no_errors(), ITEMS, config)
    table = replay._at_ticks(recorded(dive))
    wrenches, _ = replay.disturbance(MODEL, table)
    found = wrenches[:, 5]
    smooth = np.convolve(found, np.full(50, 1 / 50), mode="same")[1000:5000]
    expected = moment[1000:5000]
    assert np.corrcoef(smooth, expected)[0, 1] > 0.9
    # the size: slope of the regression of the found on the acting moment
    assert np.polyfit(expected, smooth, 1)[0] == pytest.approx(1.0, abs=0.2)


def test_heading_of_a_vehicle_is_that_of_the_log() -> None:
    for heading_deg in (-170.0, -20.0, 0.0, 90.0, 179.0):
        craft = replay._craft(MODEL, math.radians(heading_deg), (0.2, 0.0, -0.48))
        assert math.degrees(replay._heading_rad(craft)) == pytest.approx(heading_deg)
        assert replay._pitch_rad(craft) == pytest.approx(0.0)


def test_log_without_parameters_or_arming_is_refused() -> None:
    log = recorded(fly({}, seed=4))
    with pytest.raises(LogError, match="rehearsal: has no parameters"):
        replay.replay(replace(log, parameters={}), MODEL, PLAN, {})
    with pytest.raises(LogError, match="rehearsal: the vehicle was not armed"):
        replay.replay(replace(log, events=()), MODEL, PLAN, {})
    short = replace(log.attitude, **{k: v[:40] for k, v in vars(log.attitude).items()})
    with pytest.raises(LogError, match=r"rehearsal: 4\.0 s from arming"):
        replay.replay(replace(log, attitude=short), MODEL, PLAN, {})


def test_replay_ends_at_the_geofence_of_the_dive() -> None:
    """A dive to the north from home, in a circle of 60 m."""
    log = recorded(fly({}, seed=4))
    time_s = log.attitude.time_s
    position = Position(time_s, 1.2 * time_s, np.zeros(time_s.size))
    fence, rally = (
        (MissionItem(0, 3, command, p1=p1, x=420_000_000, y=-710_000_000, mission_type=kind),)
        for command, p1, kind in (
            (MavCmd.NAV_FENCE_CIRCLE_INCLUSION, 60.0, FENCE_TYPE),
            (MavCmd.NAV_RALLY_POINT, 0.0, RALLY_TYPE),
        )
    )
    plan = replay.DivePlan(ITEMS, fence, rally)
    again = replay.replay(
        replace(log, position=position, home_deg=(42.0, -71.0)), MODEL, plan, {"FENCE_ACTION": 0}
    )
    assert again.unchanged.failsafe == "geofence"
    assert again.unchanged.seconds == pytest.approx(60.0 / 1.2, abs=10.0)  # FS_LOOK_S before it
    assert again.changed.finished  # reported only
    with pytest.raises(LogError, match="rehearsal: has no LOCAL_POSITION_NED or no HOME_POSITION"):
        replay.replay(log, MODEL, plan, {})


def test_recorded_drift_is_added_and_continues_after_the_dive() -> None:
    drift_m = np.array([0j, 1.0 + 0j, 2.0 + 2.0j], np.complex128)
    record = simulate.NavigationRecord(Home(42.0, -71.0, known=True), drift_m, drift_m * 0.1)
    for tick, north_m, east_m, current_mps in (
        (1, 11.0, 5.0, 0.1 + 0j),
        (2, 12.0, 7.0, 0.2 + 0.2j),
        (4, 14.0, 9.0, 0.2 + 0.2j),
    ):
        estimate = record.locate(VehicleEstimate(), tick, 10.0 + 5.0j)
        assert (estimate.north_m, estimate.east_m) == pytest.approx((north_m, east_m))
        assert estimate.navigation.current_mps == pytest.approx(current_mps)
