"""Codec of the messages that both ends of a lockstep link exchange in every tick.

Header and fields of such a frame are packed and unpacked in one call. Whatever is not exactly one
unsigned MAVLink 2 frame of the expected message is left to ``codec.Framer``.
"""

from __future__ import annotations

import struct
from typing import Any

from fastcrc import crc16

from mavlink_io.codec import MAGIC_V2, OVERHEAD, encode_payload
from mavlink_io.dialect import MessageType

SEQUENCE, SENDER, FIELDS = 4, slice(5, 7), 9
"""Indices in a decoded frame: sequence number, system and component id, first field."""
_MAGIC, _LENGTH, _FLAGS, _NUMBER = 0, 1, 2, slice(7, 9)
_HEAD = "<BBBBBBBHB"
"""Magic byte, payload length, two flags, sequence, sender and the 24-bit message number."""
HEAD_LENGTH, CRC_LENGTH = 10, 2
"""Bytes of a frame before and after its payload."""
_crc = crc16.mcrf4xx


class FixedFrame:
    """Codec of one message.

    Parameters
    ----------
    message : MessageType
        Type of the message. Elements of its arrays count as fields here.
    """

    def __init__(self, message: MessageType) -> None:
        self.message = message
        self.pack = message.struct.pack
        """Pack the fields into a payload at full length."""
        whole = struct.Struct(_HEAD + message.struct.format.removeprefix("<"))
        self._unpack, self._length = whole.unpack, whole.size
        number = message.message_id
        self._number = number & 0xFFFF, number >> 16

    def encode(
        self,
        fields: tuple[Any, ...],
        sequence: int,
        system: int,
        component: int,
        flags: int = 0,
    ) -> bytes:
        """Encode a frame, as ``codec.encode`` does.

        Parameters
        ----------
        fields : tuple
            Fields in wire order, arrays element by element.
        sequence : int
            Sequence number, 0 to 255.
        system, component : int
            Ids of the sender, 0 to 255.
        flags : int
            Incompatibility flags.

        Returns
        -------
        bytes
            The frame without a signature; trailing zeros of its payload are cut off.
        """
        payload = self.pack(*fields)
        return encode_payload(self.message, payload, sequence, system, component, flags)

    def decode(self, data: bytes) -> tuple[Any, ...] | None:
        """Decode bytes that are expected to be one frame of this message.

        Parameters
        ----------
        data : bytes
            Received bytes.

        Returns
        -------
        tuple or None
            Header and fields, at the indices `SEQUENCE`, `SENDER` and `FIELDS`; None unless the
            bytes are exactly one unsigned MAVLink 2 frame of this message with a correct CRC.
        """
        head = data[:-CRC_LENGTH]
        if len(head) > self._length:
            return None
        decoded = self._unpack(head.ljust(self._length, b"\0"))
        if (
            decoded[_NUMBER] != self._number
            or decoded[_MAGIC] != MAGIC_V2
            or decoded[_FLAGS]
            or decoded[_LENGTH] + OVERHEAD != len(data)
        ):
            return None
        is_whole = _crc(head[1:] + self.message.crc_seed) == data[-2] | data[-1] << 8
        return decoded if is_whole else None
