"""Autopilot parameters that describe the vehicle, each with its reason."""

import math

import numpy as np

from autopilot.control.sensor_health.monitor import ELEVATOR_UP
from sitl.vehicle import build_model, hull
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.linearise import linearise
from sitl.vehicle.model import VehicleModel
from sysid.design.constrained_search import within_range
from sysid.estimation.map import steady_state
from sysid.estimation.map.steady_state import SteadyTurn
from sysid.models import greybox
from sysid.planes import Plane

MIN_SURFACED_M, AFLOAT_M = 0.5, 0.2
"""Smallest depth above which the vehicle counts as surfaced (m), and its excess over the radius."""
STEP_MPS = 1e-4
"""Step (m/s) of the central difference in surge speed."""
MIN_STATION_M, STATION_TURNS = 20.0, 1.5
"""Smallest radius of the circle for station keeping (m), and its minimum in turning radii: rudder
is left for currents and trim."""
MIN_LOOK_AHEAD_M, LOOK_AHEAD_TURNS = 15.0, 2.5
"""Look-ahead distance of line-of-sight guidance: its smallest value (m), Caribou's, and its minimum
in turning radii. With a shorter one a vehicle crosses the line that it returns to."""
MIN_ACCEPTANCE_M = 5.0
"""Smallest radius within which a waypoint is reached (m), Caribou's."""
DIVE_TRANSITS, MIN_DIVE_S, MAX_DIVE_S = 1.1, 3.0, 60.0
"""Time FS_DIVE_S in which the elevator must end a descent, in hull lengths travelled, and its range
(s). The default of 3 s is 1.1 lengths of Caribou. A hull of 6 m at 0.9 m/s sank for 4.5 s at the
end of a change of depth until its elevator had raised the nose."""
NOSE_UP_RAD, MIN_ELEVATOR_LEFT = math.radians(15.0), 0.1
"""Change of pitch that ends a descent, and minimum elevator that is assumed for it (fraction of the
travel). Caribou makes this change in 3 s with half of its travel."""


def autopilot_parameters(
    config: VehicleConfig, model: VehicleModel
) -> dict[str, tuple[float, str]]:
    """Return value and reason of each parameter, by parameter name.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle file.
    model : VehicleModel
        Model built from it.

    Returns
    -------
    dict
        (value, reason); SPD_LENGTH_M = -2 U / (d u'/d u), limited to 1 to 500 m.
    """
    operating_point = config.operating_point
    length_m = -2.0 * operating_point.speed_mps / _surge_slope_per_s(config, model)
    turn = steady_state.steady_turn(config, model, math.radians(config.tailcone.travel_deg))
    turn_m = min(1000.0, turn.radius_m)
    of_some = _slow_response(config, model) | _turn_limit(turn)
    return of_some | {
        "ACT_TRAVEL_DEG": (config.tailcone.travel_deg, "travel of the tailcone"),
        "ACT_RATE_DEGPS": (
            within_range("ACT_RATE_DEGPS", config.tailcone.rate_degps),
            "rate limit of the tailcone",
        ),
        "THR_CRUISE_PCT": (100.0 * operating_point.thrust_fraction, "operating point"),
        "SPD_CRUISE_MPS": (operating_point.speed_mps, "operating point"),
        "GAIN_SPD_MPS": (
            within_range("GAIN_SPD_MPS", operating_point.speed_mps),
            "operating point: at a higher speed the loops keep their bandwidth",
        ),
        "SPD_LENGTH_M": (
            min(500.0, max(1.0, length_m)),
            "twice speed times the surge time constant",
        ),
        "TRIM_ELE_DEG": (
            math.degrees(steady_state.level_elevator_rad(config, model)),
            "elevator of level flight",
        ),
        "SURF_BUOY_N": (config.ballast.net_buoyancy_n, "net buoyancy of the vehicle file"),
        "SURF_DEPTH_M": (
            min(3.0, max(MIN_SURFACED_M, 0.5 * config.hull.diameter_m + AFLOAT_M)),
            "radius of the hull, which floats with its axis below the surface, and waves",
        ),
        "TURN_RADIUS_M": (turn_m, "steady turn of the vehicle file at full travel"),
        "STN_RADIUS_M": (
            min(1000.0, max(MIN_STATION_M, STATION_TURNS * turn_m)),
            "1.5 turning circles, at least 20 m",
        ),
        "NAV_LOS_M": (
            within_range("NAV_LOS_M", max(MIN_LOOK_AHEAD_M, LOOK_AHEAD_TURNS * turn_m)),
            "2.5 times the radius of the turning circle, at least 15 m",
        ),
        "NAV_ACC_RAD_M": (
            within_range("NAV_ACC_RAD_M", max(MIN_ACCEPTANCE_M, turn_m)),
            "radius of the turning circle, so that a turn begins before its corner; at least 5 m",
        ),
        "EST_DENSITY": (config.water.density_kgpm3, "water of the vehicle file"),
    }


def values(config: VehicleConfig) -> dict[str, float]:
    """Return the values of `autopilot_parameters`.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle file.

    Returns
    -------
    dict
        Value by parameter name.
    """
    described = autopilot_parameters(config, build_model.build(config))
    return {name: value for name, (value, _) in described.items()}


def _turn_limit(turn: SteadyTurn) -> dict[str, tuple[float, str]]:
    """Return value and reason of SID_RATE_MAX, if the vehicle can turn on against its rudder."""
    if math.isinf(turn.controlled_radps):
        return {}
    limit_degps = within_range("SID_RATE_MAX", math.degrees(turn.controlled_radps))
    return {"SID_RATE_MAX": (limit_degps, "half of the yaw rate that the rudder can still end")}


def _slow_response(config: VehicleConfig, model: VehicleModel) -> dict[str, tuple[float, str]]:
    """Return value and reason of FS_DIVE_S, if the vehicle is slower than its default allows.

    The check begins at an elevator of ELEVATOR_UP of the travel. With q' the acceleration by this
    elevator less that of level flight, the nose comes up by theta in sqrt(2 theta / q').
    """
    tail, cruise_mps = config.tailcone, config.operating_point.speed_mps
    transit_s = DIVE_TRANSITS * hull.length_m(config.hull) / cruise_mps
    travel_rad = math.radians(tail.travel_deg)
    left_rad = ELEVATOR_UP * travel_rad - abs(steady_state.level_elevator_rad(config, model))
    per_rad = abs(float(linearise(model, cruise_mps).pitch.B[1, 0]))
    acceleration = per_rad * max(left_rad, MIN_ELEVATOR_LEFT * travel_rad)
    turn_s = math.sqrt(2.0 * NOSE_UP_RAD / acceleration) if acceleration else MAX_DIVE_S
    seconds = max(transit_s, turn_s)
    if seconds <= MIN_DIVE_S + 0.05:
        return {}
    reason = (
        f"time for {DIVE_TRANSITS:g} lengths of the hull"
        if seconds == transit_s
        else f"time in which the elevator raises the nose by {math.degrees(NOSE_UP_RAD):.0f} deg"
    )
    return {"FS_DIVE_S": (min(MAX_DIVE_S, round(seconds, 1)), reason)}


def _surge_slope_per_s(config: VehicleConfig, model: VehicleModel) -> float:
    """Return d(u')/du in straight flight: drag, and thrust lost with inflow."""
    operating_point = config.operating_point
    rps = operating_point.thrust_fraction * model.propeller.full_rps

    def surge(u_mps: float) -> float:
        """Return the surge acceleration at a speed (m/s^2)."""
        return float(
            greybox.accelerations(
                model, Plane.YAW, np.array([u_mps, 0.0, 0.0, 0.0, 0.0]), 0.0, rps
            )[0]
        )

    return (
        surge(operating_point.speed_mps + STEP_MPS) - surge(operating_point.speed_mps - STEP_MPS)
    ) / (2.0 * STEP_MPS)
