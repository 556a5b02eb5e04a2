"""PX4's logs (.ulg), read with pyulog. Messages are PX4's uORB topics in FRD, NED and radians."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from sysid.data.dataset import (
    Actuators,
    Attitude,
    Depth,
    Log,
    LogError,
    LogEvent,
    Setpoints,
)
from sysid.data.events import parse_text
from sysid.data.readers.samples import (
    FileDamage,
    MessageColumns,
    clock_steps,
    euler_rad,
    foreign_log,
    format_damage,
    sample_nearest,
    strictly_increasing,
)
from sysid.data.readers.servo_channels import OutputOptions, actuator_commands
from sysid.data.readers.ulog_recovery import keep_sound_messages, refuse_large_formats

_OUTPUTS = ("actuator_outputs_sim", "actuator_outputs")
"""Topics of the outputs: fractions to the simulator, or pulses to the servos."""
_TOPICS = ("vehicle_attitude", "vehicle_angular_velocity", "vehicle_local_position")
_SETPOINTS = ("vehicle_attitude_setpoint", "vehicle_local_position_setpoint")
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
    log, damage = _parse(path, [*_TOPICS, *_OUTPUTS, *_SETPOINTS])
    topic_tables = _tables(log)
    parameters = {str(name): float(value) for name, value in log.initial_parameters.items()}
    attitude, actuators = (
        _attitude(path, topic_tables),
        _actuators(path, topic_tables, options, parameters),
    )
    depth = _depth(path, topic_tables)
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
        attitude,
        actuators,
        depth,
        _setpoints(topic_tables),
        events,
        parameters,
        steps,
        format_damage(damage, topic_tables[_TOPICS[0]].time_s),
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
        data, damage = keep_sound_messages(path.read_bytes())
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


def _tables(log: Any) -> Tables:
    """Return the topics; times are ``timestamp_sample`` if present, else ``timestamp``."""
    topic_tables = {}
    for topic in log.data_list:
        sampled = topic.data.get("timestamp_sample")
        if sampled is None and "timestamp" not in topic.data:
            continue  # in a damaged file the format of the topic, and so its time, can be missing
        stamps = sampled if sampled is not None and np.all(sampled > 0) else topic.data["timestamp"]
        name = f"{topic.name}.{topic.multi_id}" if topic.multi_id else topic.name
        topic_tables[name] = MessageColumns(stamps * 1e-6, topic.data)
    return topic_tables


def _table(path: Path, topic_tables: Tables, name: str, *columns: str) -> MessageColumns:
    """Return a topic in order of time; raise LogError if it or one of its fields is missing."""
    missing = [
        column
        for column in columns
        if name not in topic_tables or column not in topic_tables[name].columns
    ]
    if missing:
        needed = ", ".join((*_TOPICS, _OUTPUTS[1]))
        raise LogError(f"{path}: holds no {name}.{missing[0]}; identification needs {needed}")
    time_s, values = topic_tables[name]
    keep = strictly_increasing(time_s)
    return MessageColumns(time_s[keep], {column: array[keep] for column, array in values.items()})


def _attitude(path: Path, topic_tables: Tables) -> Attitude:
    """Return attitude and body rates."""
    time_s, columns = _table(
        path, topic_tables, "vehicle_attitude", *(f"q{part}" for part in _QUATERNION)
    )
    rates = _table(path, topic_tables, "vehicle_angular_velocity", "xyz[0]", "xyz[1]", "xyz[2]")
    rates_radps = [rates.columns[f"xyz[{k}]"].astype(np.float64) for k in range(3)]
    near = sample_nearest(time_s, rates.time_s, rates_radps[0])[0]
    if not near.any():
        raise LogError(
            f"{path}: vehicle_attitude and vehicle_angular_velocity were never logged at the same"
            " time"
        )
    p, q, r = (sample_nearest(time_s, rates.time_s, values)[1][near] for values in rates_radps)
    roll, pitch, yaw = euler_rad(
        *(columns[f"q{part}"][near].astype(np.float64) for part in _QUATERNION)
    )
    return Attitude(
        time_s=time_s[near],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=np.unwrap(yaw),
        p_radps=p,
        q_radps=q,
        r_radps=r,
    )


def _actuators(
    path: Path, topic_tables: Tables, options: OutputOptions, parameters: dict[str, float]
) -> Actuators:
    """Return the commands from the outputs."""
    name = next((topic for topic in _OUTPUTS if topic in topic_tables), _OUTPUTS[1])
    time_s, columns = _table(path, topic_tables, name, "output[0]")
    count = sum(column.startswith("output[") for column in columns)
    values = np.stack([columns[f"output[{k}]"].astype(np.float64) for k in range(count)], axis=1)
    return actuator_commands(time_s, values, options, parameters, f"{path}: {name}")


def _depth(path: Path, topic_tables: Tables) -> Depth:
    """Return depth and its rate from vehicle_local_position."""
    time_s, columns = _table(path, topic_tables, "vehicle_local_position", "z", "vz")
    return Depth(time_s, columns["z"].astype(np.float64), columns["vz"].astype(np.float64))


def _setpoints(topic_tables: Tables) -> Setpoints:
    """Return heading, pitch and depth setpoints; empty arrays without the topics."""
    nothing = np.empty(0)
    attitude_s, heading, pitch, depth_s, depth_m = nothing, nothing, nothing, nothing, nothing
    attitude, position = (topic_tables.get(name) for name in _SETPOINTS)
    if attitude and "q_d[3]" in attitude.columns:
        keep = strictly_increasing(attitude.time_s)
        attitude_s = attitude.time_s[keep]
        quaternion = (
            attitude.columns[f"q_d{part}"][keep].astype(np.float64) for part in _QUATERNION
        )
        _, pitch, heading = euler_rad(*quaternion)
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
