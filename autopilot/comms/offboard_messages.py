"""Set-points that are streamed from outside: SET_ATTITUDE_TARGET and SET_POSITION_TARGET_* as
targets of OFFBOARD.

Whoever sends what cannot be followed is told why, once, and not obeyed. Frames and masks are those
that PX4 documents (docs.px4.io, "Offboard Mode"); an underwater vehicle of one propeller cannot
follow accelerations, nor move sideways."""

import math
from typing import Any

from autopilot.control.requests import SetTarget
from autopilot.control.setpoints import AttitudeTarget, MotionTarget
from autopilot.control.types import Home
from autopilot.vehicle import Vehicle
from mavlink_io.clock import wall_s
from mavlink_io.dialect import constant
from mavlink_io.frames import euler_from_quaternion, geodetic_to_offset
from mavlink_io.mission_items import FRAME_LOCAL_NED, GLOBAL_FRAMES, GLOBAL_SCALE

ATTITUDE, LOCAL, GLOBAL = (
    "SET_ATTITUDE_TARGET",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
)
MESSAGE_IDS = ATTITUDE, LOCAL, GLOBAL

_NO_PITCH_RATE, _NO_YAW_RATE, _NO_THRUST, _NO_ATTITUDE = 0b10, 0b100, 0b100_0000, 0b1000_0000
"""ATTITUDE_TARGET_TYPEMASK."""
_FIELDS = {"x": 1, "y": 2, "z": 4, "vx": 8, "vy": 16, "vz": 32, "yaw": 1024, "yaw_rate": 2048}
"""POSITION_TARGET_TYPEMASK: the bit that has a field ignored."""
_BODY = frozenset((constant("MAV_FRAME_BODY_NED"), constant("MAV_FRAME_BODY_FRD")))


class TargetError(ValueError):
    """A set-point that cannot be followed; the message says why."""


class SetpointStreams:
    """Hands set-points to the vehicle and knows for how long each kind has been silent."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._heard_s: dict[type, float] = {}
        self._complaint = ""

    def take(self, name: str, message: Any) -> None:
        """A set-point message for this vehicle."""
        try:
            target = read(name, message, self._vehicle.state.home)
        except TargetError as error:
            if str(error) != self._complaint:
                self._complaint = str(error)
                self._vehicle.say(f"Set-point ignored: {error}")
            return
        self._heard_s[type(target)] = wall_s()
        self._vehicle.request(SetTarget(target))

    @property
    def silent_s(self) -> tuple[float | None, float | None]:
        """Wall seconds since an attitude and a motion target were heard; None before the first."""
        if not self._heard_s:
            return None, None
        attitude_s, motion_s = self._heard_s.get(AttitudeTarget), self._heard_s.get(MotionTarget)
        now_s = wall_s()
        return (
            None if attitude_s is None else now_s - attitude_s,
            None if motion_s is None else now_s - motion_s,
        )


def read(name: str, message: Any, home: Home) -> AttitudeTarget | MotionTarget:
    """The target in a decoded message. Raises TargetError."""
    if name == ATTITUDE:
        return attitude(message)
    fields = _value_unless_ignored(message, name)
    if name == GLOBAL:
        return _global(message, fields, home)
    if message.coordinate_frame in _BODY:
        return _body(fields)
    if message.coordinate_frame != FRAME_LOCAL_NED:
        raise TargetError(
            f"frame {message.coordinate_frame} of {name}; LOCAL_NED (1) and BODY_NED (8) can be"
            " followed"
        )
    return _motion(fields, _pair(fields, "x", "y", name), fields.get("z"))


def attitude(message: Any) -> AttitudeTarget:
    """Pitch and heading of the quaternion, or the rates where it is ignored; roll follows from
    neither."""
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


def _value_unless_ignored(message: Any, name: str) -> dict[str, float]:
    """The fields that count, by their local names: neither ignored by the mask nor NaN."""
    here = {"x": "lat_int", "y": "lon_int", "z": "alt"} if name == GLOBAL else {}
    fields = {
        field: float(getattr(message, here.get(field, field)))
        for field, ignored in _FIELDS.items()
        if not message.type_mask & ignored
    }
    fields = {field: value for field, value in fields.items() if not math.isnan(value)}
    if not fields:
        raise TargetError(
            f"{name} with type_mask {message.type_mask}: position, velocity, yaw or yaw rate is"
            " needed"
        )
    return {field: _finite(value, field) for field, value in fields.items()}


def _global(message: Any, fields: dict[str, float], home: Home) -> MotionTarget:
    if message.coordinate_frame not in GLOBAL_FRAMES:
        raise TargetError(
            f"frame {message.coordinate_frame} of {GLOBAL}: altitude is that above home or the sea"
        )
    place, depth = _pair(fields, "x", "y", GLOBAL), fields.get("z")
    if place is not None:
        if not home.known:
            raise TargetError(f"{GLOBAL}: home is not known yet")
        lat, lon = place.real / GLOBAL_SCALE, place.imag / GLOBAL_SCALE
        place = complex(*geodetic_to_offset(lat, lon, home.lat_deg, home.lon_deg))
    return _motion(fields, place, None if depth is None else -depth)


def _motion(
    fields: dict[str, float], position_m: complex | None, depth_m: float | None
) -> MotionTarget:
    """A velocity beside a place only tells how fast to go there."""
    velocity = _pair(fields, "vx", "vy", "velocity")
    there = position_m is not None and velocity is not None
    return MotionTarget(
        position_m=position_m,
        depth_m=None if depth_m is None else max(0.0, depth_m),
        velocity_mps=None if there else velocity,
        depth_rate_mps=fields.get("vz") if depth_m is None else None,
        speed_mps=abs(velocity) if there and velocity else None,
        heading_rad=fields.get("yaw"),
        heading_rate_radps=fields.get("yaw_rate"),
    )


def _body(fields: dict[str, float]) -> MotionTarget:
    """Ahead, down and round: she cannot move sideways."""
    if {"x", "y", "z"} & fields.keys():
        raise TargetError(
            f"positions in body axes of {LOCAL}: only velocities can be followed there"
        )
    if fields.get("vy", 0.0) != 0.0:
        raise TargetError(
            f"vy in body axes of {LOCAL}: must be 0 or ignored, she cannot move sideways"
        )
    rate = fields.get("yaw_rate", 0.0 if "yaw" not in fields else None)
    return MotionTarget(
        depth_rate_mps=fields.get("vz"),
        speed_mps=fields.get("vx"),
        heading_rad=fields.get("yaw"),
        heading_rate_radps=rate,
    )


def _pair(fields: dict[str, float], first: str, second: str, name: str) -> complex | None:
    """Two components that mean something only together."""
    given = {first, second} & fields.keys()
    if len(given) == 1:
        raise TargetError(f"{name}: {first} and {second} go together")
    return complex(fields[first], fields[second]) if given else None


def _finite(value: float, name: str) -> float:
    if not math.isfinite(value):
        raise TargetError(f"{name} is {value}")
    return value
