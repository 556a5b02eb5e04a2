"""The payload of a FILE_TRANSFER_PROTOCOL message."""

import struct
import zlib
from typing import NamedTuple

from mavlink_io.dialect import constant

MAX_DATA = 239
"""Bytes of a file, or of a path, that one message holds."""
PAYLOAD_LENGTH = 251

ACK, NAK = constant("MAV_FTP_OPCODE_ACK"), constant("MAV_FTP_OPCODE_NAK")
NONE = constant("MAV_FTP_OPCODE_NONE")
TERMINATE, RESET = (
    constant("MAV_FTP_OPCODE_TERMINATESESSION"),
    constant("MAV_FTP_OPCODE_RESETSESSION"),
)
LIST, OPEN = constant("MAV_FTP_OPCODE_LISTDIRECTORY"), constant("MAV_FTP_OPCODE_OPENFILERO")
READ, BURST = constant("MAV_FTP_OPCODE_READFILE"), constant("MAV_FTP_OPCODE_BURSTREADFILE")
CRC = constant("MAV_FTP_OPCODE_CALCFILECRC")
WRITE_OPCODES = frozenset(
    constant(f"MAV_FTP_OPCODE_{name}")
    for name in (
        "CREATEFILE",
        "WRITEFILE",
        "REMOVEFILE",
        "CREATEDIRECTORY",
        "REMOVEDIRECTORY",
        "OPENFILEWO",
        "TRUNCATEFILE",
        "RENAME",
    )
)

FAIL, INVALID_SIZE = constant("MAV_FTP_ERR_FAIL"), constant("MAV_FTP_ERR_INVALIDDATASIZE")
INVALID_SESSION, NO_SESSIONS = (
    constant("MAV_FTP_ERR_INVALIDSESSION"),
    constant("MAV_FTP_ERR_NOSESSIONSAVAILABLE"),
)
END_OF_FILE, UNKNOWN_COMMAND = constant("MAV_FTP_ERR_EOF"), constant("MAV_FTP_ERR_UNKNOWNCOMMAND")
PROTECTED, NOT_FOUND = constant("MAV_FTP_ERR_FILEPROTECTED"), constant("MAV_FTP_ERR_FILENOTFOUND")

_HEAD = struct.Struct("<HBBBBBxI")
_ALL_ONES = 0xFFFF_FFFF


class Packet(NamedTuple):
    """One request or answer."""

    sequence: int
    session: int
    opcode: int
    size: int = 0
    """Of the data; in a request to read, how much is wanted."""
    requested: int = 0
    """In an answer: the opcode that it answers."""
    burst_complete: int = 0
    offset: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """The payload at full length. Raises ValueError for more data than fits."""
        if len(self.data) > MAX_DATA:
            raise ValueError(f"{len(self.data)} bytes of data; a message holds {MAX_DATA}")
        return (_HEAD.pack(*self[:7]) + self.data).ljust(PAYLOAD_LENGTH, b"\0")


def decode(payload: bytes) -> Packet:
    """The packet in a payload, which may be of any length and content."""
    head = _HEAD.unpack_from(payload.ljust(_HEAD.size, b"\0"))
    return Packet._make((*head, payload[_HEAD.size : _HEAD.size + head[3]]))


def next_sequence(sequence: int) -> int:
    return (sequence + 1) & 0xFFFF


def crc32(data: bytes, crc: int = 0) -> int:
    """MAVLink's CRC-32 of some data, or of it and all that gave ``crc``. It starts at zero and is
    not inverted at its end (https://mavlink.io/en/guide/crc.html), unlike zlib's, which is
    otherwise the same."""
    return zlib.crc32(data, crc ^ _ALL_ONES) ^ _ALL_ONES
