"""Identities of the autopilot: what tools for PX4, or for ArduPilot, expect of a vehicle.

The identity is chosen at the start. It changes what is sent and understood, and nothing of what the
vehicle does.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from autopilot.control.manual_control import Helm
from autopilot.telemetry import identity
from autopilot.telemetry.ardupilot import ARDUPILOT_STREAMS, STREAM_GROUPS
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.telemetry.identity import ARDUSUB_MODES, PX4_MODES, ModeTable
from autopilot.telemetry.streams import STREAMS, TelemetryStream
from mavlink_io.dialect import constant
from mavlink_io.vehicle_modes import ARDUPILOT


class Identity(NamedTuple):
    """Everything that differs between the autopilots that the vehicle identifies as."""

    autopilot: int
    """MAV_AUTOPILOT."""
    modes: ModeTable
    param_encoding: int
    """MAV_PROTOCOL_CAPABILITY bit for the encoding of integers."""
    streams: tuple[TelemetryStream, ...]
    """Telemetry table."""
    stream_groups: Mapping[int, tuple[int, ...]]
    """Message ids by MAV_DATA_STREAM; empty if REQUEST_DATA_STREAM changes nothing."""
    pilot_messages: Mapping[str, Callable[[Helm, Any, float], None]]
    """Method that takes a message of manual control, by message name."""
    mission_request: str
    """Message that requests an item of an uploaded plan."""
    setpoints_start_offboard: bool
    """Whether a set-point starts OFFBOARD in HOLD, as in ArduSub's GUIDED."""
    parameters: Mapping[str, float]
    """Default values of parameters that differ from the vehicle's own."""


_GENERIC = Identity(
    autopilot=constant("MAV_AUTOPILOT_GENERIC"),
    modes=PX4_MODES,
    param_encoding=identity.BYTEWISE,
    streams=STREAMS,
    stream_groups={},
    pilot_messages={"MANUAL_CONTROL": Helm.take},
    mission_request="MISSION_REQUEST_INT",
    setpoints_start_offboard=False,
    parameters={},
)
IDENTITIES = {
    AutopilotId.GENERIC: _GENERIC,
    AutopilotId.PX4: _GENERIC._replace(autopilot=constant("MAV_AUTOPILOT_PX4")),
    AutopilotId.ARDUPILOT: Identity(
        autopilot=ARDUPILOT,
        modes=ARDUSUB_MODES,
        param_encoding=identity.C_CAST,
        streams=ARDUPILOT_STREAMS,
        stream_groups=STREAM_GROUPS,
        pilot_messages={
            "MANUAL_CONTROL": Helm.take_ardusub,
            "RC_CHANNELS_OVERRIDE": Helm.take_channels,
        },
        mission_request="MISSION_REQUEST",
        setpoints_start_offboard=True,
        parameters={"MIS_SEQ0_HOME": 1.0},
    ),
}
"""Identity by option ``--autopilot-id``."""
