"""LQG controllers that need no search of weights."""

from autopilot.control.lqg import LqgControllers
from sysid.control_analysis.loop_transfer import SAMPLING_S, Lag
from sysid.design.design_model import DEFAULT_DISTURBANCE
from sysid.design.lqg import synthesis, tick_controllers, weights
from sysid.models import noise
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.reproduction.paper_tables import CRUISE_SPEED_MPS, TABLE_1_ADJUSTED


def lqg_controllers() -> LqgControllers:
    """Return LQG controllers designed for the paper's adjusted model."""
    lag, sea = Lag(0.3 + SAMPLING_S), noise.from_model(DEFAULT_DISTURBANCE)
    yaw, pitch = yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED)
    heading = synthesis.controller(yaw, lag, sea, weights.HEADING_STARTS[0])
    depth = synthesis.controller(pitch, lag, sea, weights.DEPTH_STARTS[0])
    return LqgControllers(
        CRUISE_SPEED_MPS,
        tick_controllers(heading, yaw),
        tick_controllers(depth, pitch),
        synthesis.pitch_per_metre(depth),
    )
