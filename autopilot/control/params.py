"""Table of the parameters: the fields of ``Config`` with name, default, range, unit and text.

The tick reads the fields; ground stations see the names. All values travel as MAVLink REAL32.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, NamedTuple, cast, get_type_hints

from autopilot.control.lqg import LqgControllers
from autopilot.control.pid import Gains
from autopilot.control.reference_model import ActuatorLead, PeakFilter
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.real32 import as_real32

MIN_MAGNITUDE = 2.0**-126
"""Smallest magnitude of a value other than 0: the smallest normal REAL32 (IEEE 754). A design may
give a gain or a trim close to 0; a denormal number is a mistake of the sender."""
MIN_WHEN_ON = {
    "ACT_LEAD_W": 0.5,
    "DPT_REF_W": 0.01,
    "FS_ALT_M": 0.1,
    "FS_BATT_PCT": 0.1,
    "FS_BATT_V": 0.1,
    "FS_DIVE_S": 1.0,
    "FS_GCS_HOLD_S": 1.0,
    "FS_GCS_TIMEOUT": 0.1,
    "FS_TIME_S": 1.0,
    "GAIN_SPD_MPS": 0.1,
    "HDG_PEAK_W": 0.05,
    "HDG_REF_W": 0.01,
    "HLTH_DPT_S": 1.0,
    "HLTH_STUCK_S": 0.1,
    "NAV_LOS_I": 0.001,
    "PTCH_PEAK_W": 0.05,
    "THR_CRUISE_PCT": 1.0,
    "TRIM_AUTO_S": 1.0,
}
"""Minimum value, in its own unit, of a parameter for which 0 means off."""


LOCKED_WHILE_ARMED = frozenset(
    (
        "ACT_TRAVEL_DEG",
        "EST_DENSITY",
        "EST_SURF_HPA",
        "MAG_DECL_DEG",
        "MAV_SYS_ID",
        "MIS_SEQ0_HOME",
        "SURF_BUOY_N",
        "SURF_DEPTH_M",
        "SURF_DROP_EN",
        "SURF_FIX_S",
        "SURF_HOLD_S",
        "SURF_TIME_S",
    )
)
"""Parameters that do not change while the vehicle is armed.

A wrong one moves the measured depth or heading, turns the duct farther than it is built for, or
ends SURFACE under water."""


class Doc(NamedTuple):
    """Description of one parameter."""

    name: str
    minimum: float
    maximum: float
    unit: str
    doc: str


@dataclass(frozen=True, slots=True)
class Config:
    """All parameters in the units of the table, and values derived from them in SI units.

    The default gains are the initial column of the paper's Table 3.
    """

    system_id: Annotated[
        int,
        Doc(
            name="MAV_SYS_ID",
            minimum=1,
            maximum=255,
            unit="",
            doc="MAVLink system id; a change takes effect at the next start",
        ),
    ] = 1
    forwards: Annotated[
        int,
        Doc(
            name="MAV_FORWARD",
            minimum=0,
            maximum=1,
            unit="",
            doc="1: forward messages between ground links",
        ),
    ] = 1

    heading_p: Annotated[
        float,
        Doc(name="HDG_P", minimum=0, maximum=5, unit="rad/rad", doc="Rudder per heading error"),
    ] = 0.65
    heading_d: Annotated[
        float, Doc(name="HDG_D", minimum=0, maximum=10, unit="s", doc="Rudder per yaw rate")
    ] = 1.5
    heading_i: Annotated[
        float,
        Doc(name="HDG_I", minimum=0, maximum=1, unit="1/s", doc="Rudder rate per heading error"),
    ] = 0.001
    heading_i_max: Annotated[
        float,
        Doc(
            name="HDG_IMAX",
            minimum=0,
            maximum=0.26,
            unit="rad",
            doc="Limit of the heading integrator",
        ),
    ] = 0.01
    heading_i_rate_degps: Annotated[
        float,
        Doc(
            name="HDG_I_RATE",
            minimum=0,
            maximum=90,
            unit="deg/s",
            doc="Yaw rate above which the heading integrator is frozen",
        ),
    ] = 2.0
    pitch_p: Annotated[
        float,
        Doc(name="PTCH_P", minimum=0, maximum=5, unit="rad/rad", doc="Elevator per pitch error"),
    ] = 0.8
    pitch_d: Annotated[
        float, Doc(name="PTCH_D", minimum=0, maximum=10, unit="s", doc="Elevator per pitch rate")
    ] = 1.9
    pitch_i: Annotated[
        float,
        Doc(name="PTCH_I", minimum=0, maximum=1, unit="1/s", doc="Elevator rate per pitch error"),
    ] = 0.0
    pitch_i_max: Annotated[
        float,
        Doc(
            name="PTCH_IMAX",
            minimum=0,
            maximum=0.26,
            unit="rad",
            doc="Limit of the pitch integrator",
        ),
    ] = 0.0
    depth_p: Annotated[
        float, Doc(name="DPT_P", minimum=0, maximum=2, unit="rad/m", doc="Pitch per depth error")
    ] = 0.13
    depth_d: Annotated[
        float, Doc(name="DPT_D", minimum=0, maximum=5, unit="rad s/m", doc="Pitch per depth rate")
    ] = 0.0
    depth_i: Annotated[
        float,
        Doc(name="DPT_I", minimum=0, maximum=1, unit="rad/(m s)", doc="Pitch rate per depth error"),
    ] = 0.001
    depth_i_max: Annotated[
        float,
        Doc(
            name="DPT_IMAX", minimum=0, maximum=0.5, unit="rad", doc="Limit of the depth integrator"
        ),
    ] = 0.004
    pitch_limit_deg: Annotated[
        float,
        Doc(
            name="PTCH_LIM_DEG",
            minimum=1,
            maximum=60,
            unit="deg",
            doc="Maximum pitch set-point of the depth loop",
        ),
    ] = 20.0

    lqg_enabled: Annotated[
        int,
        Doc(
            name="LQG_ENABLE",
            minimum=0,
            maximum=1,
            unit="",
            doc="1: LQG controllers loaded at the start replace the PIDs",
        ),
    ] = 1
    lqg_controllers: LqgControllers | None = None
    """Controllers from a file at the start, None without; not a parameter of a ground station."""

    heading_ref_radps: Annotated[
        float,
        Doc(
            name="HDG_REF_W",
            minimum=0,
            maximum=5,
            unit="rad/s",
            doc="Bandwidth of the heading reference model; 0 off",
        ),
    ] = 0.0
    heading_ref_degps: Annotated[
        float,
        Doc(
            name="HDG_REF_RATE",
            minimum=0.1,
            maximum=90,
            unit="deg/s",
            doc="Maximum yaw rate of the heading reference model",
        ),
    ] = 6.0
    depth_ref_radps: Annotated[
        float,
        Doc(
            name="DPT_REF_W",
            minimum=0,
            maximum=5,
            unit="rad/s",
            doc="Bandwidth of the depth reference model; 0 off",
        ),
    ] = 0.0
    depth_ref_mps: Annotated[
        float,
        Doc(
            name="DPT_REF_RATE",
            minimum=0.01,
            maximum=5,
            unit="m/s",
            doc="Maximum depth rate of the depth reference model",
        ),
    ] = 0.3
    depth_ref_lead_s: Annotated[
        float,
        Doc(
            name="DPT_REF_LEAD",
            minimum=0,
            maximum=10,
            unit="s",
            doc="Time by which the pitch leads the depth rate of the reference model",
        ),
    ] = 0.0
    heading_setpoint_weight: Annotated[
        float,
        Doc(
            name="HDG_SPW",
            minimum=0,
            maximum=1,
            unit="",
            doc="Set-point weight of HDG_P, used without a reference model; 1 off",
        ),
    ] = 1.0
    depth_setpoint_weight: Annotated[
        float,
        Doc(
            name="DPT_SPW",
            minimum=0,
            maximum=1,
            unit="",
            doc="Set-point weight of DPT_P, used without a reference model; 1 off",
        ),
    ] = 1.0
    pitch_feedforward: Annotated[
        float,
        Doc(
            name="PTCH_FF",
            minimum=0,
            maximum=5,
            unit="rad/rad",
            doc="Elevator per pitch of the depth reference, at cruise speed; 0 off",
        ),
    ] = 0.0
    schedule_mps: Annotated[
        float,
        Doc(
            name="GAIN_SPD_MPS",
            minimum=0,
            maximum=5,
            unit="m/s",
            doc="Speed that the gains were designed for; 0: no gain scheduling",
        ),
    ] = 0.0
    roll_compensated: Annotated[
        int,
        Doc(
            name="ROLL_COMP",
            minimum=0,
            maximum=1,
            unit="",
            doc="1: rotate rudder and elevator commands by the roll angle",
        ),
    ] = 0

    rudder_trim_deg: Annotated[
        float,
        Doc(
            name="TRIM_RUD_DEG",
            minimum=-15,
            maximum=15,
            unit="deg",
            doc="Rudder that holds a straight course",
        ),
    ] = 0.0
    elevator_trim_deg: Annotated[
        float,
        Doc(
            name="TRIM_ELE_DEG",
            minimum=-15,
            maximum=15,
            unit="deg",
            doc="Elevator that holds a level run",
        ),
    ] = 0.0
    level_pitch_deg: Annotated[
        float,
        Doc(
            name="TRIM_PIT_DEG",
            minimum=-15,
            maximum=15,
            unit="deg",
            doc="Pitch of a level run at cruise speed, nose up positive",
        ),
    ] = 0.0
    travel_deg: Annotated[
        float,
        Doc(
            name="ACT_TRAVEL_DEG",
            minimum=1,
            maximum=45,
            unit="deg",
            doc="Maximum duct angle, at command 1",
        ),
    ] = 15.0
    trim_time_s: Annotated[
        float,
        Doc(
            name="TRIM_AUTO_S",
            minimum=0,
            maximum=600,
            unit="s",
            doc="Time constant of trim learning in steady flight; 0 off",
        ),
    ] = 0.0
    lag_radps: Annotated[
        float,
        Doc(
            name="ACT_LAG_W",
            minimum=0.5,
            maximum=100,
            unit="rad/s",
            doc="Natural frequency of the tailcone",
        ),
    ] = 3.0
    lag_damping: Annotated[
        float,
        Doc(name="ACT_LAG_Z", minimum=0.1, maximum=2, unit="", doc="Damping ratio of the tailcone"),
    ] = 0.6
    actuator_lead_radps: Annotated[
        float,
        Doc(
            name="ACT_LEAD_W",
            minimum=0,
            maximum=100,
            unit="rad/s",
            doc="Natural frequency of the tailcone with lead compensation; 0 off",
        ),
    ] = 0.0
    actuator_lead_damping: Annotated[
        float,
        Doc(
            name="ACT_LEAD_Z",
            minimum=0.1,
            maximum=2,
            unit="",
            doc="Damping ratio of the tailcone with lead compensation",
        ),
    ] = 0.7
    rate_degps: Annotated[
        float,
        Doc(
            name="ACT_RATE_DEGPS",
            minimum=1,
            maximum=360,
            unit="deg/s",
            doc="Rate limit of the tailcone",
        ),
    ] = 15.0
    heading_peak_radps: Annotated[
        float,
        Doc(
            name="HDG_PEAK_W",
            minimum=0,
            maximum=20,
            unit="rad/s",
            doc="Frequency of the rudder's peak filter; 0 off",
        ),
    ] = 0.0
    heading_peak_damping: Annotated[
        float,
        Doc(
            name="HDG_PEAK_Z",
            minimum=0.05,
            maximum=2,
            unit="",
            doc="Damping ratio of the rudder's peak filter",
        ),
    ] = 0.5
    heading_peak_gain: Annotated[
        float,
        Doc(
            name="HDG_PEAK_GAIN",
            minimum=0.1,
            maximum=10,
            unit="",
            doc="Gain of the rudder's peak filter at its frequency; 1 far from it",
        ),
    ] = 1.0
    pitch_peak_radps: Annotated[
        float,
        Doc(
            name="PTCH_PEAK_W",
            minimum=0,
            maximum=20,
            unit="rad/s",
            doc="Frequency of the elevator's peak filter; 0 off",
        ),
    ] = 0.0
    pitch_peak_damping: Annotated[
        float,
        Doc(
            name="PTCH_PEAK_Z",
            minimum=0.05,
            maximum=2,
            unit="",
            doc="Damping ratio of the elevator's peak filter",
        ),
    ] = 0.5
    pitch_peak_gain: Annotated[
        float,
        Doc(
            name="PTCH_PEAK_GAIN",
            minimum=0.1,
            maximum=10,
            unit="",
            doc="Gain of the elevator's peak filter at its frequency; 1 far from it",
        ),
    ] = 1.0
    cruise_thrust_pct: Annotated[
        float,
        Doc(
            name="THR_CRUISE_PCT",
            minimum=0,
            maximum=100,
            unit="%",
            doc="Cruise thrust: default of missions and modes",
        ),
    ] = 58.0
    cruise_speed_mps: Annotated[
        float,
        Doc(
            name="SPD_CRUISE_MPS", minimum=0.1, maximum=5, unit="m/s", doc="Speed at cruise thrust"
        ),
    ] = 1.3
    speed_length_m: Annotated[
        float,
        Doc(
            name="SPD_LENGTH_M",
            minimum=1,
            maximum=500,
            unit="m",
            doc="Distance in which speed follows thrust",
        ),
    ] = 12.0

    declination_deg: Annotated[
        float,
        Doc(
            name="MAG_DECL_DEG",
            minimum=-180,
            maximum=180,
            unit="deg",
            doc="Magnetic declination, east positive",
        ),
    ] = -14.4
    attitude_gain: Annotated[
        float,
        Doc(
            name="EST_ATT_GAIN",
            minimum=0,
            maximum=5,
            unit="1/s",
            doc="Gain of the accelerometer in the attitude estimate",
        ),
    ] = 0.15
    heading_gain: Annotated[
        float,
        Doc(
            name="EST_HDG_GAIN",
            minimum=0,
            maximum=5,
            unit="1/s",
            doc="Gain of the magnetometer in the heading estimate",
        ),
    ] = 0.15
    bias_gain: Annotated[
        float,
        Doc(
            name="EST_BIAS_GAIN",
            minimum=0,
            maximum=1,
            unit="1/s2",
            doc="Gain of the gyro bias estimate",
        ),
    ] = 0.005
    depth_time_s: Annotated[
        float,
        Doc(
            name="EST_DPT_TIME",
            minimum=0.05,
            maximum=10,
            unit="s",
            doc="Time constant of the depth estimate",
        ),
    ] = 0.7
    surface_pressure_hpa: Annotated[
        float,
        Doc(
            name="EST_SURF_HPA",
            minimum=800,
            maximum=1100,
            unit="hPa",
            doc="Air pressure at the surface",
        ),
    ] = 1013.25
    water_density_kgpm3: Annotated[
        float,
        Doc(
            name="EST_DENSITY", minimum=950, maximum=1100, unit="kg/m3", doc="Density of the water"
        ),
    ] = 1025.0

    current_sd_mps: Annotated[
        float,
        Doc(
            name="NAV_CUR_SD",
            minimum=0,
            maximum=3,
            unit="m/s",
            doc="Standard deviation of the current before a measurement",
        ),
    ] = 0.2
    current_walk_mps: Annotated[
        float,
        Doc(
            name="NAV_CUR_WALK",
            minimum=0,
            maximum=1,
            unit="m/s",
            doc="Standard deviation of the current's change in a minute",
        ),
    ] = 0.05
    speed_error_pct: Annotated[
        float,
        Doc(
            name="NAV_SPD_PCT",
            minimum=0,
            maximum=50,
            unit="%",
            doc="Standard deviation of the speed derived from thrust",
        ),
    ] = 5.0
    log_error_pct: Annotated[
        float,
        Doc(
            name="NAV_DVL_PCT",
            minimum=0,
            maximum=10,
            unit="%",
            doc="Standard deviation of Doppler log and heading",
        ),
    ] = 0.6

    lookahead_m: Annotated[
        float,
        Doc(
            name="NAV_LOS_M",
            minimum=1,
            maximum=500,
            unit="m",
            doc="Look-ahead distance of line-of-sight guidance",
        ),
    ] = 15.0
    los_integral_mps: Annotated[
        float,
        Doc(
            name="NAV_LOS_I",
            minimum=0,
            maximum=10,
            unit="m/s",
            doc="Integral gain of line-of-sight guidance; 0 off",
        ),
    ] = 0.3
    acceptance_m: Annotated[
        float,
        Doc(
            name="NAV_ACC_RAD_M",
            minimum=0.5,
            maximum=500,
            unit="m",
            doc="Radius within which a waypoint is reached",
        ),
    ] = 5.0
    station_radius_m: Annotated[
        float,
        Doc(
            name="STN_RADIUS_M",
            minimum=5,
            maximum=1000,
            unit="m",
            doc="Radius of the circle for station keeping",
        ),
    ] = 20.0
    turn_radius_m: Annotated[
        float,
        Doc(
            name="TURN_RADIUS_M",
            minimum=0,
            maximum=1000,
            unit="m",
            doc="Smallest circle that may be asked for: the turning circle at full travel; 0: any",
        ),
    ] = 6.0
    rtl_depth_m: Annotated[
        float,
        Doc(
            name="RTL_DEPTH_M",
            minimum=0,
            maximum=6000,
            unit="m",
            doc="Depth of the return to home in RTL",
        ),
    ] = 2.0
    rtl_radius_m: Annotated[
        float,
        Doc(
            name="RTL_RADIUS_M",
            minimum=1,
            maximum=1000,
            unit="m",
            doc="Distance from home at which RTL surfaces",
        ),
    ] = 10.0
    offboard_timeout_s: Annotated[
        float,
        Doc(
            name="OFB_TIMEOUT_S",
            minimum=0.1,
            maximum=60,
            unit="s",
            doc="Wall time without a set-point after which OFFBOARD ends",
        ),
    ] = 1.0
    stick_rate_degps: Annotated[
        float,
        Doc(
            name="STB_RATE_DEGPS",
            minimum=0.5,
            maximum=30,
            unit="deg/s",
            doc="Yaw rate at full stick in STABILIZE",
        ),
    ] = 8.0

    surfaced_depth_m: Annotated[
        float,
        Doc(
            name="SURF_DEPTH_M",
            minimum=0.1,
            maximum=3,
            unit="m",
            doc="Depth above which the vehicle counts as surfaced",
        ),
    ] = 0.5
    surface_rise_s: Annotated[
        float,
        Doc(
            name="SURF_RISE_S",
            minimum=0,
            maximum=600,
            unit="s",
            doc="Time without a rise after which SURFACE stops the propeller; 0 off",
        ),
    ] = 20.0
    surface_time_s: Annotated[
        float,
        Doc(
            name="SURF_TIME_S",
            minimum=0,
            maximum=86_400,
            unit="s",
            doc="Time without a rise after which SURFACE ends; 0 never",
        ),
    ] = 300.0
    surface_fix_s: Annotated[
        float,
        Doc(
            name="SURF_FIX_S",
            minimum=0,
            maximum=600,
            unit="s",
            doc="Duration of a satellite fix that ends SURFACE at any depth; 0 off",
        ),
    ] = 5.0
    surface_astern_s: Annotated[
        float,
        Doc(
            name="SURF_ASTERN_S",
            minimum=0,
            maximum=120,
            unit="s",
            doc="Longest time astern of a vehicle that sinks in SURFACE; 0 off",
        ),
    ] = 20.0
    surface_hold_s: Annotated[
        float,
        Doc(
            name="SURF_HOLD_S",
            minimum=0,
            maximum=60,
            unit="s",
            doc="Time for which the depth must stay at the surface before SURFACE ends",
        ),
    ] = 3.0
    weight_fitted: Annotated[
        int,
        Doc(
            name="SURF_DROP_EN",
            minimum=0,
            maximum=1,
            unit="",
            doc="1: a drop weight is fitted at output 4; SURFACE releases it as a last resort",
        ),
    ] = 0
    weight_time_s: Annotated[
        float,
        Doc(
            name="SURF_DROP_S",
            minimum=1,
            maximum=3600,
            unit="s",
            doc="Time without power and without a rise after which the weight is released",
        ),
    ] = 30.0
    buoyancy_n: Annotated[
        float,
        Doc(
            name="SURF_BUOY_N",
            minimum=-10_000,
            maximum=10_000,
            unit="N",
            doc="Net buoyancy; above 0 the vehicle floats up by itself",
        ),
    ] = 22.24
    mission_end: Annotated[
        int,
        Doc(
            name="MIS_END_ACT",
            minimum=0,
            maximum=2,
            unit="",
            doc="After a mission: 0 HOLD, 1 SURFACE, 2 disarm",
        ),
    ] = 1
    mission_seq0_home: Annotated[
        int,
        Doc(
            name="MIS_SEQ0_HOME",
            minimum=0,
            maximum=1,
            unit="",
            doc="1: mission item 0 is home and is skipped",
        ),
    ] = 0
    mission_distance_m: Annotated[
        float,
        Doc(
            name="MIS_DIST_MAX",
            minimum=0,
            maximum=100_000,
            unit="m",
            doc="Maximum distance of mission waypoints from home; 0: no limit",
        ),
    ] = 10_000.0
    """The default is the distance at cruise speed (1.3 m/s) in FS_TIME_S (7200 s), rounded up."""
    battery_cruise_h: Annotated[
        float,
        Doc(
            name="BAT_CRUISE_H",
            minimum=0,
            maximum=1000,
            unit="h",
            doc="Time at cruise speed on a full battery, for the check of missions; 0: no check",
        ),
    ] = 10.0
    """The default is 1500 Wh over 60 W of instruments and 86 W of the drive, rounded down."""

    fence_action: Annotated[
        int,
        Doc(
            name="FENCE_ACTION",
            minimum=0,
            maximum=2,
            unit="",
            doc="Geofence reached: 0 report only, 1 SURFACE, 2 RTL (nearest rally point, or home)",
        ),
    ] = 1
    fence_min_m: Annotated[
        float,
        Doc(
            name="FENCE_DPT_MIN",
            minimum=0,
            maximum=6000,
            unit="m",
            doc="Minimum depth of mission items; 0: no limit",
        ),
    ] = 0.0
    fence_max_m: Annotated[
        float,
        Doc(
            name="FENCE_DPT_MAX",
            minimum=0,
            maximum=6000,
            unit="m",
            doc="Maximum depth of mission items and in flight; 0: that of FS_DEPTH_M",
        ),
    ] = 0.0

    fs_depth_m: Annotated[
        float,
        Doc(
            name="FS_DEPTH_M",
            minimum=1,
            maximum=6000,
            unit="m",
            doc="Maximum depth; below it the failsafe surfaces",
        ),
    ] = 18.0
    fs_altitude_m: Annotated[
        float,
        Doc(
            name="FS_ALT_M",
            minimum=0,
            maximum=100,
            unit="m",
            doc="Minimum altitude; below it the failsafe surfaces; 0 off",
        ),
    ] = 1.0
    fs_look_s: Annotated[
        float,
        Doc(
            name="FS_LOOK_S",
            minimum=0,
            maximum=60,
            unit="s",
            doc="Time that a recovery takes: depth and altitude limits apply to the depth after it",
        ),
    ] = 4.0
    fs_dive_s: Annotated[
        float,
        Doc(
            name="FS_DIVE_S",
            minimum=0,
            maximum=60,
            unit="s",
            doc="Time of sinking against the elevator after which the failsafe surfaces; 0 off",
        ),
    ] = 3.0
    fs_pitch_deg: Annotated[
        float,
        Doc(
            name="FS_PITCH_DEG",
            minimum=10,
            maximum=90,
            unit="deg",
            doc="Maximum pitch; above it the failsafe surfaces",
        ),
    ] = 75.0
    fs_time_s: Annotated[
        float,
        Doc(
            name="FS_TIME_S",
            minimum=0,
            maximum=864_000,
            unit="s",
            doc="Maximum armed time; after it the failsafe surfaces; 0 off",
        ),
    ] = 7200.0
    fs_ground_s: Annotated[
        float,
        Doc(
            name="FS_GCS_TIMEOUT",
            minimum=0,
            maximum=86_400,
            unit="s",
            doc="Wall time without a ground station before FS_GCS_ACT; 0 off",
        ),
    ] = 0.0
    fs_ground_action: Annotated[
        int,
        Doc(
            name="FS_GCS_ACT",
            minimum=0,
            maximum=2,
            unit="",
            doc="Ground station lost: 0 HOLD, 1 SURFACE, 2 RTL",
        ),
    ] = 1
    fs_ground_hold_s: Annotated[
        float,
        Doc(
            name="FS_GCS_HOLD_S",
            minimum=0,
            maximum=86_400,
            unit="s",
            doc="Time in the HOLD of FS_GCS_ACT 0 without a request; after it SURFACE; 0 off",
        ),
    ] = 300.0
    fs_leak_action: Annotated[
        int,
        Doc(
            name="FS_LEAK_ACT", minimum=0, maximum=1, unit="", doc="Leak: 0 report only, 1 surface"
        ),
    ] = 1
    fs_battery_action: Annotated[
        int,
        Doc(
            name="FS_BATT_ACT",
            minimum=0,
            maximum=1,
            unit="",
            doc="Battery low: 0 report only, 1 surface",
        ),
    ] = 1
    fs_battery_pct: Annotated[
        float,
        Doc(
            name="FS_BATT_PCT",
            minimum=0,
            maximum=100,
            unit="%",
            doc="Charge below which the battery is low; 0 off",
        ),
    ] = 15.0
    fs_battery_v: Annotated[
        float,
        Doc(
            name="FS_BATT_V",
            minimum=0,
            maximum=1000,
            unit="V",
            doc="Voltage below which the battery is low; 0 off",
        ),
    ] = 0.0
    fs_pressure_action: Annotated[
        int,
        Doc(
            name="FS_PRESS_ACT",
            minimum=0,
            maximum=1,
            unit="",
            doc="Depth unknown: 0 report only, 1 stop the propeller and float up",
        ),
    ] = 1
    fs_pressure_s: Annotated[
        float,
        Doc(
            name="FS_PRESS_S",
            minimum=0.5,
            maximum=600,
            unit="s",
            doc="Time without a depth measurement after which depth is unknown",
        ),
    ] = 5.0

    health_lost_s: Annotated[
        float,
        Doc(
            name="HLTH_LOST_S",
            minimum=0.05,
            maximum=60,
            unit="s",
            doc="Age above which an AHRS reading is lost",
        ),
    ] = 0.5
    health_stuck_s: Annotated[
        float,
        Doc(
            name="HLTH_STUCK_S",
            minimum=0,
            maximum=600,
            unit="s",
            doc="Time without a change after which an AHRS reading is stuck; 0 off",
        ),
    ] = 1.0
    health_duct_pct: Annotated[
        float,
        Doc(
            name="HLTH_DUCT_PCT",
            minimum=1,
            maximum=200,
            unit="%",
            doc="Duct feedback error, in percent of travel, that is a fault",
        ),
    ] = 60.0
    health_depth_s: Annotated[
        float,
        Doc(
            name="HLTH_DPT_S",
            minimum=0,
            maximum=600,
            unit="s",
            doc="Duration of a depth error that is reported; 0 off",
        ),
    ] = 30.0
    failure_enabled: Annotated[
        int,
        Doc(
            name="SYS_FAILURE_EN",
            minimum=0,
            maximum=1,
            unit="",
            doc="1: forward MAV_CMD_INJECT_FAILURE to the simulator",
        ),
    ] = 0

    log_enabled: Annotated[
        int,
        Doc(name="LOG_ENABLE", minimum=0, maximum=1, unit="", doc="1: record a log on the vehicle"),
    ] = 1
    log_disarmed: Annotated[
        int,
        Doc(name="LOG_DISARMED", minimum=0, maximum=1, unit="", doc="1: log also while disarmed"),
    ] = 0
    log_max_mb: Annotated[
        float,
        Doc(
            name="LOG_MAX_MB",
            minimum=1,
            maximum=1e6,
            unit="MB",
            doc="Maximum size of all logs; above it the oldest are deleted",
        ),
    ] = 4000.0
    log_free_mb: Annotated[
        float,
        Doc(
            name="LOG_FREE_MB",
            minimum=0,
            maximum=1e6,
            unit="MB",
            doc="Disk space that logs leave free",
        ),
    ] = 200.0

    sid_axis: Annotated[
        int,
        Doc(
            name="SID_AXIS",
            minimum=0,
            maximum=123,
            unit="",
            doc="Test axis: 0 none, 11 elevator, 12 rudder, 13 thrust, 23 both; +100: loop on",
        ),
    ] = 0
    sid_magnitude: Annotated[
        float,
        Doc(
            name="SID_MAGNITUDE",
            minimum=-100,
            maximum=100,
            unit="deg",
            doc="Amplitude of the test signal about trim; thrust in %",
        ),
    ] = 3.0
    sid_elevator_pct: Annotated[
        float,
        Doc(
            name="SID_ELE_PCT",
            minimum=1,
            maximum=100,
            unit="%",
            doc="Elevator amplitude relative to rudder if both are tested",
        ),
    ] = 50.0
    sid_start_hz: Annotated[
        float,
        Doc(
            name="SID_F_START_HZ",
            minimum=0.001,
            maximum=10,
            unit="Hz",
            doc="Start frequency of a chirp, lowest of a multisine",
        ),
    ] = 0.02
    sid_stop_hz: Annotated[
        float,
        Doc(
            name="SID_F_STOP_HZ",
            minimum=0.001,
            maximum=10,
            unit="Hz",
            doc="End frequency of a chirp, highest of a multisine, clock of a PRBS",
        ),
    ] = 0.5
    sid_fade_in_s: Annotated[
        float,
        Doc(
            name="SID_T_FADE_IN",
            minimum=0,
            maximum=20,
            unit="s",
            doc="Fade time at both ends of a test",
        ),
    ] = 0.0
    sid_record_s: Annotated[
        float, Doc(name="SID_T_REC", minimum=1, maximum=600, unit="s", doc="Duration of a test")
    ] = 20.0
    sid_wave: Annotated[
        int,
        Doc(
            name="SID_WAVE",
            minimum=0,
            maximum=6,
            unit="",
            doc="0 chirp, 1 step, 2 doublet, 3 PRBS, 4 multisine, 5 3211, 6 square",
        ),
    ] = 1
    sid_seed: Annotated[
        int, Doc(name="SID_SEED", minimum=0, maximum=16_777_215, unit="", doc="Seed of a PRBS")
    ] = 0
    sid_runs_1: Annotated[
        int,
        Doc(
            name="SID_RUNS_1",
            minimum=0,
            maximum=9_999_999,
            unit="",
            doc="Switch intervals of a square wave, one digit per interval",
        ),
    ] = 0
    sid_runs_2: Annotated[
        int,
        Doc(
            name="SID_RUNS_2",
            minimum=0,
            maximum=9_999_999,
            unit="",
            doc="Further switch intervals of a square wave, one digit each",
        ),
    ] = 0
    sid_depth_min_m: Annotated[
        float,
        Doc(
            name="SID_DEPTH_MIN",
            minimum=-10,
            maximum=100,
            unit="m",
            doc="Minimum depth of a test; -10 on the bench",
        ),
    ] = 1.0
    sid_depth_max_m: Annotated[
        float,
        Doc(name="SID_DEPTH_MAX", minimum=1, maximum=6000, unit="m", doc="Maximum depth of a test"),
    ] = 15.0
    sid_altitude_min_m: Annotated[
        float,
        Doc(name="SID_ALT_MIN", minimum=0, maximum=100, unit="m", doc="Minimum altitude of a test"),
    ] = 3.0
    sid_pitch_max_deg: Annotated[
        float,
        Doc(name="SID_PITCH_MAX", minimum=1, maximum=90, unit="deg", doc="Maximum pitch of a test"),
    ] = 35.0
    sid_heading_max_deg: Annotated[
        float,
        Doc(
            name="SID_HDG_MAX",
            minimum=1,
            maximum=180,
            unit="deg",
            doc="Maximum heading change in a test",
        ),
    ] = 180.0
    sid_rate_max_degps: Annotated[
        float,
        Doc(
            name="SID_RATE_MAX",
            minimum=1,
            maximum=360,
            unit="deg/s",
            doc="Maximum pitch or yaw rate in a test",
        ),
    ] = 60.0
    sid_time_max_s: Annotated[
        float,
        Doc(
            name="SID_TIME_MAX", minimum=1, maximum=600, unit="s", doc="Maximum duration of a test"
        ),
    ] = 120.0

    travel_rad: float = field(init=False)
    rudder_trim_rad: float = field(init=False)
    elevator_trim_rad: float = field(init=False)
    level_pitch_rad: float = field(init=False)
    declination_rad: float = field(init=False)
    pitch_limit_rad: float = field(init=False)
    fs_pitch_rad: float = field(init=False)
    heading_ref_rate_radps: float = field(init=False)
    servo: ActuatorLead = field(init=False)
    rudder_peak: PeakFilter = field(init=False)
    elevator_peak: PeakFilter = field(init=False)
    heading_gains: Gains = field(init=False)
    pitch_gains: Gains = field(init=False)
    depth_gains: Gains = field(init=False)

    def __post_init__(self) -> None:
        """Compute the derived values in SI units from the parameters."""
        hold_radps = math.radians(self.heading_i_rate_degps)
        for name, value in (
            ("travel_rad", math.radians(self.travel_deg)),
            ("rudder_trim_rad", math.radians(self.rudder_trim_deg)),
            ("elevator_trim_rad", math.radians(self.elevator_trim_deg)),
            ("level_pitch_rad", math.radians(self.level_pitch_deg)),
            ("declination_rad", math.radians(self.declination_deg)),
            ("pitch_limit_rad", math.radians(self.pitch_limit_deg)),
            ("fs_pitch_rad", math.radians(self.fs_pitch_deg)),
            ("heading_ref_rate_radps", math.radians(self.heading_ref_degps)),
            ("servo", self._servo()),
            (
                "rudder_peak",
                PeakFilter(
                    self.heading_peak_radps, self.heading_peak_damping, self.heading_peak_gain
                ),
            ),
            (
                "elevator_peak",
                PeakFilter(self.pitch_peak_radps, self.pitch_peak_damping, self.pitch_peak_gain),
            ),
            (
                "heading_gains",
                Gains(
                    p=self.heading_p,
                    d=self.heading_d,
                    i=self.heading_i,
                    i_max=self.heading_i_max,
                    i_rate=hold_radps,
                ),
            ),
            (
                "pitch_gains",
                Gains(p=self.pitch_p, d=self.pitch_d, i=self.pitch_i, i_max=self.pitch_i_max),
            ),
            (
                "depth_gains",
                Gains(p=self.depth_p, d=self.depth_d, i=self.depth_i, i_max=self.depth_i_max),
            ),
        ):
            object.__setattr__(self, name, value)

    def _servo(self) -> ActuatorLead:
        """Return the lag of the tailcone and its lead in SI units."""
        rate, travel = math.radians(self.rate_degps), math.radians(self.travel_deg)
        return ActuatorLead(
            lag_radps=self.lag_radps,
            lag_damping=self.lag_damping,
            lead_radps=self.actuator_lead_radps,
            lead_damping=self.actuator_lead_damping,
            rate_radps=rate,
            travel_rad=travel,
        )


_FLAT_FIELDS = [(column.name, Any) for column in fields(Config) if column.name != "lqg_controllers"]
_Flat = NamedTuple("_Flat", _FLAT_FIELDS)  # type: ignore[misc]


def flat(config: Config) -> Config:
    """Return the parameters as a flat record of numbers, which compiled code accepts.

    Parameters
    ----------
    config : Config
        Parameters.

    Returns
    -------
    Config
        A NamedTuple with the fields of ``Config``, without LQG controllers.
    """
    return cast(Config, _Flat(*[getattr(config, name) for name, _ in _FLAT_FIELDS]))


class ParamInfo(NamedTuple):
    """One row of the table as a ground station sees it."""

    name: str
    field: str
    default: float
    minimum: float
    maximum: float
    unit: str
    doc: str
    integer: bool

    @property
    def smallest(self) -> float:
        """Minimum magnitude of a value other than 0."""
        return 1.0 if self.integer else MIN_WHEN_ON.get(self.name, MIN_MAGNITUDE)

    def accepts(self, value: float) -> bool:
        """Return whether a value is a number in the range.

        A limit may be rounded to REAL32 by the transfer; integers are rounded later.

        Parameters
        ----------
        value : float
            Value in the parameter's unit.

        Returns
        -------
        bool
            False for NaN.
        """
        lower = min(self.minimum, as_real32(self.minimum))
        upper = max(self.maximum, as_real32(self.maximum))
        if not lower <= value <= upper:  # NaN is in no range
            return False
        smallest = min(self.smallest, as_real32(self.smallest))
        return self.integer or value == 0.0 or as_real32(abs(value)) >= smallest

    @property
    def range(self) -> str:
        """Accepted values as text."""
        if self.name in MIN_WHEN_ON:
            return f"0, or {self.smallest:g} to {self.maximum:g} {self.unit}".rstrip()
        return f"{self.minimum:g} to {self.maximum:g} {self.unit}".rstrip()


class ParamError(InputError):
    """A parameter does not exist or a value is out of range; the message gives the range."""

    code = ErrorCode.PARAMETER


def _table() -> tuple[ParamInfo, ...]:
    """Return the rows of the table from the annotations of ``Config``."""
    rows = []
    hints = get_type_hints(Config, include_extras=True)
    defaults = Config()
    for name in (
        column.name for column in fields(Config) if column.init and column.name != "lqg_controllers"
    ):
        doc: Doc = hints[name].__metadata__[0]
        integer = hints[name].__origin__ is int
        rows.append(
            ParamInfo(
                name=doc.name,
                field=name,
                default=getattr(defaults, name),
                minimum=doc.minimum,
                maximum=doc.maximum,
                unit=doc.unit,
                doc=doc.doc,
                integer=integer,
            )
        )
    return tuple(sorted(rows))


PARAMETERS = _table()
"""Every parameter, sorted by name."""

_BY_NAME = {parameter.name: parameter for parameter in PARAMETERS}


def validate(name: str, value: float) -> float:
    """Check a value of a parameter.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : float
        Value in the parameter's unit.

    Returns
    -------
    float
        The value as it is stored: integers are rounded.

    Raises
    ------
    ParamError
        The parameter does not exist, or the value is NaN or out of range.
    """
    row = _BY_NAME.get(name)
    if row is None:
        raise ParamError(f"parameter {name} does not exist")
    if not row.accepts(value):
        tiny = not row.integer and 0.0 < abs(value) < MIN_MAGNITUDE and name not in MIN_WHEN_ON
        hint = ", not a denormal number" if tiny else ""
        raise ParamError(f"{name} = {value:g}: must be {row.range}{hint}")
    return float(round(value)) if row.integer else value


def config(values: Mapping[str, float]) -> Config:
    """Return a configuration.

    Parameters
    ----------
    values : mapping of str to float
        Values by parameter name, which replace the defaults.

    Returns
    -------
    Config
        Values in the fields of the tick, with derived values in SI units.

    Raises
    ------
    ParamError
        A parameter does not exist, or a value is out of range.
    """
    changed = {}
    for name, value in values.items():
        stored = validate(name, value)
        row = _BY_NAME[name]
        changed[row.field] = int(stored) if row.integer else float(stored)
    return Config(**changed)  # type: ignore[arg-type]


class Rule(NamedTuple):
    """Two parameters of which the first must not be above the second."""

    lower: str
    upper: str
    off: bool = False
    """Whether 0 of either parameter turns the rule off."""
    strict: bool = False
    """Whether they must differ."""


RULES = (
    Rule("SID_DEPTH_MIN", "SID_DEPTH_MAX", strict=True),
    Rule("SURF_DEPTH_M", "FS_DEPTH_M", strict=True),
    Rule("RTL_DEPTH_M", "FS_DEPTH_M"),
    Rule("RTL_DEPTH_M", "FENCE_DPT_MAX", off=True),
    Rule("FENCE_DPT_MIN", "FENCE_DPT_MAX", off=True, strict=True),
    Rule("FENCE_DPT_MIN", "FS_DEPTH_M", strict=True),
    Rule("HLTH_LOST_S", "FS_PRESS_S"),
    Rule("SURF_HOLD_S", "SURF_TIME_S", off=True, strict=True),
    Rule("SURF_RISE_S", "SURF_TIME_S", off=True),
    Rule("SURF_ASTERN_S", "SURF_TIME_S", off=True),
    Rule("PTCH_LIM_DEG", "FS_PITCH_DEG", strict=True),
    Rule("TURN_RADIUS_M", "STN_RADIUS_M"),
)
"""Rules of consistency, checked at arming and not when a value is set: the order in
which a set of parameters is loaded has no effect."""


def find_conflict(config: Config) -> str:
    """Return the first rule that the parameters break; empty if there is none.

    Parameters
    ----------
    config : Config
        Parameters.

    Returns
    -------
    str
        Both names and values.
    """
    for rule in RULES:
        low, high = (float(getattr(config, _BY_NAME[name].field)) for name in rule[:2])
        if rule.off and not (low and high):
            continue
        if low > high or (rule.strict and low == high):
            word = "less than" if rule.strict else "at most"
            return f"{rule.lower} = {low:g}: must be {word} {rule.upper} = {high:g}"
    return ""


class ParamTable:
    """Current values of the parameters by name; ``config`` is their form for the tick."""

    def __init__(
        self,
        values: Mapping[str, float] | None = None,
        stored: Mapping[str, float] | None = None,
        lqg_controllers: LqgControllers | None = None,
    ) -> None:
        """Start with ``values`` by name; ``stored`` are the values saved on disk."""
        self.config = replace(config(values or {}), lqg_controllers=lqg_controllers)
        self.stored = dict(stored or {})
        self.revision = 0
        """Number of changes of ``stored``."""
        self.armed = False
        """Whether the parameters of ``LOCKED_WHILE_ARMED`` are locked."""

    def names(self) -> list[str]:
        """Return the names of all parameters."""
        return list(_BY_NAME)

    def get(self, name: str) -> float:
        """Return the current value. Raises ParamError if the parameter does not exist."""
        if name not in _BY_NAME:
            raise ParamError(f"parameter {name} does not exist")
        return float(getattr(self.config, _BY_NAME[name].field))

    def set(self, name: str, value: float) -> float:
        """Set a value and return it. Raises ParamError without any change.

        A fraction of an integer parameter, which a file may have, is refused.
        """
        stored_value = validate(name, value)
        row = _BY_NAME[name]
        if row.integer and stored_value != value:
            raise ParamError(f"{name} = {value:g}: must be a whole number, {row.range}")
        if self.armed and name in LOCKED_WHILE_ARMED and stored_value != self.get(name):
            raise ParamError(f"{name} = {value:g}: locked while armed; disarm first")
        self.config = replace(
            self.config,
            **{row.field: int(stored_value) if row.integer else stored_value},  # type: ignore[arg-type]
        )
        self.stored[name] = stored_value
        self.revision += 1
        return stored_value

    def reset(self) -> list[str]:
        """Set all defaults; return the names of the parameters that changed."""
        before, self.config = self.config, Config(lqg_controllers=self.config.lqg_controllers)
        self.stored, self.revision = {}, self.revision + 1
        return [row.name for row in PARAMETERS if getattr(before, row.field) != row.default]
