"""Encoding of the payload of a FILE_TRANSFER_PROTOCOL message.

Source: https://mavlink.io/en/services/ftp.html, "Payload Format".
"""

import struct
import zlib
from typing import NamedTuple

from mavlink_io.dialect import constant

MAX_DATA = 239
"""Maximum number of data bytes (file content or path) in one message."""
PAYLOAD_LENGTH = 251
"""Bytes of a payload at full length."""

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
    """Number of the packet, modulo 65,536; an answer has the number of its request plus 1."""
    session: int
    """Number of an open file."""
    opcode: int
    """MAV_FTP_OPCODE."""
    size: int = 0
    """Number of data bytes; in a request to read, the number of bytes to read."""
    requested: int = 0
    """Opcode of the request, in an answer."""
    burst_complete: int = 0
    """1 in the last packet of a burst."""
    offset: int = 0
    """Position in the file in bytes, or in a directory listing in entries."""
    data: bytes = b""

    def encode(self) -> bytes:
        """Return the payload at full length.

        Returns
        -------
        bytes
            ``PAYLOAD_LENGTH`` bytes.

        Raises
        ------
        ValueError
            The packet has more than ``MAX_DATA`` bytes of data.
        """
        if len(self.data) > MAX_DATA:
            raise ValueError(f"{len(self.data)} bytes of data; a message holds {MAX_DATA}")
        return (_HEAD.pack(*self[:7]) + self.data).ljust(PAYLOAD_LENGTH, b"\0")


def decode(payload: bytes) -> Packet:
    """Return the packet in a payload.

    Parameters
    ----------
    payload : bytes
        Payload of any length and content; missing bytes are read as zeros.

    Returns
    -------
    Packet
        The packet; its data may be shorter than ``size``.
    """
    head = _HEAD.unpack_from(payload.ljust(_HEAD.size, b"\0"))
    return Packet._make((*head, payload[_HEAD.size : _HEAD.size + head[3]]))


def next_sequence(sequence: int) -> int:
    """Return the sequence number after ``sequence``, modulo 65,536."""
    return (sequence + 1) & 0xFFFF


def crc32(data: bytes, crc: int = 0) -> int:
    """Return MAVLink's CRC-32 of some data.

    Parameters
    ----------
    data : bytes
        The data.
    crc : int
        CRC of the data before, to continue it.

    Returns
    -------
    int
        The CRC-32.

    Notes
    -----
    It has zlib's polynomial, but starts at zero and is not inverted at the end. Source:
    https://mavlink.io/en/guide/crc.html.
    """
    return zlib.crc32(data, crc ^ _ALL_ONES) ^ _ALL_ONES
