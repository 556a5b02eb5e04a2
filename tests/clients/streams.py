"""Every telemetry stream as a client receives it: rates, and values that must be consistent.

The vehicle should be in motion and submerged in the simulator, so that a wrong sign is detected.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from tests.clients.checklist import close, equal, require

Fields = Mapping[str, Any]
Latest = Mapping[str, Fields]
"""The latest fields of each message by name."""

SUBMARINE, GENERIC = 12, 0
ARMED_AND_CUSTOM = 129
LOOKING_DOWN = 25
NED, FRD = 1, 12
UNKNOWN_U16 = 65_535
WATER_DENSITY_KGPM3, GRAVITY_MPS2, SURFACE_HPA = 1025.0, 9.81, 1013.25
DEPTH_SLACK_M = 0.8
"""Maximum change of depth between two messages, some of which were lost, in m."""
HEALTHY_BITS = 0x1 | 0x2 | 0x4 | 0x8 | 0x20 | 1 << 20 | 1 << 28
"""Gyro, accelerometer, magnetometer, absolute pressure, GPS, geofence, pre-arm check."""


def heartbeat(m: Fields, latest: Latest) -> None:
    equal((m["type"], m["autopilot"]), (SUBMARINE, GENERIC), "type and autopilot")
    equal(m["base_mode"], ARMED_AND_CUSTOM, "base_mode")
    require(m["custom_mode"] >> 16, "custom_mode is not in PX4's numbering")


def system_status(m: Fields, latest: Latest) -> None:
    health = m["onboard_control_sensors_health"]
    equal(health & HEALTHY_BITS, HEALTHY_BITS, "health")
    equal(m["onboard_control_sensors_present"] & 0x2F, 0x2F, "present")
    require(0 < m["voltage_battery"] <= UNKNOWN_U16, "no voltage_battery")


def system_time(m: Fields, latest: Latest) -> None:
    close(
        m["time_boot_ms"],
        latest["ATTITUDE"]["time_boot_ms"],
        60_000,
        "time_boot_ms beside ATTITUDE's",
    )


def extended_state(m: Fields, latest: Latest) -> None:
    equal(m["landed_state"], 2, "landed_state under way")


def mission_current(m: Fields, latest: Latest) -> None:
    require(m["total"] > m["seq"] >= 0, f"item {m['seq']} of {m['total']}")
    equal(m["mission_mode"], 1, "mission_mode in MISSION")


def gps(m: Fields, latest: Latest) -> None:
    require(m["fix_type"] in (0, 1, 3), f"fix_type is {m['fix_type']}")


def current_mode(m: Fields, latest: Latest) -> None:
    equal(m["custom_mode"], latest["HEARTBEAT"]["custom_mode"], "custom_mode")
    equal(m["intended_custom_mode"], m["custom_mode"], "intended_custom_mode")


def battery(m: Fields, latest: Latest) -> None:
    require(m["voltages"][0] != UNKNOWN_U16, "the first cell is unknown")
    equal(m["voltages"][9], UNKNOWN_U16, "an unused cell")
    require(-1 <= m["battery_remaining"] <= 100, f"battery_remaining is {m['battery_remaining']}")


def home(m: Fields, latest: Latest) -> None:
    equal(m["altitude"], 0, "altitude")
    equal(list(m["q"]), [1.0, 0.0, 0.0, 0.0], "q")
    require(m["latitude"] and m["longitude"], "home lies nowhere")


def attitude(m: Fields, latest: Latest) -> None:
    require(
        abs(m["roll"]) < 1.0 and abs(m["pitch"]) < 1.0, f"rolls {m['roll']}, pitches {m['pitch']}"
    )
    require(-math.pi <= m["yaw"] <= math.pi, f"yaw is {m['yaw']}")


def quaternion(m: Fields, latest: Latest) -> None:
    q = [m[f"q{n}"] for n in (1, 2, 3, 4)]
    close(sum(x * x for x in q), 1.0, 1e-3, "norm of q")
    yaw = math.atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] ** 2 + q[3] ** 2))
    apart = (yaw - latest["ATTITUDE"]["yaw"] + math.pi) % (2 * math.pi) - math.pi
    close(apart, 0.0, 0.5, "yaw beside ATTITUDE's")


def global_position(m: Fields, latest: Latest) -> None:
    depth_m = latest["LOCAL_POSITION_NED"]["z"]
    equal(m["alt"], m["relative_alt"], "alt")
    close(m["relative_alt"] / 1000.0, -depth_m, DEPTH_SLACK_M, "relative_alt")
    require(0 <= m["hdg"] < 36_000, f"hdg is {m['hdg']}")
    require(m["lat"] and m["lon"], "position lies nowhere")


def local_position(m: Fields, latest: Latest) -> None:
    require(m["z"] > 1.0, f"z is {m['z']} under water, not down-positive")


def vfr_hud(m: Fields, latest: Latest) -> None:
    close(m["alt"], -latest["LOCAL_POSITION_NED"]["z"], DEPTH_SLACK_M, "alt")
    require(0 <= m["throttle"] <= 100, f"throttle is {m['throttle']}")
    require(m["airspeed"] > 0.2, f"airspeed is {m['airspeed']} under thrust")


def altitude(m: Fields, latest: Latest) -> None:
    depth_m = latest["LOCAL_POSITION_NED"]["z"]
    for field in ("altitude_amsl", "altitude_local", "altitude_relative"):
        close(m[field], -depth_m, DEPTH_SLACK_M, field)
    require(m["bottom_clearance"] == -1 or m["bottom_clearance"] > 0, "bottom_clearance")
    require(m["altitude_terrain"] < -1000, "altitude_terrain is not unknown")


def water_pressure(m: Fields, latest: Latest) -> None:
    depth_m = latest["LOCAL_POSITION_NED"]["z"]
    expected_hpa = SURFACE_HPA + WATER_DENSITY_KGPM3 * GRAVITY_MPS2 * depth_m / 100.0
    close(m["press_abs"], expected_hpa, 100.0 * DEPTH_SLACK_M + 30.0, "press_abs")


def distance(m: Fields, latest: Latest) -> None:
    equal(m["orientation"], LOOKING_DOWN, "orientation")
    require(m["min_distance"] < m["max_distance"], "min_distance is not below max_distance")


def navigation(m: Fields, latest: Latest) -> None:
    require(-180 <= m["target_bearing"] <= 360, f"target_bearing is {m['target_bearing']}")
    require(abs(m["alt_error"]) < 20.0, f"alt_error is {m['alt_error']}")


def attitude_target(m: Fields, latest: Latest) -> None:
    require(0.1 < m["thrust"] <= 1.0, f"thrust is {m['thrust']} under way")
    close(sum(x * x for x in m["q"]), 1.0, 1e-3, "norm of q")


def position_target(m: Fields, latest: Latest) -> None:
    require(m["z"] > 0.0, f"z is {m['z']}, not the depth that is wanted")
    equal(m["coordinate_frame"], NED, "coordinate_frame")


def servos(m: Fields, latest: Latest) -> None:
    pulses = [m[f"servo{n}_raw"] for n in (1, 2, 3)]
    require(all(1100 <= pulse <= 1900 for pulse in pulses), f"pulses are {pulses}")
    require(pulses[2] > 1500, f"thrust is {pulses[2]} us under way")


def actuators(m: Fields, latest: Latest) -> None:
    equal(m["active"], 0b111, "active")
    require(
        all(-1.0 <= a <= 1.0 for a in m["actuator"]) and m["actuator"][2] > 0.1,
        f"{m['actuator'][:3]}",
    )


def imu(m: Fields, latest: Latest) -> None:
    close(m["zacc"], -9.81, 3.0, "zacc")
    require(m["abs_pressure"] > 1000.0, f"abs_pressure is {m['abs_pressure']} hPa under water")


def odometry(m: Fields, latest: Latest) -> None:
    equal((m["frame_id"], m["child_frame_id"]), (NED, FRD), "frames")
    close(m["z"], latest["LOCAL_POSITION_NED"]["z"], DEPTH_SLACK_M, "z")


def estimator(m: Fields, latest: Latest) -> None:
    require(m["flags"] & 1, "attitude is not said to be good")
    require(0.0 < m["pos_horiz_accuracy"] < 1e4, f"pos_horiz_accuracy is {m['pos_horiz_accuracy']}")


def current(m: Fields, latest: Latest) -> None:
    require(
        math.hypot(m["wind_x"], m["wind_y"]) < 3.0, f"the current is {m['wind_x']}, {m['wind_y']}"
    )


def named_value(m: Fields, latest: Latest) -> None:
    require(0 < len(m["name"]) <= 10, f"name is {m['name']!r}")
    require(math.isfinite(m["value"]), f"value is {m['value']}")


def loops_inside(m: Fields, latest: Latest) -> None:
    require(0 < len(m["name"]) <= 10, f"name is {m['name']!r}")
    require(any(m["data"]), "all numbers are zero under way")


def inside_fence(m: Fields, latest: Latest) -> None:
    equal((m["breach_status"], m["breach_count"]), (0, 0), "breach_status and breach_count")


class Sense(NamedTuple):
    """One row: rate of a message, whether slow links have it, and a check of its values."""

    rate_hz: float
    """Rate in Hz; zero for a message that is sent on request only."""
    check: Callable[[Fields, Latest], None]
    on_request_when_slow: bool = False

    def must_be_requested(self, *, slow: bool) -> bool:
        return self.rate_hz == 0 or (slow and self.on_request_when_slow)


SENSES: dict[str, Sense] = {
    "HEARTBEAT": Sense(1, heartbeat),
    "SYS_STATUS": Sense(1, system_status),
    "SYSTEM_TIME": Sense(1, system_time),
    "EXTENDED_SYS_STATE": Sense(1, extended_state),
    "MISSION_CURRENT": Sense(1, mission_current),
    "GPS_RAW_INT": Sense(1, gps),
    "CURRENT_MODE": Sense(0.5, current_mode),
    "BATTERY_STATUS": Sense(0.5, battery),
    "HOME_POSITION": Sense(0.2, home),
    "ATTITUDE": Sense(10, attitude),
    "ATTITUDE_QUATERNION": Sense(10, quaternion),
    "GLOBAL_POSITION_INT": Sense(5, global_position),
    "LOCAL_POSITION_NED": Sense(5, local_position),
    "VFR_HUD": Sense(4, vfr_hud),
    "ALTITUDE": Sense(2, altitude),
    "SCALED_PRESSURE2": Sense(5, water_pressure),
    "DISTANCE_SENSOR": Sense(5, distance),
    "NAV_CONTROLLER_OUTPUT": Sense(2, navigation),
    "ATTITUDE_TARGET": Sense(4, attitude_target),
    "POSITION_TARGET_LOCAL_NED": Sense(2, position_target),
    "SERVO_OUTPUT_RAW": Sense(4, servos),
    "ACTUATOR_OUTPUT_STATUS": Sense(4, actuators, on_request_when_slow=True),
    "HIGHRES_IMU": Sense(10, imu, on_request_when_slow=True),
    "ODOMETRY": Sense(5, odometry, on_request_when_slow=True),
    "ESTIMATOR_STATUS": Sense(1, estimator),
    "WIND_COV": Sense(1, current),
    "FENCE_STATUS": Sense(0, inside_fence),
    "DEBUG_FLOAT_ARRAY": Sense(0, loops_inside),
    "NAMED_VALUE_FLOAT": Sense(0, named_value),
}
BY_THEMSELVES = {name for name, sense in SENSES.items() if sense.rate_hz}
SLOW_SHARE = 0.5
"""Share of each rate on a link of 57600 baud."""
MIN_COUNT = 5
"""Minimum number of expected messages; the loss of one among fewer looks like a wrong rate."""


def counting_s(*, slow: bool) -> float:
    """Return how long messages are counted, in s: twice the period of HOME_POSITION."""
    return 11.0 / (SLOW_SHARE if slow else 1.0)


def check_rate(name: str, count: int, span_s: float, *, slow: bool) -> None:
    """Check that a rate is between 60 and 130 % of the table's.

    A noisy line may lose more, and is never faster. A rate that makes fewer than `MIN_COUNT`
    messages is not checked, nor that of a message which was requested.
    """
    sense, received_hz = SENSES[name], count / span_s
    expected_hz = sense.rate_hz * (SLOW_SHARE if slow and name != "HEARTBEAT" else 1.0)
    if sense.must_be_requested(slow=slow) or expected_hz * span_s < MIN_COUNT:
        return
    least = 0.35 if slow else 0.6
    require(
        least * expected_hz <= received_hz <= 1.3 * max(expected_hz, sense.rate_hz),
        f"comes {received_hz:.2f} times a second, not {expected_hz:g}",
    )
