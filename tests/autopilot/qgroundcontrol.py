"""QGroundControl's side of the protocols.

Source: github.com/mavlink/qgroundcontrol, 2026.
"""

import math
import struct
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io.records import GpsFix
from tests.helpers.fake_hil import Harness, only

FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
REQUEST_MESSAGE, AUTOPILOT, MISSION = 512, 1, 0


class Connection(NamedTuple):
    """A vehicle at the surface and a QGroundControl that has received its heartbeat."""

    harness: Harness
    autopilot: AutopilotId

    def ask(self, message: Any) -> list[Any]:
        return self.harness.ask(message)

    def command(self, number: int, *parameters: float) -> list[Any]:
        """Send a command like ``Vehicle::sendMavCommand``: unused parameters are zero."""
        filled = [*parameters, *[0.0] * (7 - len(parameters))]
        return self.ask(mavlink.MAVLink_command_long_message(1, AUTOPILOT, number, 0, *filled))

    def message(self, number: int, parameter: float = 0.0) -> Any:
        """Request a message like ``Vehicle::requestMessage`` and return it."""
        received = self.command(REQUEST_MESSAGE, number, parameter)
        acknowledgement = only(received, "COMMAND_ACK")
        assert (acknowledgement.command, acknowledgement.result) == (
            REQUEST_MESSAGE,
            mavlink.MAV_RESULT_ACCEPTED,
        )
        (answer,) = [
            m for m in received if m.get_msgId() == number or m.get_type() == f"UNKNOWN_{number}"
        ]
        return answer


def connect(autopilot: AutopilotId) -> Connection:
    """Return the connection after the first heartbeat and two seconds at the surface."""
    harness = Harness(autopilot=autopilot)
    harness.station.transmit(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
    harness.serve()
    harness.tick(100, fix=FIX)
    harness.serve()
    harness.station.pop_received()
    return Connection(harness, autopilot)


class Ftp:
    """``FTPManager``: open, read in bursts, reset the sessions."""

    def __init__(self, qgc: Connection) -> None:
        self._qgc, self._sequence = qgc, 0

    def ask(
        self,
        opcode: int,
        session: int = 0,
        offset: int = 0,
        data: bytes = b"",
        size: int | None = None,
    ) -> list[Any]:
        head = struct.pack(
            "<HBBBBBxI",
            self._sequence,
            session,
            opcode,
            len(data) if size is None else size,
            0,
            0,
            offset,
        )
        received = self._qgc.ask(
            mavlink.MAVLink_file_transfer_protocol_message(
                0, 1, AUTOPILOT, (head + data).ljust(251, b"\0")
            )
        )
        answers = [bytes(m.payload) for m in received if m.get_type() == "FILE_TRANSFER_PROTOCOL"]
        for answer in answers:
            assert answer[5] == opcode, "hdr.req_opcode, otherwise the reply is ignored"
            assert struct.unpack_from("<H", answer)[0] >= self._sequence + 1, "hdr.seqNumber"
        self._sequence += 2
        return answers

    def download(self, path: str) -> bytes:
        """Read a file.

        Like ``_openFileROBegin``, ``_burstReadFileBegin``, ``_resetSessionsBegin``.
        """
        (opened,) = self.ask(mavlink.MAV_FTP_OPCODE_OPENFILERO, data=path.encode())
        assert (opened[3], opened[4]) == (mavlink.MAV_FTP_OPCODE_ACK, 4), (
            "ack, with the size of the file"
        )
        session, size = opened[2], struct.unpack_from("<I", opened, 12)[0]
        content, over = b"", False
        while not over:
            for packet in self.ask(
                mavlink.MAV_FTP_OPCODE_BURSTREADFILE, session, len(content), size=239
            ):
                if packet[3] == mavlink.MAV_FTP_OPCODE_NAK:
                    assert packet[12] == mavlink.MAV_FTP_ERR_EOF
                    over = True
                    continue
                assert packet[2] == session
                assert struct.unpack_from("<I", packet, 8)[0] == len(content), (
                    "a gap would need single reads"
                )
                content += packet[12 : 12 + packet[4]]
        (reset,) = self.ask(mavlink.MAV_FTP_OPCODE_RESETSESSION)
        assert reset[3] == mavlink.MAV_FTP_OPCODE_ACK
        assert len(content) == size
        return content


def legs() -> list[tuple[Any, ...]]:
    """Return frame, command, param1 to 4, x, y, z as the plan view writes them."""
    nan = math.nan
    return [
        (2, 178, 1, -1, 40, 0, 0, 0, 0),
        (3, 16, 0, 0, 0, nan, 415_010_000, -707_000_000, -3.0),
        (2, 93, 10, -1, -1, -1, 0, 0, 0),
    ]


def write_mission(qgc: Connection) -> list[Any]:
    """Send a mission like ``PlanManager::_handleMissionRequest``; return the last reply."""
    items = legs()
    received = qgc.ask(mavlink.MAVLink_mission_count_message(1, AUTOPILOT, len(items), MISSION))
    for n, (frame, command, p1, p2, p3, p4, x, y, z) in enumerate(items):
        request = only(received, "MISSION_REQUEST_INT")
        assert (request.seq, request.mission_type) == (n, MISSION)
        received = qgc.ask(
            mavlink.MAVLink_mission_item_int_message(
                1, AUTOPILOT, n, frame, command, int(n == 0), 1, p1, p2, p3, p4, x, y, z, MISSION
            )
        )
    return received
