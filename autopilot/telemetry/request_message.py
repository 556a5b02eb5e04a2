"""Messages that ground can request once: all telemetry, and messages sent only on request."""

from autopilot.identities import Identity
from autopilot.telemetry import component_metadata, streams
from autopilot.telemetry.encoding import Builder, boot_ms
from autopilot.telemetry.high_latency import high_latency
from autopilot.telemetry.identity import autopilot_version, heartbeat
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.dialect import MessageType, Values


class MessageBuilder:
    """Builds the fields of messages in wire order from the present state of the vehicle."""

    def __init__(self, vehicle: Vehicle, identity: Identity) -> None:
        self._vehicle = vehicle
        on_request: dict[str, Builder] = {
            "HEARTBEAT": lambda s: heartbeat(s.state, identity.autopilot, identity.modes),
            "AUTOPILOT_VERSION": lambda s: autopilot_version(
                vehicle.system, identity.param_encoding
            ),
            "COMPONENT_METADATA": lambda s: component_metadata.component_metadata(boot_ms(s)),
            "HIGH_LATENCY2": lambda s: high_latency(s, identity.autopilot, identity.modes),
            "GPS_GLOBAL_ORIGIN": streams.global_origin,
        }
        self._streams = {row.message.message_id: row for row in identity.streams}
        self._on_request = {
            dialect.by_name(name).message_id: build for name, build in on_request.items()
        }

    def build(self, message: MessageType) -> tuple[Values, ...]:
        """Return the fields of each message of this type; empty when it cannot be requested."""
        snapshot = self._vehicle.snapshot()
        if build := self._on_request.get(message.message_id):
            return (build(snapshot),)
        stream = self._streams.get(message.message_id)
        return () if stream is None else tuple(build(snapshot) for build in stream.builders)
