"""Channels of the onboard log: messages per tick, slower messages, and messages from ground.

Each tick logs what identification and the analysis of a dive need: raw sensors, estimate,
actuators, and the control-loop signals with the test signal. Slower messages log set-points and
status.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from autopilot.comms import offboard_messages
from autopilot.control import actuator_test
from autopilot.control.types import Trace
from autopilot.reports import SteadyReport, TickReport
from autopilot.telemetry import tick_messages
from autopilot.telemetry.identity import COMPONENT
from autopilot.telemetry.streams import (
    STREAMS,
    TRACE_ID,
    TRACE_NAME,
    TelemetryStream,
)
from mavlink_io import dialect
from mavlink_io.logging.mavlink_log import Column

SLOT_US = 100_000
"""Unit of the period of slow channels."""
_STREAMS = {stream.message.name: stream for stream in STREAMS}


class SlowChannel(NamedTuple):
    """A telemetry message that is logged every ``slots`` times SLOT_US."""

    stream: TelemetryStream
    slots: int


SLOW_CHANNELS = tuple(
    SlowChannel(_STREAMS[name], slots)
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
        "RC_CHANNELS_OVERRIDE",
        "MISSION_COUNT",
        "MISSION_ITEM_INT",
        "MISSION_ITEM",
        "MISSION_CLEAR_ALL",
        "MISSION_SET_CURRENT",
        "MISSION_WRITE_PARTIAL_LIST",
        "SET_HOME_POSITION",
        "SET_GPS_GLOBAL_ORIGIN",
        *offboard_messages.MESSAGE_IDS,
    )
)
"""Messages from ground that can change the vehicle's behaviour; signing keys are never logged."""

_IMU = dialect.by_name("HIL_SENSOR")


def columns(system: int, sensors_component: int) -> tuple[Column, ...]:
    """Return the columns of every tick: HIL_SENSOR of its sender, the others of the autopilot."""
    own = [
        ("ATTITUDE", "I6f"),
        ("LOCAL_POSITION_NED", "I6f"),
        ("ACTUATOR_OUTPUT_STATUS", f"QI{actuator_test.CHANNELS}f"),
        ("DEBUG_FLOAT_ARRAY", f"QH10s{len(Trace._fields)}f"),
    ]
    sensors = Column(
        system=system, component=sensors_component, message=_IMU, formats=f"{_IMU.struct.size}s"
    )
    return sensors, *(
        Column(system=system, component=COMPONENT, message=dialect.by_name(name), formats=layout)
        for name, layout in own
    )


def fields(report: TickReport | SteadyReport, sensors: bytes) -> Sequence[tuple[Any, ...]]:
    """Return the fields of each column for one tick.

    ``sensors`` is the payload of HIL_SENSOR, with or without trailing zeros.
    """
    time_us = report.time_us
    return (
        (sensors,),
        tick_messages.attitude(report),
        tick_messages.local_position(report),
        (
            time_us,
            tick_messages.ACTUATORS_IN_USE,
            *report.actuators.controls[: actuator_test.CHANNELS],
        ),
        (time_us, TRACE_ID, TRACE_NAME, *report.trace),
    )


def trace_names() -> dict[str, str]:
    """Return the name of each number of the TRACE array by its index."""
    return {str(index): name for index, name in enumerate(Trace._fields)}
