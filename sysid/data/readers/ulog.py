"""PX4's logs (.ulg), read with pyulog. Messages are PX4's uORB topics in FRD, NED and radians."""

import contextlib
import io
import math
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mavlink_io.text_files import read_limited
from sysid.data.bit_errors import damaged_names
from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Depth,
    Log,
    LogError,
    LogEvent,
    Setpoints,
    SpecificForce,
    Velocity,
)
from sysid.data.events import is_damaged, parse_text
from sysid.data.readers import px4_outputs
from sysid.data.readers.parameter_history import ParameterHistory, history_of
from sysid.data.readers.px4_outputs import SERVOS
from sysid.data.readers.samples import (
    FileDamage,
    MessageColumns,
    accelerometer,
    attitude_of_angles,
    attitude_with_rates,
    body_velocity,
    clock_steps,
    derivative,
    euler_rad,
    foreign_log,
    format_damage,
    ground_speed,
    is_parameter_name,
    strictly_increasing,
    usable,
    zero_depth,
)
from sysid.data.readers.servo_channels import (
    FIRST_THREE,
    READ_PARAMETERS,
    OutputOptions,
    ServoChannels,
    actuator_commands,
)
from sysid.data.readers.spikes import Plausible, drop_contradicted, merged
from sysid.data.readers.ulog_recovery import keep_sound_messages, refuse_large_formats

_OUTPUTS = (
    "actuator_outputs_sim",
    "actuator_outputs",
    "actuator_servos",
    "actuator_controls_0",
)
"""Topics of the outputs, the preferred first: fractions to the simulator, pulses to the servos,
fractions to servos (PX4 1.14), fractions of the mixer (before 1.14)."""
_CONVERT = {
    "actuator_outputs_sim": px4_outputs.simulated_parameters,
    "actuator_outputs": px4_outputs.servo_parameters,
    "actuator_servos": px4_outputs.surface_parameters,
}
"""Parameters of the outputs by topic; the others are commands of rudder and elevator."""
_MOTORS = "actuator_motors"
"""Topic whose controls count as outputs 9 and following where actuator_servos is read."""
SERVOS_AND_MOTOR = ServoChannels(1, 2, SERVOS + 1)
"""Outputs of a log with actuator_servos and actuator_motors: two servos and the first motor."""
_MIXER_INPUTS = ServoChannels(rudder=3, elevator=2, thrust=4)
"""Yaw, pitch and thrust of actuator_controls_0, whose first value is roll."""
_RATES = (
    ("vehicle_angular_velocity", ("xyz[0]", "xyz[1]", "xyz[2]")),
    ("vehicle_attitude", ("rollspeed", "pitchspeed", "yawspeed")),
    ("sensor_combined", ("gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]")),
)
"""Topics and fields of the body rates, the preferred first; the second is of PX4 before 1.10."""
_DEPTHS = (
    ("vehicle_local_position", "z", 1.0),
    ("vehicle_global_position", "alt", -1.0),
    ("vehicle_air_data", "baro_alt_meter", -1.0),
)
"""Topics and fields of depth or altitude, and the factor to depth, the preferred first."""
_POSITION, _SATELLITE = "vehicle_local_position", "vehicle_gps_position"
"""Topics with the velocity of the estimator over ground, and the speed of the receiver."""
_ACCELEROMETERS = (
    ("vehicle_acceleration", ("xyz[0]", "xyz[1]", "xyz[2]")),
    (
        "sensor_combined",
        ("accelerometer_m_s2[0]", "accelerometer_m_s2[1]", "accelerometer_m_s2[2]"),
    ),
)
"""Topics and fields of the acceleration in m/s2, the preferred first."""
_TOPICS = tuple(
    dict.fromkeys(("vehicle_attitude", *(topic for topic, *_ in (*_RATES, *_DEPTHS)), _MOTORS))
)
_NEEDED = "vehicle_attitude, actuator_outputs, and for tests of the elevator vehicle_local_position"
_SETPOINTS = ("vehicle_attitude_setpoint", "vehicle_local_position_setpoint")
_FRACTIONS = {
    f"{field}[{n}]": Plausible(floor=0.05) for field in ("control", "output") for n in range(16)
}
_DEPTH, _SPEED, _FORCE = Plausible(floor=0.2), Plausible(floor=0.2), Plausible(floor=0.5)
_PLAUSIBLE = merged(
    {name: {column: _DEPTH} for name, column, _ in _DEPTHS},
    {name: dict.fromkeys(columns, Plausible(floor=0.05)) for name, columns in _RATES},
    {name: _FRACTIONS for name in (*_OUTPUTS, _MOTORS) if name != "actuator_outputs"},
    {name: dict.fromkeys(fields, _FORCE) for name, fields in _ACCELEROMETERS},
    {
        "actuator_outputs": {f"output[{n}]": Plausible(floor=25.0) for n in range(16)},
        "vehicle_attitude": {f"q[{n}]": Plausible(floor=0.01) for n in range(4)},
        "vehicle_attitude_setpoint": {f"q_d[{n}]": Plausible(floor=0.01) for n in range(4)},
        "vehicle_local_position_setpoint": {"z": _DEPTH},
        _POSITION: dict.fromkeys(("vx", "vy", "vz"), _SPEED),
        _SATELLITE: {"vel_m_s": _SPEED},
    },
)
"""Smallest spikes that are reported: 0.2 m, 0.05 rad/s, 5 % of the travel, 25 us, 0.01, 0.2 m/s,
0.5 m/s2."""
_QUATERNION = ("[0]", "[1]", "[2]", "[3]")

Tables = dict[str, MessageColumns]


def read(path: Path, options: OutputOptions) -> Log:
    """Read one .ulg.

    Parameters
    ----------
    path : Path
        The file.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust, and the travel.

    Returns
    -------
    Log
        Arrays in MAVLink's axes, time since boot.

    Raises
    ------
    LogError
        The file is damaged, or has not all required topics.
    """
    log, damage = _parse(
        path, [*_TOPICS, *_OUTPUTS, *_SETPOINTS, _SATELLITE, *(name for name, _ in _ACCELEROMETERS)]
    )
    tables = _tables(log)
    topic_tables, spikes = drop_contradicted(_lowest_instances(tables), _PLAUSIBLE)
    damage = damage._replace(
        contradicted_s=spikes.contradicted_s, impossible_names=_damaged_names(log, tables)
    )
    history = _parameters(log)
    parameters = history.latest()
    attitude, actuators = (
        _attitude(path, topic_tables),
        _actuators(path, topic_tables, options, history),
    )
    depth = _depth(path, topic_tables, attitude.time_s)
    steps = [
        step
        for name in (*_TOPICS, *_OUTPUTS)
        if name in topic_tables
        for step in clock_steps(name, topic_tables[name].time_s)
    ]
    texts = sorted(log.logged_messages, key=lambda message: message.timestamp)
    events = tuple(
        LogEvent(m.timestamp * 1e-6, parse_text(m.log_level - ord("0"), m.message)) for m in texts
    )
    return foreign_log(
        path,
        attitude=attitude,
        actuators=actuators,
        depth=depth,
        setpoints=_setpoints(topic_tables),
        events=events,
        parameters=parameters,
        steps=steps,
        damage=format_damage(damage, attitude.time_s),
        velocity=_velocity(path, topic_tables, attitude),
        specific_force=_specific_force(path, topic_tables),
    )


def _parameters(log: Any) -> ParameterHistory:
    """Return the parameters at the start, and their changes in flight."""
    initial = ((-math.inf, name, value) for name, value in log.initial_parameters.items())
    changed = ((stamp * 1e-6, name, value) for stamp, name, value in log.changed_parameters)
    return history_of(
        (time_s, str(name), float(value))
        for time_s, name, value in (*initial, *changed)
        if isinstance(value, int | float)  # pyulog does not convert the type of a damaged parameter
    )


def load(path: Path) -> tuple[Tables, FileDamage]:
    """Return all topics, a second instance as ``name.1``, and the damage.

    Raises LogError for a bad file.
    """
    log, damage = _parse(path, None)
    return _tables(log), damage


def _parse(path: Path, topics: list[str] | None) -> tuple[Any, FileDamage]:
    """Return pyulog's ULog of a file and its damage; raise LogError for a bad file."""
    from pyulog import ULog

    try:
        data, damage = keep_sound_messages(read_limited(path))
        refuse_large_formats(data)
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(io.BytesIO(data), topics)
        dropouts_s = tuple(dropout.duration * 1e-3 for dropout in log.dropouts)
        return log, damage._replace(dropouts_s=dropouts_s)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give a PX4 .ulg") from None
    except Exception as error:  # pyulog fails in as many ways as a file can be broken
        raise LogError(
            f"{path}: is no readable PX4 log ({type(error).__name__}: {error})"
        ) from None


def _damaged_names(log: Any, tables: Tables) -> int:
    """Return the number of names and texts with characters or bits that none has."""
    parameters = [str(name) for name in log.initial_parameters]
    possible = [name for name in parameters if is_parameter_name(name)]
    number = len(parameters) - len(possible) + damaged_names(possible, READ_PARAMETERS)
    number += damaged_names(tables, _PLAUSIBLE) + sum(
        damaged_names(tables[name].columns, _PLAUSIBLE[name]) for name in tables.keys() & _PLAUSIBLE
    )
    return number + sum(is_damaged(message.message) for message in log.logged_messages)


def _tables(log: Any) -> Tables:
    """Return the topics; times are ``timestamp_sample`` if present, else ``timestamp``.

    An instance that was subscribed more than once has the samples of all its subscriptions.
    """
    parts = defaultdict[str, list[MessageColumns]](list)
    for topic in sorted(log.data_list, key=lambda t: (t.name, t.multi_id, t.msg_id)):
        sampled = topic.data.get("timestamp_sample")
        if sampled is None and "timestamp" not in topic.data:
            continue  # in a damaged file the format of the topic, and so its time, can be missing
        stamps = sampled if sampled is not None and np.all(sampled > 0) else topic.data["timestamp"]
        name = f"{topic.name}.{topic.multi_id}" if topic.multi_id else topic.name
        parts[name].append(MessageColumns(stamps * 1e-6, topic.data))
    return {name: _joined(tables) for name, tables in parts.items()}


def _joined(tables: list[MessageColumns]) -> MessageColumns:
    """Return the rows of all tables, in their order, with the columns that each of them has."""
    common = [name for name in tables[0].columns if all(name in t.columns for t in tables)]
    return MessageColumns(
        np.concatenate([table.time_s for table in tables]),
        {name: np.concatenate([table.columns[name] for table in tables]) for name in common},
    )


def _lowest_instances(tables: Tables) -> Tables:
    """Return the lowest instance of each topic that the log holds, under the topic's name."""
    lowest = Tables()
    for name in sorted(tables, key=lambda name: int(name.partition(".")[2] or 0)):
        lowest.setdefault(name.partition(".")[0], tables[name])
    return lowest


def _table(path: Path, topic_tables: Tables, name: str, *columns: str) -> MessageColumns:
    """Return a topic in order of time; raise LogError if it or one of its fields is missing."""
    missing = [
        column
        for column in columns
        if name not in topic_tables or column not in topic_tables[name].columns
    ]
    if missing:
        raise LogError(f"{path}: holds no {name}.{missing[0]}; identification needs {_NEEDED}")
    time_s, values = topic_tables[name]
    keep = strictly_increasing(time_s)
    return MessageColumns(time_s[keep], {column: array[keep] for column, array in values.items()})


def _attitude(path: Path, topic_tables: Tables) -> Attitude:
    """Return attitude and body rates from one of _RATES, else by differences."""
    parts = [f"q{part}" for part in _QUATERNION]
    time_s, columns = _table(path, topic_tables, "vehicle_attitude", *parts)
    known = usable(time_s, *(columns[part] for part in parts))
    angles_rad = euler_rad(*(columns[part][known].astype(np.float64) for part in parts))
    rates = next((r for r in _RATES if _has(topic_tables, r[0], r[1][0])), None)
    if rates is None:
        return attitude_of_angles(time_s[known], angles_rad)
    source, fields = rates
    rates_s, rate_columns = _table(path, topic_tables, source, *fields)
    rates_radps = [rate_columns[field].astype(np.float64) for field in fields]
    attitude = attitude_with_rates(time_s[known], angles_rad, rates_s, rates_radps)
    if not attitude.time_s.size:
        raise LogError(f"{path}: vehicle_attitude and {source} were never logged at the same time")
    return attitude


def _actuators(
    path: Path, topic_tables: Tables, options: OutputOptions, history: ParameterHistory
) -> Actuators:
    """Return the commands from the outputs."""
    name = next((topic for topic in _OUTPUTS if topic in topic_tables), _OUTPUTS[1])
    field = "control" if name in ("actuator_servos", "actuator_controls_0") else "output"
    time_s, columns = _table(path, topic_tables, name, f"{field}[0]")
    values = _outputs(columns, field)
    usual, convert = FIRST_THREE, _CONVERT.get(name, dict)
    if name == "actuator_controls_0":
        usual = _MIXER_INPUTS
    if name == "actuator_servos" and _MOTORS in topic_tables:
        motors = _table(path, topic_tables, _MOTORS, "control[0]")
        latest = np.searchsorted(motors.time_s, time_s, side="right") - 1
        held = _outputs(motors.columns, "control")[np.clip(latest, 0, None)]
        values, usual = np.concatenate([values[:, :SERVOS], held], axis=1), SERVOS_AND_MOTOR
    return actuator_commands(
        time_s, values, options, history, f"{path}: {name}", usual=usual, convert=convert
    )


def _outputs(columns: Mapping[str, NDArray[Any]], field: str) -> Array:
    """Return all outputs of a topic, shape (n, outputs)."""
    count = sum(column.startswith(f"{field}[") for column in columns)
    return np.stack([columns[f"{field}[{k}]"].astype(np.float64) for k in range(count)], axis=1)


def _has(topic_tables: Tables, name: str, field: str) -> bool:
    """Return whether a log has a field of a topic."""
    return name in topic_tables and field in topic_tables[name].columns


def _depth(path: Path, topic_tables: Tables, attitude_s: Array) -> Depth:
    """Return depth and its rate, by differences where the log has none.

    Zero at the times of the attitude in a log without depth.
    """
    source = next((d for d in _DEPTHS if _has(topic_tables, d[0], d[1])), None)
    if source is None:
        return zero_depth(attitude_s)
    name, field, factor = source
    time_s, columns = _table(path, topic_tables, name, field)
    known = usable(time_s, columns[field])
    time_s, depth_m = time_s[known], factor * columns[field][known].astype(np.float64)
    if field == "z" and "vz" in columns and np.all(np.isfinite(columns["vz"][known])):
        return Depth(time_s, depth_m, columns["vz"][known].astype(np.float64))
    return Depth(time_s, depth_m, derivative(time_s, depth_m))


def _velocity(path: Path, topic_tables: Tables, attitude: Attitude) -> Velocity:
    """Return the velocity of the estimator where it is valid, or else the receiver's speed."""
    if all(_has(topic_tables, _POSITION, field) for field in ("vx", "vy", "vz")):
        time_s, columns = _table(path, topic_tables, _POSITION, "vx", "vy", "vz")
        north, east, down = (columns[field].astype(np.float64) for field in ("vx", "vy", "vz"))
        valid = columns.get("v_xy_valid", np.ones(time_s.size)) != 0
        velocity = body_velocity(attitude, time_s[valid], north[valid], east[valid], down[valid])
        if velocity.time_s.size:
            return velocity
    if _has(topic_tables, _SATELLITE, "vel_m_s"):
        time_s, columns = _table(path, topic_tables, _SATELLITE, "vel_m_s")
        return ground_speed(time_s, columns["vel_m_s"].astype(np.float64))
    return Velocity()


def _specific_force(path: Path, topic_tables: Tables) -> SpecificForce:
    """Return the acceleration of the first of _ACCELEROMETERS."""
    for name, fields in _ACCELEROMETERS:
        if all(_has(topic_tables, name, field) for field in fields):
            time_s, columns = _table(path, topic_tables, name, *fields)
            return accelerometer(time_s, *(columns[f].astype(np.float64) for f in fields))
    return SpecificForce()


def _setpoints(topic_tables: Tables) -> Setpoints:
    """Return heading, pitch and depth setpoints; empty arrays without the topics."""
    nothing = np.empty(0)
    attitude_s, heading, pitch, depth_s, depth_m = nothing, nothing, nothing, nothing, nothing
    attitude, position = (topic_tables.get(name) for name in _SETPOINTS)
    if attitude and "q_d[3]" in attitude.columns:
        quaternion = [attitude.columns[f"q_d{part}"].astype(np.float64) for part in _QUATERNION]
        keep = usable(attitude.time_s, *quaternion)
        attitude_s = attitude.time_s[keep]
        _, pitch, heading = euler_rad(*(part[keep] for part in quaternion))
    if position and "z" in position.columns:
        keep = strictly_increasing(position.time_s)
        depth_s, depth_m = position.time_s[keep], position.columns["z"][keep].astype(np.float64)
    return Setpoints(
        attitude_time_s=attitude_s,
        heading_rad=np.unwrap(heading),
        pitch_rad=pitch,
        depth_time_s=depth_s,
        depth_m=depth_m,
    )
