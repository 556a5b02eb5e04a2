"""Simulated vehicle: identified tailcone, sensor noise, failsafes and rejected missions."""

import math
from itertools import islice

import numpy as np
import pytest

from autopilot.control import estimator, params
from sitl.core import tailcone
from sitl.vehicle.water import drifting
from sysid.models import greybox
from sysid.monitor import tracking_metrics
from sysid.monte_carlo import (
    dynamics,
    instruments,
    samples,
)
from sysid.monte_carlo import (
    simulate as dive,
)
from sysid.monte_carlo.simulate import MissionRejectedError, Sea, SimulatedDive
from sysid.planes import Plane
from sysid.test_design.prior import DesignPrior
from tests.sysid.monte_carlo.conftest import HELD, mission, silent


def simulated(
    known: DesignPrior, sea: Sea, *, calm: bool = True, duration_s: float = 60.0, **more: float
) -> SimulatedDive:
    vehicle = known.vehicle(known.mean)
    config = params.config({**samples.trims_deg(vehicle), **HELD, **more})
    levels = {"yaw": silent(), "pitch": silent()} if calm else known.noise
    return dive.fly(vehicle, levels, mission(3.0, 20.0, duration_s), config, sea, seed=(1,))  # type: ignore[arg-type]


def test_fly_known_vehicle_calm_has_no_error(known: DesignPrior) -> None:
    dive = simulated(known, Sea(0.0), duration_s=150.0)
    assert dive.finished
    assert dive.log.setpoints.depth_m[0] == 3.0
    steady = tracking_metrics.tracking(dive.log, settling_s=110.0)
    assert steady is not None
    assert steady.heading_deg.max < 0.02
    assert steady.depth_m.max < 0.01
    assert steady.pitch_deg.max < 0.02


def test_fly_larger_disturbance_has_larger_errors(known: DesignPrior) -> None:
    calm, rough = (
        tracking_metrics.tracking(simulated(known, Sea(times), calm=False).log)
        for times in (0.5, 2.0)
    )
    assert calm is not None
    assert rough is not None
    assert rough.heading_deg.rms > 2.0 * calm.heading_deg.rms


def test_fly_rudder_bias_is_compensated_by_integrator(known: DesignPrior) -> None:
    rudder = [
        float(
            np.mean(
                np.degrees(
                    simulated(
                        known, Sea(0.0, bias_shift_rad=math.radians(shift))
                    ).log.actuators.rudder_rad[-50:]
                )
            )
        )
        for shift in (0.0, -3.0)
    ]
    assert rudder[1] - rudder[0] == pytest.approx(3.0, abs=0.3)


@pytest.mark.parametrize("travel_deg", [12.0, 20.0])
def test_fly_log_has_travel_of_autopilot(known: DesignPrior, travel_deg: float) -> None:
    """Screening judges saturation by it."""
    done = simulated(known, Sea(0.0), duration_s=1.0, ACT_TRAVEL_DEG=travel_deg)
    assert math.degrees(done.log.actuators.travel_rad) == pytest.approx(travel_deg)


def test_fly_failsafe_ends_dive_and_is_named(known: DesignPrior) -> None:
    result = simulated(known, Sea(0.0), FS_TIME_S=20.0)
    assert result.failsafe.startswith("armed")
    assert not result.finished


def test_fly_mission_of_zero_duration_is_finished(known: DesignPrior) -> None:
    result = dive.fly(
        known.vehicle(known.mean),
        known.noise,
        mission(2.0, 0.0, 0.0),
        params.config({}),
        Sea(),
        (1,),
    )
    assert result.finished
    assert result.seconds < 0.1


def test_fly_unknown_command_raises(known: DesignPrior) -> None:
    items = (mission(3.0, 20.0, 10.0)[0]._replace(command=5000),)
    vehicle = known.vehicle(known.mean)
    with pytest.raises(MissionRejectedError, match="command 5000"):
        dive.fly(vehicle, known.noise, items, params.config({}), Sea(), (1,))


def test_actuator_equals_identified_tailcone() -> None:
    actuator = greybox.Actuator(
        0.313, 3.0, 0.6, math.radians(-6.0), math.radians(15.0), math.radians(9.0), 0.02
    )
    steps = np.concatenate([[0.0], np.random.default_rng(1).uniform(-0.3, 0.3, 40).repeat(25)])
    expected = greybox.duct_angles(steps.repeat(dynamics.SUBSTEPS), actuator, dynamics.SUBSTEP_S)
    axis = greybox.discretise(actuator, dynamics.SUBSTEP_S)
    state, angles = tailcone.at_rest(axis), np.empty((steps.size, dynamics.SUBSTEPS))
    for command, each in zip(steps, angles, strict=True):
        tailcone.advance(axis, state, command, each)
    between = 0.5 * (expected[1:] + expected[:-1])
    assert angles.ravel()[:-1] == pytest.approx(between, abs=1e-9)


def test_instruments_at_rest_give_attitude_and_depth(known: DesignPrior) -> None:
    config = params.config({})
    craft = dynamics.initial_state(
        known.vehicle(known.mean), drifting((0.0, 0.0, 0.0)), instruments.field_nwu(config)
    )
    ideal = np.zeros(dynamics.N_OBSERVED)
    at = estimator.initial_estimate(instruments.frame(0, craft.observed, ideal, config), config)
    assert at.depth_m == pytest.approx(-craft.state[2], abs=1e-6)
    assert at.heading_rad == pytest.approx(0.0, abs=1e-9)


def test_deviations_mean_over_100_ms_equals_noise_model(known: DesignPrior) -> None:
    errors = instruments.errors(known.noise, np.random.default_rng(1))
    ticks = np.concatenate(list(islice(errors, 20)))
    means = ticks.reshape(-1, 5, dynamics.N_OBSERVED).mean(axis=1)
    assert np.std(means[:, 5]) == pytest.approx(known.noise[Plane.YAW].rate_radps, rel=0.05)
    assert np.std(means[:, dynamics.DEPTH]) == pytest.approx(
        known.noise[Plane.PITCH].depth_m, rel=0.05
    )
