"""What a log holds: what every tick writes, what is written now and then, and which of ground's
words are kept.

At full rate stands what identification and a second look at a dive need: the sensors as they came,
the estimate, the actuators, and the inside of the loops with the test signal. The rest tells what
was wanted, and how the vehicle was."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from autopilot.comms import offboard_messages
from autopilot.control import actuator_test
from autopilot.control.types import Trace
from autopilot.telemetry import streams
from autopilot.telemetry.identity import COMPONENT
from autopilot.telemetry.streams import (
    ACTUATORS_IN_USE,
    STREAMS,
    TRACE_ID,
    TRACE_NAME,
    TelemetryStream,
)
from autopilot.vehicle import Snapshot
from mavlink_io import dialect
from mavlink_io.logging.mavlink_log import Column

SLOT_US = 100_000
_STREAMS = {stream.message.name: stream for stream in STREAMS}


class Slow(NamedTuple):
    """A message of the telemetry that is written every so many slots."""

    stream: TelemetryStream
    slots: int


SLOW = tuple(
    Slow(_STREAMS[name], slots)
    for name, slots in (
        ("ATTITUDE_TARGET", 1),
        ("POSITION_TARGET_LOCAL_NED", 1),
        ("NAV_CONTROLLER_OUTPUT", 5),
        ("ODOMETRY", 5),
        ("GLOBAL_POSITION_INT", 5),
        ("SYS_STATUS", 10),
        ("EXTENDED_SYS_STATE", 10),
        ("MISSION_CURRENT", 10),
        ("CURRENT_MODE", 20),
        ("BATTERY_STATUS", 20),
        ("HOME_POSITION", 50),
    )
)
LOGGED_FROM_GROUND = frozenset(
    dialect.by_name(name).message_id
    for name in (
        "COMMAND_LONG",
        "COMMAND_INT",
        "COMMAND_CANCEL",
        "SET_MODE",
        "PARAM_SET",
        "MANUAL_CONTROL",
        "MISSION_COUNT",
        "MISSION_ITEM_INT",
        "MISSION_CLEAR_ALL",
        "MISSION_SET_CURRENT",
        "MISSION_WRITE_PARTIAL_LIST",
        "SET_HOME_POSITION",
        "SET_GPS_GLOBAL_ORIGIN",
        *offboard_messages.MESSAGE_IDS,
    )
)
"""What ground says that can change what the vehicle does, but for keys: those stand in no log."""

_IMU = dialect.by_name("HIL_SENSOR")


def columns(system: int, sensors_component: int) -> tuple[Column, ...]:
    """The messages of every tick: the sensors by who sent them, the rest by the autopilot."""
    own = [
        ("ATTITUDE", "I6f"),
        ("LOCAL_POSITION_NED", "I6f"),
        ("ACTUATOR_OUTPUT_STATUS", f"QI{actuator_test.CHANNELS}f"),
        ("DEBUG_FLOAT_ARRAY", f"QH10s{len(Trace._fields)}f"),
    ]
    sensors = Column(system, sensors_component, _IMU, f"{_IMU.struct.size}s")
    return sensors, *(
        Column(system, COMPONENT, dialect.by_name(name), given) for name, given in own
    )


def fields(snapshot: Snapshot, sensors: bytes) -> Sequence[tuple[Any, ...]]:
    """One tick's fields of each column. ``sensors`` is the payload that came, trailing zeros cut
    off or not."""
    time_us = snapshot.state.time_us
    return (
        (sensors,),
        streams.attitude(snapshot),
        streams.local_position(snapshot),
        (time_us, ACTUATORS_IN_USE, *snapshot.actuators.controls[: actuator_test.CHANNELS]),
        (time_us, TRACE_ID, TRACE_NAME, *snapshot.trace),
    )


def trace_names() -> dict[str, str]:
    """What each number of the TRACE array is, by its place."""
    return {str(place): name for place, name in enumerate(Trace._fields)}
