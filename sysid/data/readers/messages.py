"""Make a ``Log`` from decoded MAVLink messages, for MCAP logs and tlogs.

Attitude, depth and commands are read from the first message of a list that the vehicle sends.
"""

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mavlink_io.mission_items import GLOBAL_SCALE
from mavlink_io.records import ARMED_FLAG
from mavlink_io.vehicle_modes import mode_of_heartbeat
from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Clock,
    ClockStep,
    Current,
    Depth,
    DuctAngles,
    Log,
    LogError,
    LogEvent,
    Position,
    Setpoints,
    SpecificForce,
    Velocity,
    VelocitySource,
)
from sysid.data.events import Armed, ModeChanged, parse_text
from sysid.data.readers.parameter_history import ParameterHistory
from sysid.data.readers.samples import (
    NO_DAMAGE,
    FileDamage,
    accelerometer,
    ahead_of_others,
    body_rates,
    body_velocity,
    clock_steps,
    content_sha256,
    derivative,
    euler_rad,
    format_damage,
    ground_speed,
    strictly_increasing,
    times_before,
    usable,
    zero_depth,
)
from sysid.data.readers.servo_channels import OutputOptions, actuator_commands, travel_rad

DUCT = "duct"
"""Key of the ACTUATOR_OUTPUT_STATUS messages that the tailcone's component sends."""
DUCT_COMPONENT = 140
"""Component of the tailcone, MAV_COMP_ID_SERVO1."""
DVL = "dvl"
"""Key of the ODOMETRY messages that a Doppler velocity log (DVL) sends."""
_DVL_COMPONENT = 197
"""Component of the DVL, MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY."""
IMU = "HIL_SENSOR"
"""Message of the inertial sensors that the onboard log holds; a component of its own sends it."""
DEVICES = {(DUCT_COMPONENT, "ACTUATOR_OUTPUT_STATUS"): DUCT, (_DVL_COMPONENT, "ODOMETRY"): DVL}
"""Key of the messages that a device of the vehicle sends, by component and message name."""

AUTOPILOT_COMPONENT = 1
"""Component of the autopilot, MAV_COMP_ID_AUTOPILOT1."""
_SERVOS = "SERVO_OUTPUT_RAW"
"""Message with servo pulses, from autopilots that do not send ACTUATOR_OUTPUT_STATUS."""
_COMMANDS = "ACTUATOR_OUTPUT_STATUS"
_HEARTBEAT = "HEARTBEAT"
"""Message with mode and arming state; it does not count as data of the dive (``Log.sha256``)."""
ATTITUDES = ("ATTITUDE", "ATTITUDE_QUATERNION", "AHRS2")
"""Messages with the attitude. AHRS2 has no rates; they are the derivatives of its angles."""
_DEPTHS = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "VFR_HUD", "AHRS2")
"""Messages with the depth."""
_ACCELEROMETERS = (IMU, "HIGHRES_IMU", "SCALED_IMU", "SCALED_IMU2")
"""Messages with the acceleration."""
_CURRENT, _HOME = "WIND_COV", "HOME_POSITION"
"""Messages with the estimated current and with home."""
_SOURCES = (ATTITUDES, (_COMMANDS, _SERVOS), _DEPTHS)
_OTHERS = (
    "ATTITUDE_TARGET",
    "POSITION_TARGET_LOCAL_NED",
    "STATUSTEXT",
    _HEARTBEAT,
    _CURRENT,
    _HOME,
)
CANDIDATES = frozenset(
    (*(name for names in (*_SOURCES, _ACCELEROMETERS) for name in names), *_OTHERS, "ODOMETRY")
)
"""All messages that ``messages_to_read`` can return, and those of devices."""
_NOT_HASHED = {_HEARTBEAT, _CURRENT, _HOME, DVL, *_ACCELEROMETERS}
"""Messages that do not count as data of the dive (``Log.sha256``)."""
WRAP_S = 1e-6 * 2**32
"""Time after which a ``time_usec`` of 32 bits starts again."""
MAX_LATENCY_S = 2.0
"""Largest time by which such a message comes after its own time."""
_COPY_S = 0.5
"""Time within which an equal text is a copy, in s: no test starts again so soon."""
_MILLIG_MPS2 = 9.80665e-3
_FRAME_BODY, _FRAME_GROUND = 12, 20
"""MAV_FRAME_BODY_FRD and MAV_FRAME_LOCAL_FRD; as ``frame_id`` of a DVL's velocity they mean
through the water (water track) and over ground (bottom track)."""
_FIELDS: dict[str, dict[str, int]] = {
    "ATTITUDE": dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0),
    "ATTITUDE_QUATERNION": dict.fromkeys(
        ("q1", "q2", "q3", "q4", "rollspeed", "pitchspeed", "yawspeed"), 0
    ),
    "AHRS2": dict.fromkeys(("roll", "pitch", "yaw", "altitude"), 0),
    "LOCAL_POSITION_NED": {"z": 0, "vz": 0},
    "GLOBAL_POSITION_INT": {"relative_alt": 0, "vz": 0},
    "VFR_HUD": {"alt": 0, "climb": 0},
    "ATTITUDE_TARGET": {"q": 4},
    "POSITION_TARGET_LOCAL_NED": {"z": 0},
    "STATUSTEXT": {"severity": 0, "text": 1, "id": 0, "chunk_seq": 0},
    _HEARTBEAT: {"custom_mode": 0, "base_mode": 0, "autopilot": 0},
    _CURRENT: dict.fromkeys(("wind_x", "wind_y"), 0),
    _HOME: dict.fromkeys(("latitude", "longitude"), 0),
    _COMMANDS: {"actuator": 1},
    _SERVOS: {"servo1_raw": 0},
    DUCT: {"actuator": 2},
    DVL: dict.fromkeys(("frame_id", "child_frame_id", "vx", "vy", "vz"), 0),
    **dict.fromkeys(_ACCELEROMETERS, dict.fromkeys(("xacc", "yacc", "zacc"), 0)),
}
"""Fields that are read from each message: 0 for a scalar, else the minimum length of an array."""

Messages = dict[str, tuple[Array, NDArray[Any]]]
"""Vehicle times (s) and records by message name."""


def messages_to_read(sent: Container[str]) -> tuple[str, ...]:
    """Return the names of the messages to read from a vehicle that sends the messages ``sent``."""
    chosen = (_first(names, sent) for names in (*_SOURCES, _ACCELEROMETERS))
    return (*dict.fromkeys(name for name in chosen if name), *_OTHERS)


def _first(names: Iterable[str], sent: Container[str]) -> str:
    """Return the first of the messages that is sent; empty without any."""
    return next((name for name in names if name in sent), "")


def assemble(
    path: Path,
    messages: Messages,
    history: ParameterHistory,
    options: OutputOptions,
    ahead: tuple[Array, Array],
    damage: FileDamage = NO_DAMAGE,
) -> Log:
    """Return the log of one vehicle.

    Parameters
    ----------
    path : Path
        The file, for the name and for messages.
    messages : dict
        Vehicle times (s) and records by message name.
    history : ParameterHistory
        Parameters of the autopilot.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust, and the travel.
    ahead : tuple of two ndarray
        Times, and recorder time minus vehicle time, s.
    damage : FileDamage
        Damage of the file.

    Returns
    -------
    Log
        Arrays in MAVLink's axes, vehicle time.

    Raises
    ------
    LogError
        A required message or field is missing.
    """
    attitude, commanded, depth = (_first(names, messages) for names in _SOURCES)
    if not (attitude and commanded):
        found = zip((attitude, commanded, depth), _SOURCES, strict=True)
        missing = [" or ".join(names) for name, names in found if not name]
        raise LogError(
            f"{path}: holds no {', no '.join(missing)} of a vehicle; identification needs attitude"
            " and commands, and depth for tests of the elevator"
        )
    parameters = history.latest()
    used = dict.fromkeys(name for name in (attitude, commanded, depth) if name)
    _refuse_other_definitions(path, messages)
    steps = [step for name in used for step in clock_steps(name, messages[name][0])]
    motion = _attitude(attitude, *messages[attitude])
    wrong_s = (
        time_s
        for name in used
        for time_s in times_before(ahead_of_others(messages[name][0]), messages[name][0])
    )
    damage = damage._replace(contradicted_s=(*damage.contradicted_s, *sorted(wrong_s)))
    return Log(
        name=path.name,
        sha256=content_sha256(
            {
                name: record.tobytes()
                for name, (_, record) in messages.items()
                if name not in _NOT_HASHED
            },
            parameters,
        ),
        attitude=motion,
        actuators=_actuators(*messages[commanded], options, history, f"{path}: {commanded}"),
        depth=_depth(depth, *messages[depth]) if depth else zero_depth(motion.time_s),
        setpoints=_setpoints(messages),
        events=_events(messages, steps),
        parameters=parameters,
        duct=_duct(*messages[DUCT], travel_rad(parameters, options))
        if DUCT in messages
        else DuctAngles(*(np.empty(0),) * 3),
        clock=Clock(tuple(steps), *ahead),
        damage=format_damage(damage, motion.time_s),
        velocity=_velocity(messages, motion, depth),
        specific_force=_specific_force(messages),
        position=_position(messages),
        current=_current(messages),
        home_deg=_home_deg(messages),
    )


def refuse_several(path: Path, vehicles: Sequence[tuple[str, str]], remedy: str) -> None:
    """Refuse a log in which several vehicles send an attitude.

    Parameters
    ----------
    path : Path
        The file.
    vehicles : sequence of (str, str)
        System and component of each sender of an attitude.
    remedy : str
        Command that writes the messages of SYSTEM to a file.

    Raises
    ------
    LogError
        There are several.
    """
    if len(vehicles) < 2:
        return
    systems = list(dict.fromkeys(system for system, _ in vehicles))
    named = f"systems {', '.join(systems)}"
    advice = f", for example with `{remedy.replace('SYSTEM', systems[0])}`"
    if len(systems) == 1:
        named = f"components {', '.join('/'.join(vehicle) for vehicle in vehicles)}"
        advice = ""
    raise LogError(
        f"{path}: {len(vehicles)} vehicles send an attitude ({named}); a log for identification has"
        f" one: write one file per vehicle{advice}"
    )


def _refuse_other_definitions(path: Path, messages: Messages) -> None:
    """Raise LogError if the schema of a message has not all fields that are read."""
    for name, (_, record) in messages.items():
        types: Mapping[str, Any] = record.dtype.fields or {}
        for field, length in _FIELDS[name].items():
            shape = types[field][0].shape if field in types else (-1,)
            if (shape != ()) if length == 0 else (not shape or shape[0] < length):
                needed = "it must follow the MAVLink definition"
                raise LogError(f"{path}: {name} lacks field {field}; {needed}")


def _columns(record: NDArray[Any], keep: NDArray[np.bool_], *names: str) -> list[Array]:
    """Return fields of a record array as floats, for the samples of the mask ``keep``."""
    return [record[name][keep].astype(np.float64) for name in names]


def _attitude(name: str, time_s: Array, record: NDArray[Any]) -> Attitude:
    """Return attitude and rates from one of ATTITUDES."""
    keep = usable(time_s, *(record[field] for field in _FIELDS[name]))
    if name == "ATTITUDE_QUATERNION":
        roll, pitch, yaw = euler_rad(*_columns(record, keep, "q1", "q2", "q3", "q4"))
    else:
        roll, pitch, yaw = _columns(record, keep, "roll", "pitch", "yaw")
    yaw = np.unwrap(yaw)
    if name == "AHRS2":
        p, q, r = body_rates(time_s[keep], roll, pitch, yaw)
    else:
        p, q, r = _columns(record, keep, "rollspeed", "pitchspeed", "yawspeed")
    return Attitude(
        time_s=time_s[keep],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        p_radps=p,
        q_radps=q,
        r_radps=r,
    )


def _actuators(
    time_s: Array,
    record: NDArray[Any],
    options: OutputOptions,
    history: ParameterHistory,
    where: str,
) -> Actuators:
    """Return the commands in radians and fractions of thrust."""
    if "port" in (record.dtype.names or ()):  # outputs 1 to 16, and 17 to 32
        lowest = record["port"] == np.min(record["port"])
        time_s, record = time_s[lowest], record[lowest]
    time_s = _with_wrapped_times(time_s, record)
    keep = strictly_increasing(time_s)
    return actuator_commands(time_s[keep], _outputs(record[keep]), options, history, where)


def _with_wrapped_times(time_s: Array, record: NDArray[Any]) -> Array:
    """Return the times in a message whose ``time_usec`` has 32 bits, which wrap after 72 minutes.

    ``time_s`` is when the message came. A sender whose field is further from it than
    MAX_LATENCY_S uses another clock.
    """
    types: Mapping[str, Any] = record.dtype.fields or {}
    if "time_usec" not in types or types["time_usec"][0] != np.uint32:
        return time_s
    if not np.any(record["time_usec"]):  # the sender does not fill it
        return time_s
    late_s = np.mod(time_s - 1e-6 * record["time_usec"] + 0.5 * WRAP_S, WRAP_S) - 0.5 * WRAP_S
    return np.where(np.abs(late_s) <= MAX_LATENCY_S, time_s - late_s, time_s)


def _outputs(record: NDArray[Any]) -> Array:
    """Return all outputs of a message, shape (n, outputs)."""
    names = record.dtype.names or ()
    if "actuator" in names:
        return np.asarray(record["actuator"], np.float64)
    servos = [name for name in names if re.fullmatch(r"servo\d+_raw", name)]
    servos.sort(key=lambda name: int(name[5:-4]))
    return np.stack([record[name].astype(np.float64) for name in servos], axis=1)


def _duct(time_s: Array, record: NDArray[Any], full_travel_rad: float) -> DuctAngles:
    """Return the measured duct angles in radians."""
    keep = strictly_increasing(time_s)
    angles = record["actuator"][keep].astype(np.float64) * full_travel_rad
    return DuctAngles(time_s[keep], angles[:, 0], angles[:, 1])


def _depth(name: str, time_s: Array, record: NDArray[Any]) -> Depth:
    """Return depth and its rate, positive down, from one of the messages with the depth."""
    keep = usable(time_s, *(record[field] for field in _FIELDS[name]))
    match name:
        case "LOCAL_POSITION_NED":
            depth_m, rate_mps = _columns(record, keep, "z", "vz")
        case "GLOBAL_POSITION_INT":  # mm upwards, cm/s downwards
            altitude_mm, rate_cmps = _columns(record, keep, "relative_alt", "vz")
            depth_m, rate_mps = -1e-3 * altitude_mm, 1e-2 * rate_cmps
        case "VFR_HUD":
            altitude_m, climb_mps = _columns(record, keep, "alt", "climb")
            depth_m, rate_mps = -altitude_m, -climb_mps
        case _:
            (altitude_m,) = _columns(record, keep, "altitude")
            depth_m, rate_mps = -altitude_m, -derivative(time_s[keep], altitude_m)
    return Depth(time_s[keep], depth_m, rate_mps)


def _velocity(messages: Messages, attitude: Attitude, depth_message: str) -> Velocity:
    """Return the velocity of a DVL, or else that in the message with the depth."""
    if DVL in messages:
        time_s, record = messages[DVL]
        measured = (record["child_frame_id"] == _FRAME_BODY) & usable(
            time_s, *(record[name] for name in ("vx", "vy", "vz"))
        )
        for frame, source in (
            (_FRAME_BODY, VelocitySource.WATER_TRACK),
            (_FRAME_GROUND, VelocitySource.BOTTOM_TRACK),
        ):
            keep = measured & (record["frame_id"] == frame)
            if np.count_nonzero(keep) > 1:
                x, y, z = _columns(record, keep, "vx", "vy", "vz")
                return Velocity(time_s[keep], x, y, z, source)
    if not depth_message:
        return Velocity()
    time_s, record = messages[depth_message]
    names = record.dtype.names or ()
    whole = np.ones(time_s.size, bool)
    if {"vx", "vy", "vz"} <= set(names):
        factor = 1e-2 if depth_message == "GLOBAL_POSITION_INT" else 1.0  # cm/s
        velocity = (factor * axis for axis in _columns(record, whole, "vx", "vy", "vz"))
        return body_velocity(attitude, time_s, *velocity)
    if "groundspeed" in names:
        return ground_speed(time_s, *_columns(record, whole, "groundspeed"))
    return Velocity()


def _specific_force(messages: Messages) -> SpecificForce:
    """Return the acceleration from the first of _ACCELEROMETERS; SCALED_IMU has milli-g."""
    name = _first(_ACCELEROMETERS, messages)
    if not name:
        return SpecificForce()
    time_s, record = messages[name]
    factor = _MILLIG_MPS2 if name.startswith("SCALED") else 1.0
    axes = _columns(record, np.ones(time_s.size, bool), "xacc", "yacc", "zacc")
    return accelerometer(time_s, *(factor * axis for axis in axes))


def _position(messages: Messages) -> Position:
    """Return the position of LOCAL_POSITION_NED; empty without it."""
    time_s, record = messages.get("LOCAL_POSITION_NED", (np.empty(0), np.empty(0)))
    if not {"x", "y"} <= set(record.dtype.names or ()):
        return Position()
    keep = usable(time_s, record["x"], record["y"])
    return Position(time_s[keep], *_columns(record, keep, "x", "y"))


def _current(messages: Messages) -> Current:
    """Return the current of WIND_COV; empty without it."""
    if _CURRENT not in messages:
        return Current()
    time_s, record = messages[_CURRENT]
    keep = usable(time_s, record["wind_x"], record["wind_y"])
    return Current(time_s[keep], *_columns(record, keep, "wind_x", "wind_y"))


def _home_deg(messages: Messages) -> tuple[float, float] | None:
    """Return latitude and longitude of the last HOME_POSITION; None if missing or both 0."""
    if _HOME not in messages:
        return None
    _, record = messages[_HOME]
    lat, lon = (float(record[name][-1]) / GLOBAL_SCALE for name in ("latitude", "longitude"))
    return (lat, lon) if lat or lon else None


def _setpoints(messages: Messages) -> Setpoints:
    """Return heading, pitch and depth setpoints; empty arrays without the messages."""
    nothing = np.empty(0)
    attitude_time, heading, pitch, depth_time, depth = nothing, nothing, nothing, nothing, nothing
    if "ATTITUDE_TARGET" in messages:
        time_s, record = messages["ATTITUDE_TARGET"]
        keep = usable(time_s, *record["q"][:, :4].T)
        _, pitch, heading = euler_rad(*record["q"][keep, :4].astype(np.float64).T)
        attitude_time, heading = time_s[keep], np.unwrap(heading)
    if "POSITION_TARGET_LOCAL_NED" in messages:
        time_s, record = messages["POSITION_TARGET_LOCAL_NED"]
        keep = strictly_increasing(time_s)
        depth_time, (depth,) = time_s[keep], _columns(record, keep, "z")
    return Setpoints(
        attitude_time_s=attitude_time,
        heading_rad=heading,
        pitch_rad=pitch,
        depth_time_s=depth_time,
        depth_m=depth,
    )


def _events(messages: Messages, steps: Sequence[ClockStep]) -> tuple[LogEvent, ...]:
    """Return the events. Modes and arming come from HEARTBEAT; in a log without it, from texts."""
    sources = {
        name: (_times_after_restart(messages[name][0], steps), messages[name][1])
        for name in ("STATUSTEXT", _HEARTBEAT)
        if name in messages
    }
    events = _text_events(*sources["STATUSTEXT"]) if "STATUSTEXT" in sources else []
    if _HEARTBEAT in sources:
        events = [event for event in events if not isinstance(event.value, ModeChanged | Armed)]
        events += _state_events(*sources[_HEARTBEAT])
    return tuple(sorted(events, key=lambda event: event.time_s))


def _times_after_restart(time_s: Array, steps: Sequence[ClockStep]) -> Array:
    """Return the times of messages; those after a restart are at least the latest before it.

    Samples after the restart are left out until then: a test there would get other samples.
    """
    behind = np.maximum.accumulate(time_s) - time_s > MAX_LATENCY_S
    if not steps or not behind.any():
        return time_s
    first = int(np.argmax(behind))
    return np.concatenate((time_s[:first], np.maximum(time_s[first:], steps[0].time_s)))


def _text_events(time_s: Array, record: NDArray[Any]) -> list[LogEvent]:
    """Return the events of texts; consecutive chunks of a long text (id not 0) are joined.

    A log of a ground station with two links to the vehicle has every message twice. A second copy
    of a text would end the test that the first has started.
    """
    texts: list[tuple[float, int, str]] = []
    seen_s: dict[bytes, float] = {}
    open_id = 0
    for time, row in zip(time_s, record, strict=True):
        content = row.tobytes()
        if abs(time - seen_s.get(content, -np.inf)) < _COPY_S:
            continue
        seen_s[content] = time
        text = row["text"].tobytes().split(b"\0", 1)[0].decode("utf-8", "replace")
        if open_id and row["id"] == open_id and row["chunk_seq"] > 0:
            first_s, severity, beginning = texts.pop()
            texts.append((first_s, severity, beginning + text))
        else:
            texts.append((float(time), int(row["severity"]), text))
        open_id = int(row["id"])
    return [LogEvent(first_s, parse_text(severity, text)) for first_s, severity, text in texts]


def _state_events(time_s: Array, record: NDArray[Any]) -> list[LogEvent]:
    """Return the modes and armings; the first HEARTBEAT gives the state at the start."""
    modes, autopilots = record["custom_mode"].astype(np.int64), record["autopilot"]
    armed = ((record["base_mode"] & ARMED_FLAG) > 0).astype(np.int8)
    changed = np.flatnonzero(np.diff(modes, prepend=-1))
    armings = np.flatnonzero(np.diff(armed, prepend=0) > 0)
    return [
        *(
            LogEvent(
                float(time_s[k]),
                ModeChanged(mode_of_heartbeat(int(autopilots[k]), int(modes[k]))),
            )
            for k in changed
        ),
        *(LogEvent(float(time_s[k]), Armed()) for k in armings),
    ]
