"""MAVLink 2 frames: bytes to frames and back, several times faster than pymavlink's own class, byte
for byte equal.

The lockstep link and full-rate telemetry spend most of their time here; everything the format needs
of a message (packing, CRC seed) comes from the dialect. MAVLink 1 frames are read too, as old
radios still send them."""

import struct
from collections.abc import Container, Hashable
from typing import Any, NamedTuple

from fastcrc import crc16

from mavlink_io import dialect
from mavlink_io.dialect import Message, MessageType
from mavlink_io.framing import LARGEST_FRAME as LARGEST_FRAME
from mavlink_io.framing import (
    MAGIC_V1,
    MAGIC_V2,
    SIGNATURE_LENGTH,
    frame_length,
    next_magic,
)
from mavlink_io.framing import OVERHEAD as OVERHEAD
from mavlink_io.framing import SIGNED_FLAG as SIGNED_FLAG

MAX_PARTIAL_STREAMS = 64
"""Streams of which a framer keeps the begun frame, at most LARGEST_FRAME bytes each."""

_HEAD = struct.Struct("<BBBBBBHB")
"""What stands between the magic byte and the payload: six bytes, and a message number of three."""
_CRC = struct.Struct("<H")
_crc = crc16.mcrf4xx


class Frame(NamedTuple):
    """One received frame whose CRC was right. ``payload`` may lack trailing zeros, as MAVLink 2
    cuts them off."""

    system: int
    component: int
    message_id: int
    sequence: int
    payload: bytes
    raw: bytes

    @property
    def name(self) -> str:
        known = dialect.by_id(self.message_id)
        return known.name if known else f"UNKNOWN_{self.message_id}"

    def decode(self) -> Message:
        """The message's fields as a namedtuple; KeyError for a message that the dialect lacks."""
        known = dialect.by_id(self.message_id)
        if known is None:
            raise KeyError(f"the MAVLink dialect has no message number {self.message_id}")
        return known.unpack(self.payload)

    @property
    def signature(self) -> bytes:
        """The signature's 13 bytes, b"" for a frame without one."""
        signed = self.raw[0] == MAGIC_V2 and self.raw[2] & SIGNED_FLAG
        return self.raw[-SIGNATURE_LENGTH:] if signed else b""


def largest_frame(message: MessageType) -> int:
    """Bytes of a message's longest frame, signature and all."""
    return OVERHEAD + message.struct.size + SIGNATURE_LENGTH


def encode(
    message: MessageType,
    values: tuple[Any, ...],
    sequence: int,
    system: int,
    component: int,
    flags: int = 0,
) -> bytes:
    """One MAVLink 2 frame of a message's fields in wire order. With SIGNED_FLAG a signature has to
    follow it."""
    payload = message.pack(values).rstrip(b"\0") or b"\0"
    number = message.message_id
    body = (
        _HEAD.pack(
            len(payload), flags, 0, sequence, system, component, number & 0xFFFF, number >> 16
        )
        + payload
    )
    return b"\xfd" + body + _CRC.pack(_crc(body + message.crc_seed))


class Framer:
    """Cuts byte streams into frames: skips noise, refuses a wrong CRC, waits for the rest of one.

    The ``stream`` of ``feed`` keeps several streams apart, as of the clients of one server. Where
    more than ``MAX_PARTIAL_STREAMS`` have begun a frame, the one that has waited longest is
    dropped.

    The CRC of a message that the dialect lacks cannot be checked, for its seed is part of the
    definition. Such a frame passes when ``senders`` holds its system and component, and some seed
    explains its CRC: noise does both once in 16 million times."""

    def __init__(self, senders: Container[tuple[int, int]] = ()) -> None:
        self._senders = senders
        self._begun: dict[Hashable, bytes] = {}
        self.rejected_frames = 0
        """Frames whose CRC was wrong."""
        self.skipped_bytes = 0
        """Bytes that belonged to no frame."""

    @property
    def partial_streams(self) -> int:
        """Streams in which a frame has begun and not ended."""
        return len(self._begun)

    def forget(self, stream: Hashable) -> None:
        """Drop the begun frame of a stream that is over."""
        self._begun.pop(stream, None)

    def feed(self, data: bytes, stream: Hashable = None) -> list[Frame]:
        """The frames that ``data`` completes in its stream, in the order of arrival."""
        buffer = self._begun.pop(stream, b"") + data if self._begun else data
        frames: list[Frame] = []
        at, end = 0, len(buffer)
        while at < end:
            if buffer[at] not in (MAGIC_V2, MAGIC_V1):
                at = self._skip(buffer, at)
                continue
            length = frame_length(buffer, at)
            if length == 0 or at + length > end:
                break
            frame = _check(buffer[at : at + length], self._senders)
            if frame is None:
                self.rejected_frames += 1
                self.skipped_bytes += 1
                at += 1
            else:
                frames.append(frame)
                at += length
        if at < end:
            self._keep(stream, buffer[at:])
        return frames

    def _keep(self, stream: Hashable, begun: bytes) -> None:
        if len(self._begun) >= MAX_PARTIAL_STREAMS:
            del self._begun[next(iter(self._begun))]
        self._begun[stream] = begun

    def _skip(self, buffer: bytes, at: int) -> int:
        start = next_magic(buffer, at)
        self.skipped_bytes += start - at
        return start


def _check(raw: bytes, senders: Container[tuple[int, int]]) -> Frame | None:
    if raw[0] == MAGIC_V2:
        if raw[2] > SIGNED_FLAG:  # made in a way that we do not know
            return None
        end = 10 + raw[1]
        message_id, system, component, sequence = (
            raw[7] | raw[8] << 8 | raw[9] << 16,
            raw[5],
            raw[6],
            raw[4],
        )
        payload = raw[10:end]
    else:
        end = 6 + raw[1]
        message_id, system, component, sequence = raw[5], raw[3], raw[4], raw[2]
        payload = raw[6:end]
    known = dialect.by_id(message_id)
    told = raw[end] | raw[end + 1] << 8
    if known is None:
        if (system, component) not in senders or not _has_matching_seed(raw[1:end], told):
            return None
    elif _crc(raw[1:end] + known.crc_seed) != told:
        return None
    return Frame(system, component, message_id, sequence, payload, raw)


_SEED_EFFECTS = frozenset(_crc(bytes((seed,)), 0) for seed in range(256))
"""What a last byte can add: CRC-16/MCRF4XX taken byte by byte is ``(begun >> 8) ^ effect``."""


def _has_matching_seed(body: bytes, told: int) -> bool:
    """Whether there is a seed with which the CRC of ``body`` is the one that was told."""
    return told ^ _crc(body) >> 8 in _SEED_EFFECTS
