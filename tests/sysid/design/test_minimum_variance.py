"""Minimum-variance bound against other controllers and the limit of its definition."""

import msgspec
import pytest

from sysid.control_analysis.loop_transfer import Lag
from sysid.control_analysis.margins import Planes
from sysid.design import design_model, disturbance_response, lqg, minimum_variance
from sysid.design.design_model import DEFAULT_DISTURBANCE, DesignModel
from sysid.design.lqg import synthesis, weights
from sysid.design.specification import MinimumVariance, Response
from sysid.models import noise
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.models.model_file import NoiseModel
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_3_IMPROVED, TABLE_3_INITIAL

LAG = Lag(0.33)


def vehicle_with(lag: Lag, disturbance: NoiseModel = DEFAULT_DISTURBANCE) -> DesignModel:
    planes = Planes(yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED))
    return design_model.build(planes, lag, lag, dict.fromkeys(Plane, disturbance))


VEHICLE = vehicle_with(LAG)


def lqg_response() -> Response:
    """Response with LQG controllers; frequency integrals, independent of the bound."""
    heading, depth = (
        synthesis.controller(
            VEHICLE.planes[PLANES[plane].index], LAG, noise.from_model(DEFAULT_DISTURBANCE), start
        )
        for plane, start in (
            (Plane.YAW, weights.HEADING_STARTS[0]),
            (Plane.PITCH, weights.DEPTH_STARTS[0]),
        )
    )
    return lqg.predict_response(VEHICLE, heading, depth)


@pytest.mark.parametrize("controller", ["initial", "improved", "lqg"])
def test_no_controller_is_better_than_the_bound(controller: str) -> None:
    """Neither PID nor LQG, not even where the optimum may move the surfaces as much only."""
    gains = {"initial": TABLE_3_INITIAL, "improved": TABLE_3_IMPROVED}
    reached = (
        lqg_response()
        if controller == "lqg"
        else disturbance_response.predict_response(VEHICLE, gains[controller])
    )
    bound = minimum_variance.minimum_variance(VEHICLE, reached)
    assert bound is not None
    assert bound.heading_deg < bound.same_rudder_heading_deg < reached.heading_deg
    assert bound.depth_m < bound.same_elevator_depth_m < reached.depth_m
    assert bound.pitch_deg < reached.pitch_deg


def test_no_controller_is_better_than_the_bound_in_a_calm_sea() -> None:
    """Gyro noise causes most of the commands there."""
    calm = msgspec.structs.replace(
        DEFAULT_DISTURBANCE,
        slow_accel_degps2=0.05 * DEFAULT_DISTURBANCE.slow_accel_degps2,
        wave_accel_degps2=0.05 * DEFAULT_DISTURBANCE.wave_accel_degps2,
        rate_noise_degps=5.0 * DEFAULT_DISTURBANCE.rate_noise_degps,
    )
    vehicle = vehicle_with(LAG, calm)
    reached = disturbance_response.predict_response(vehicle, TABLE_3_IMPROVED)
    bound = minimum_variance.minimum_variance(vehicle, reached)
    assert bound is not None
    assert bound.heading_deg < bound.same_rudder_heading_deg < reached.heading_deg
    assert bound.depth_m < bound.same_elevator_depth_m < reached.depth_m
    assert bound.pitch_deg < reached.pitch_deg


def test_bound_is_that_of_the_predicted_disturbance() -> None:
    """The force that a fit allows for is in no prediction.

    In calm water it was most of the bound of the depth, which was twice the predicted error.
    """
    predicted = [
        minimum_variance.minimum_variance(
            vehicle_with(
                LAG, msgspec.structs.replace(DEFAULT_DISTURBANCE, force_noise_mps15=force)
            ),
            Response(0.4, 0.4, 0.03, 0.6, 0.6),
        )
        for force in (1e-4, 3e-3)
    ]
    assert predicted[0] == predicted[1] is not None


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
