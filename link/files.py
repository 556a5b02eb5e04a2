"""MAVLink FTP, as far as a vehicle without files needs it: every request is answered at once, none with a file.

Clients that prefer a file (MAVProxy asks for ``@PARAM/param.pck`` first) fall back at the first NAK, and wait for
seconds when there is none. https://mavlink.io/en/services/ftp.html
"""

import struct
from typing import NamedTuple

from link.codec import Frame
from link.dialect import constant
from link.exchange import Send

ACK, NAK = constant("MAV_FTP_OPCODE_ACK"), constant("MAV_FTP_OPCODE_NAK")
END_OF_FILE = constant("MAV_FTP_ERR_EOF")
FILE_NOT_FOUND = constant("MAV_FTP_ERR_FILENOTFOUND")
FILE_PROTECTED = constant("MAV_FTP_ERR_FILEPROTECTED")
INVALID_SESSION = constant("MAV_FTP_ERR_INVALIDSESSION")
UNKNOWN_COMMAND = constant("MAV_FTP_ERR_UNKNOWNCOMMAND")

_HEADER = struct.Struct("<HBBBBBxI")
_PAYLOAD_LENGTH = 251
_ENDINGS = frozenset(constant(f"MAV_FTP_OPCODE_{name}") for name in ("NONE", "TERMINATESESSION", "RESETSESSION"))
_REFUSALS = {
    constant(f"MAV_FTP_OPCODE_{name}"): error
    for names, error in (
        (("OPENFILERO", "CALCFILECRC"), FILE_NOT_FOUND),
        (("READFILE", "BURSTREADFILE", "WRITEFILE"), INVALID_SESSION),
        (
            ("CREATEFILE", "REMOVEFILE", "CREATEDIRECTORY", "REMOVEDIRECTORY", "OPENFILEWO", "TRUNCATEFILE", "RENAME"),
            FILE_PROTECTED,
        ),
    )
    for name in names
}
_LIST = constant("MAV_FTP_OPCODE_LISTDIRECTORY")


class Request(NamedTuple):
    """The head of an FTP payload, in wire order."""

    sequence: int
    session: int
    opcode: int
    size: int
    requested: int
    burst_complete: int
    offset: int


class FileServer:
    """A directory without files."""

    hears = frozenset(("FILE_TRANSFER_PROTOCOL",))

    def feed(self, frame: Frame, send: Send) -> None:
        """Answer one request that is addressed to this vehicle."""
        payload = bytes(frame.decode().payload)
        request = Request._make(_HEADER.unpack_from(payload))
        if request.opcode in (ACK, NAK):
            return
        path = payload[_HEADER.size : _HEADER.size + request.size].split(b"\0", 1)[0]
        error = _refusal(request.opcode, path)
        answer = _HEADER.pack(
            (request.sequence + 1) & 0xFFFF,
            request.session,
            NAK if error else ACK,
            1 if error else 0,
            request.opcode,
            0,
            request.offset,
        )
        send(
            "FILE_TRANSFER_PROTOCOL",
            target_network=0,
            target_system=frame.system,
            target_component=frame.component,
            payload=(answer + bytes((error,))).ljust(_PAYLOAD_LENGTH, b"\0"),
        )


def _refusal(opcode: int, path: bytes) -> int:
    """The MAV_FTP_ERR that answers a request; 0 where there is nothing to refuse."""
    if opcode in _ENDINGS:
        return 0
    if opcode == _LIST:
        return END_OF_FILE if path in (b"", b"/") else FILE_NOT_FOUND
    return _REFUSALS.get(opcode, UNKNOWN_COMMAND)
