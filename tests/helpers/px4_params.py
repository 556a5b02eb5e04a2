"""Parameters of a fake PX4 vehicle: integers are sent as the bytes of param_value.

Source: PX4-Autopilot, src/modules/mavlink/mavlink_parameters.cpp (PARAM_ENCODE_BYTEWISE).
"""

import struct

from mavlink_io.codec import Frame
from mavlink_io.request import RoomBytes, Send

INT32, REAL32 = 6, 9
"""MAV_PARAM_TYPE."""
_FORMATS = {INT32: "<i", REAL32: "<f"}


class Px4Params:
    """Answers the parameter protocol as PX4 does; ``types`` are the MAV_PARAM_TYPEs by name."""

    def __init__(self) -> None:
        self.values: dict[str, float] = {"BAT_N": -1, "MPC_XY_P": 0.5, "SYS_AUTOSTART": 4001}
        self.types = {"BAT_N": INT32, "MPC_XY_P": REAL32, "SYS_AUTOSTART": INT32}

    def feed(self, frame: Frame, send: Send, room: RoomBytes) -> None:
        message = frame.decode()
        if frame.name == "PARAM_REQUEST_LIST":
            for name in self.values:
                self._send_value(send, name)
        elif message.param_id in self.values:
            if frame.name == "PARAM_SET":
                self._set(message.param_id, message.param_value, message.param_type)
            self._send_value(send, message.param_id)

    def poll(self) -> None:
        """Send nothing: the list is sent at once."""

    def _set(self, name: str, field: float, kind: int) -> None:
        if kind == self.types[name]:
            (self.values[name],) = struct.unpack(_FORMATS[kind], struct.pack("<f", field))

    def _send_value(self, send: Send, name: str) -> None:
        kind = self.types[name]
        as_kind = int if kind == INT32 else float
        data = struct.pack(_FORMATS[kind], as_kind(self.values[name]))
        send(
            "PARAM_VALUE",
            param_id=name,
            param_value=struct.unpack("<f", data)[0],
            param_type=kind,
            param_count=len(self.values),
            param_index=sorted(self.values).index(name),
        )
