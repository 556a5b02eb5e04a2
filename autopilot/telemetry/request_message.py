"""Every message that can be asked for once: the telemetry, and what is only told when somebody
wants to know it."""

from autopilot.telemetry import component_metadata, identity, streams
from autopilot.telemetry.encoding import Builder, boot_ms
from autopilot.telemetry.identity import AutopilotId
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.dialect import MessageType, Values


class MessageBuilder:
    """Makes the fields of messages in wire order from the vehicle as it is now."""

    def __init__(self, vehicle: Vehicle, autopilot: AutopilotId) -> None:
        self._vehicle = vehicle
        rare: dict[str, Builder] = {
            "HEARTBEAT": lambda s: identity.heartbeat(s.state, autopilot),
            "AUTOPILOT_VERSION": lambda s: identity.autopilot_version(vehicle.system),
            "COMPONENT_METADATA": lambda s: component_metadata.component_metadata(boot_ms(s)),
            "GPS_GLOBAL_ORIGIN": streams.global_origin,
        }
        self._rare = {dialect.by_name(name).message_id: build for name, build in rare.items()}

    def build(self, message: MessageType) -> tuple[Values, ...]:
        """The fields of a message, several times where it takes several; empty where it cannot be
        asked for."""
        snapshot = self._vehicle.snapshot()
        if build := self._rare.get(message.message_id):
            return (build(snapshot),)
        stream = streams.BY_ID.get(message.message_id)
        return () if stream is None else tuple(build(snapshot) for build in stream.builders)
