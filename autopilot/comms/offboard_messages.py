"""Set-points for OFFBOARD mode from SET_ATTITUDE_TARGET and SET_POSITION_TARGET_* messages.

A set-point that the vehicle cannot follow is ignored, and the reason is sent once. Frames and masks
are those that PX4 documents (docs.px4.io, "Offboard Mode"). An underwater vehicle with one
propeller can follow neither accelerations nor a sideways velocity.
"""

import cmath
import math
from typing import Any

from autopilot.control.requests import SetTarget
from autopilot.control.setpoints import AttitudeTarget, MotionTarget
from autopilot.control.types import ACCEPTED, AutopilotState, Home
from autopilot.vehicle import Vehicle
from mavlink_io.clock import wall_s
from mavlink_io.dialect import constant
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.frames import euler_from_quaternion, geodetic_to_offset
from mavlink_io.mission_items import FRAME_LOCAL_NED, GLOBAL_FRAMES, GLOBAL_SCALE
from mavlink_io.vehicle_modes import VehicleMode

ATTITUDE, LOCAL, GLOBAL = (
    "SET_ATTITUDE_TARGET",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
)
MESSAGE_IDS = ATTITUDE, LOCAL, GLOBAL

_NO_PITCH_RATE, _NO_YAW_RATE, _NO_THRUST, _NO_ATTITUDE = 0b10, 0b100, 0b100_0000, 0b1000_0000
"""Bits of ATTITUDE_TARGET_TYPEMASK."""
_FIELDS = {"x": 1, "y": 2, "z": 4, "vx": 8, "vy": 16, "vz": 32, "yaw": 1024, "yaw_rate": 2048}
"""Bits of POSITION_TARGET_TYPEMASK: a set bit means that the field is ignored."""
_BODY = frozenset(
    map(constant, ("MAV_FRAME_BODY_NED", "MAV_FRAME_BODY_FRD", "MAV_FRAME_BODY_OFFSET_NED"))
)
_BODY_OFFSET = constant("MAV_FRAME_BODY_OFFSET_NED")
_LOCAL_OFFSET = constant("MAV_FRAME_LOCAL_OFFSET_NED")


class TargetError(InputError):
    """A set-point that the vehicle cannot follow; the message is the reason."""

    code = ErrorCode.SETPOINT


class SetpointReceiver:
    """Passes set-points to the vehicle and measures the time since the last one of each kind."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._received_s: dict[type, float] = {}
        self._last_error = ""

    def handle(self, name: str, message: Any) -> bool:
        """Apply a set-point message that is addressed to this vehicle; return False if ignored."""
        try:
            target = read(name, message, self._vehicle.state)
        except TargetError as error:
            self._report(f"Set-point ignored: {error}")
            return False
        self._received_s[type(target)] = wall_s()
        answer = self._vehicle.handle_request(SetTarget(target), quiet=True)
        if answer.text:
            self._report(answer.text)
        return answer.result == ACCEPTED

    def _report(self, text: str) -> None:
        """Send why a set-point is not followed, once for a stream."""
        if text != self._last_error:
            self._last_error = text
            self._vehicle.send_statustext(text)

    @property
    def silent_s(self) -> tuple[float | None, float | None]:
        """Wall seconds since the last attitude and motion target; None before the first."""
        if not self._received_s:
            return None, None
        attitude_s, motion_s = (
            self._received_s.get(AttitudeTarget),
            self._received_s.get(MotionTarget),
        )
        now_s = wall_s()
        return (
            None if attitude_s is None else now_s - attitude_s,
            None if motion_s is None else now_s - motion_s,
        )


def read(name: str, message: Any, state: AutopilotState) -> AttitudeTarget | MotionTarget:
    """Return the target in a decoded message. Raises TargetError."""
    if name == ATTITUDE:
        return attitude(message)
    fields = _used_fields(message, name)
    if name == GLOBAL:
        return _global(message, fields, state.home)
    frame = message.coordinate_frame
    if frame in _BODY:
        offsets_count = frame == _BODY_OFFSET or state.mode == VehicleMode.STATION.value
        if offsets_count and {"x", "y", "z"} & fields.keys():
            return _motion({}, *_offset(fields, state, state.estimate.heading_rad))
        return _body(fields)
    if frame == _LOCAL_OFFSET:
        return _motion(fields, *_offset(fields, state, 0.0))
    if frame != FRAME_LOCAL_NED:
        raise TargetError(
            f"frame {frame} of {name}; LOCAL_NED (1), LOCAL_OFFSET_NED (7), BODY_NED (8) and"
            " BODY_OFFSET_NED (9) are supported"
        )
    return _motion(fields, _pair(fields, "x", "y", name), fields.get("z"))


def attitude(message: Any) -> AttitudeTarget:
    """Return pitch and heading (rad) of the quaternion, or the rates (rad/s) where it is ignored.

    Roll is not used. Thrust is limited to -1..1.
    """
    mask = message.type_mask
    thrust = None if mask & _NO_THRUST else max(-1.0, min(1.0, _finite(message.thrust, "thrust")))
    if not mask & _NO_ATTITUDE:
        norm = math.sqrt(sum(_finite(part, "q") ** 2 for part in message.q))
        if not 0.5 < norm < 2.0:
            raise TargetError(f"q of {ATTITUDE} is no attitude: its length is {norm:g}, not 1")
        _, pitch, heading = euler_from_quaternion(*(part / norm for part in message.q))
        return AttitudeTarget(pitch, heading, thrust=thrust)
    pitch_rate = (
        0.0 if mask & _NO_PITCH_RATE else _finite(message.body_pitch_rate, "body_pitch_rate")
    )
    heading_rate = 0.0 if mask & _NO_YAW_RATE else _finite(message.body_yaw_rate, "body_yaw_rate")
    return AttitudeTarget(
        pitch_rate_radps=pitch_rate, heading_rate_radps=heading_rate, thrust=thrust
    )


def _used_fields(message: Any, name: str) -> dict[str, float]:
    """Return the fields by name that are neither masked nor NaN."""
    global_names = {"x": "lat_int", "y": "lon_int", "z": "alt"} if name == GLOBAL else {}
    fields = {
        field: float(getattr(message, global_names.get(field, field)))
        for field, ignore_bit in _FIELDS.items()
        if not message.type_mask & ignore_bit
    }
    fields = {field: value for field, value in fields.items() if not math.isnan(value)}
    if not fields:
        raise TargetError(
            f"{name} with type_mask {message.type_mask}: position, velocity, yaw or yaw rate"
            " is required"
        )
    return {field: _finite(value, field) for field, value in fields.items()}


def _global(message: Any, fields: dict[str, float], home: Home) -> MotionTarget:
    """Return the target of a SET_POSITION_TARGET_GLOBAL_INT, relative to home."""
    if message.coordinate_frame not in GLOBAL_FRAMES:
        raise TargetError(
            f"frame {message.coordinate_frame} of {GLOBAL}: altitude must be above home or MSL"
        )
    position, altitude_m = _pair(fields, "x", "y", GLOBAL), fields.get("z")
    if position is not None:
        if not home.known:
            raise TargetError(f"{GLOBAL}: home is not known yet")
        lat, lon = position.real / GLOBAL_SCALE, position.imag / GLOBAL_SCALE
        position = complex(*geodetic_to_offset(lat, lon, home.lat_deg, home.lon_deg))
    return _motion(fields, position, None if altitude_m is None else -altitude_m)


def _motion(
    fields: dict[str, float], position_m: complex | None, depth_m: float | None
) -> MotionTarget:
    """Return the target; with a position given, the velocity only sets the speed towards it."""
    velocity = _pair(fields, "vx", "vy", "velocity")
    speed_only = position_m is not None and velocity is not None
    return MotionTarget(
        position_m=position_m,
        depth_m=None if depth_m is None else max(0.0, depth_m),
        velocity_mps=None if speed_only else velocity,
        depth_rate_mps=fields.get("vz") if depth_m is None else None,
        speed_mps=abs(velocity) if speed_only and velocity else None,
        heading_rad=fields.get("yaw"),
        heading_rate_radps=fields.get("yaw_rate"),
    )


def _body(fields: dict[str, float]) -> MotionTarget:
    """Return the target of body-frame velocities: forward, down and yaw rate."""
    if {"x", "y", "z"} & fields.keys():
        raise TargetError(
            f"positions in body axes of {LOCAL}: only in mode STATION, else velocities"
        )
    if fields.get("vy", 0.0) != 0.0:
        raise TargetError(
            f"vy in body axes of {LOCAL}: must be 0 or ignored, the vehicle cannot move sideways"
        )
    rate = fields.get("yaw_rate", 0.0 if "yaw" not in fields else None)
    return MotionTarget(
        depth_rate_mps=fields.get("vz"),
        speed_mps=fields.get("vx"),
        heading_rad=fields.get("yaw"),
        heading_rate_radps=rate,
    )


def _offset(
    fields: dict[str, float], state: AutopilotState, heading_rad: float
) -> tuple[complex | None, float | None]:
    """Return position and depth at an offset from the vehicle, in axes with this heading.

    An offset of zero is None: the vehicle cannot stop, and keeps its course or its depth.
    """
    estimate, ahead_m = state.estimate, _pair(fields, "x", "y", LOCAL)
    here_m = complex(estimate.north_m, estimate.east_m)
    return (
        here_m + ahead_m * cmath.rect(1.0, heading_rad) if ahead_m else None,
        estimate.depth_m + fields["z"] if fields.get("z") else None,
    )


def _pair(fields: dict[str, float], first: str, second: str, name: str) -> complex | None:
    """Return two components as one complex number; both or neither must be given."""
    present = {first, second} & fields.keys()
    if len(present) == 1:
        raise TargetError(f"{name}: {first} and {second} must be given together")
    return complex(fields[first], fields[second]) if present else None


def _finite(value: float, name: str) -> float:
    """Return the value. Raises TargetError when it is not finite."""
    if not math.isfinite(value):
        raise TargetError(f"{name} is {value}")
    return value
