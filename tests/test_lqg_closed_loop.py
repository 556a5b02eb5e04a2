"""LQG controllers in closed loop: disturbance rejection, take-over and change of depth."""

import numpy as np
import pytest

from autopilot.control.lqg import LqgControllers
from sysid.control_analysis.loop_transfer import SAMPLING_S, Lag
from sysid.design.design_model import DEFAULT_DISTURBANCE
from sysid.design.lqg import synthesis, tick_controllers, weights
from sysid.models import noise
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.reproduction.paper_tables import CRUISE_SPEED_MPS, TABLE_1_ADJUSTED
from tests.helpers.closed_loop import Dive
from tests.helpers.lqg import lqg_controllers
from tests.helpers.missions import leg
from tests.test_shaped_loops import DEPTH_LOOP, LEAD, TRIMMED

VALUES = TRIMMED | DEPTH_LOOP | LEAD | {"HDG_REF_W": 0.6, "DPT_REF_W": 0.3, "PTCH_FF": 0.2}


@pytest.fixture(scope="module")
def controllers() -> LqgControllers:
    return lqg_controllers()


def test_lqg_holds_heading_and_depth_closer_than_pid(controllers: LqgControllers) -> None:
    def steady_sd(flown: LqgControllers | None) -> tuple[float, float]:
        """Return the standard deviation of heading (rad) and depth (m)."""
        dive = Dive(
            leg(depth_m=4.0, heading_deg=0.0, duration_s=100.0),
            sea="disturbed",
            values=VALUES,
            controllers=flown,
        )
        steady = dive.during(40.0, 98.0)
        return float(np.std(dive["true_heading"][steady])), float(
            np.std(dive["true_depth_m"][steady])
        )

    lqg, pid = steady_sd(controllers), steady_sd(None)
    assert lqg[0] < 0.93 * pid[0]
    assert lqg[1] < 0.8 * pid[1]


def test_lqg_takes_over_smoothly_and_reaches_new_depth(controllers: LqgControllers) -> None:
    items = leg(depth_m=3.0, heading_deg=0.0, duration_s=60.0)
    dive = Dive(
        items + leg(depth_m=6.0, heading_deg=0.0, duration_s=50.0, first=4),
        values=VALUES,
        controllers=controllers,
    )
    rudder_deg = np.degrees(dive["rudder"])
    assert np.max(np.abs(np.diff(rudder_deg[dive.during(5.0, 95.0)]))) < 6.0
    after, end = dive.during(60.0, 110.0), dive.during(100.0, 110.0)
    assert dive["true_depth_m"][after].max() < 6.3
    assert np.abs(dive["true_depth_m"][end] - 6.0).max() < 0.05


def test_lqg_takes_over_smoothly_from_a_model_without_angle_noise() -> None:
    # A fit may find an angle noise of thousandths of a degree, and the search may then turn to a
    # filter that differentiates the angle: a large weight of the gyro's noise.
    lag, sea = Lag(0.3 + SAMPLING_S), noise.from_model(DEFAULT_DISTURBANCE)._replace(angle_rad=1e-6)
    yaw, pitch = yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED)
    without_gyro = weights.HEADING_STARTS[0]._replace(gyro=30.0)
    heading = synthesis.controller(yaw, lag, sea, without_gyro)
    depth = synthesis.controller(pitch, lag, sea, weights.DEPTH_STARTS[0])
    controllers = LqgControllers(
        CRUISE_SPEED_MPS,
        tick_controllers(heading, yaw),
        tick_controllers(depth, pitch),
        synthesis.pitch_per_metre(depth),
    )
    items = leg(depth_m=3.0, heading_deg=20.0, duration_s=80.0)
    dive = Dive(items, sea="disturbed", values=VALUES, controllers=controllers)
    end = dive.during(50.0, 78.0)
    assert np.abs(np.degrees(dive["true_heading"][end]) - 20.0).max() < 3.0
