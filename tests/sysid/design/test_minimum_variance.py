"""Minimum-variance bound against other controllers and the limit of its definition."""

import math

import pytest

from sysid.control_analysis.loop_transfer import Lag
from sysid.control_analysis.margins import Planes
from sysid.design import design_model, minimum_variance
from sysid.design.design_model import DEFAULT_DISTURBANCE, DesignModel
from sysid.design.lqg import loop_analysis, synthesis, weights
from sysid.design.specification import MinimumVariance, Response
from sysid.models import noise
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_3_IMPROVED, TABLE_3_INITIAL

LAG = Lag(0.33)


def vehicle_with(lag: Lag) -> DesignModel:
    planes = Planes(yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED))
    return design_model.build(
        planes, lag, lag, {Plane.YAW: DEFAULT_DISTURBANCE, Plane.PITCH: DEFAULT_DISTURBANCE}
    )


VEHICLE = vehicle_with(LAG)


def lqg_response() -> Response:
    """Response with LQG controllers; frequency integrals, independent of the bound."""
    answers = {}
    for plane, start in (
        (Plane.YAW, weights.HEADING_STARTS[0]),
        (Plane.PITCH, weights.DEPTH_STARTS[0]),
    ):
        controller = synthesis.controller(
            VEHICLE.planes[PLANES[plane].index], LAG, noise.from_model(DEFAULT_DISTURBANCE), start
        )
        measured = loop_analysis.measured_plane(VEHICLE, plane)
        answers[plane] = loop_analysis.disturbance_response(measured, controller)
    yaw, pitch = answers[Plane.YAW], answers[Plane.PITCH]
    return Response(
        heading_deg=math.degrees(yaw.outputs[1]),
        pitch_deg=math.degrees(pitch.outputs[1]),
        depth_m=float(pitch.outputs[2]),
        rudder_deg=math.degrees(yaw.command_rad),
        elevator_deg=math.degrees(pitch.command_rad),
    )


@pytest.mark.parametrize("controller", ["initial", "improved", "lqg"])
def test_no_controller_is_better_than_the_bound(controller: str) -> None:
    """Neither PID nor LQG, not even where the optimum may move the surfaces as much only."""
    gains = {"initial": TABLE_3_INITIAL, "improved": TABLE_3_IMPROVED}
    reached = (
        lqg_response()
        if controller == "lqg"
        else design_model.predict_response(VEHICLE, gains[controller])
    )
    bound = minimum_variance.minimum_variance(VEHICLE, reached)
    assert bound is not None
    assert bound.heading_deg < bound.same_rudder_heading_deg < reached.heading_deg
    assert bound.depth_m < bound.same_elevator_depth_m < reached.depth_m
    assert bound.pitch_deg < reached.pitch_deg


def test_bound_grows_with_the_delay() -> None:
    """A later command can compensate only what could be predicted earlier (Astrom 1970, ch. 6)."""

    def bound(delay_s: float) -> MinimumVariance:
        """Return the bound with a delay."""
        found = minimum_variance.minimum_variance(
            vehicle_with(Lag(delay_s)), Response(0.4, 0.4, 0.03, 0.6, 0.6)
        )
        assert found is not None
        return found

    early, late = bound(0.1), bound(0.6)
    assert early.heading_deg < 0.7 * late.heading_deg
    assert early.depth_m < 0.9 * late.depth_m
