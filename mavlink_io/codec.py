"""MAVLink frames: encode messages to bytes and cut byte streams into frames.

Equal to pymavlink's own codec byte for byte and several times faster, because the lockstep link and
full-rate telemetry spend most of their time here. The packing and the CRC seed of each message come
from the dialect. MAVLink 1 frames are received too, because old radios still send them.

Frame layout: https://mavlink.io/en/guide/serialization.html.
"""

import struct
from collections.abc import Container, Hashable
from typing import Any, NamedTuple

from fastcrc import crc16

from mavlink_io import dialect
from mavlink_io.dialect import Message, MessageType

MAGIC_V2 = 0xFD
"""First byte of a MAVLink 2 frame."""
MAGIC_V1 = 0xFE
"""First byte of a MAVLink 1 frame."""
SIGNED_FLAG = 0x01
"""Bit of a MAVLink 2 frame's incompatibility flags: a signature follows the CRC."""
SIGNATURE_LENGTH = 13
"""Bytes of a signature."""
OVERHEAD = 12
"""Bytes of a MAVLink 2 frame around its payload, without a signature."""
MAX_FRAME_BYTES = OVERHEAD + 255 + SIGNATURE_LENGTH
"""Bytes of the longest MAVLink 2 frame."""
MAX_REJECTED = 1000
"""Maximum number of frames with a wrong CRC in bytes that a link has received at once; the others
are skipped. A datagram whose every byte begins a frame would cost 65,535 CRCs."""
MAX_PARTIAL_STREAMS = 64
"""Maximum number of streams with an incomplete frame in memory, <= MAX_FRAME_BYTES bytes each."""

_HEAD = struct.Struct("<BBBBBBHB")
"""Bytes between the magic byte and the payload: six fields and the 24-bit message number."""
_CRC = struct.Struct("<H")
_crc = crc16.mcrf4xx


class Frame(NamedTuple):
    """One received frame with a correct CRC."""

    system: int
    """System id of the sender."""
    component: int
    """Component id of the sender."""
    message_id: int
    sequence: int
    """Sequence number of the frame among its sender's frames, modulo 256."""
    payload: bytes
    """Fields in wire order; trailing zeros may be missing, because MAVLink 2 cuts them off."""
    raw: bytes
    """The whole frame as received."""

    @property
    def name(self) -> str:
        """Name of the message; ``UNKNOWN_<number>`` if the dialect does not define it."""
        known = dialect.by_id(self.message_id)
        return known.name if known else f"UNKNOWN_{self.message_id}"

    def decode(self) -> Message:
        """Return the message's fields as a namedtuple.

        Raises
        ------
        KeyError
            The dialect does not define the message.
        """
        known = dialect.by_id(self.message_id)
        if known is None:
            raise KeyError(f"the MAVLink dialect has no message number {self.message_id}")
        return known.unpack(self.payload)

    @property
    def signature(self) -> bytes:
        """The 13 bytes of the signature; b"" for an unsigned frame."""
        signed = self.raw[0] == MAGIC_V2 and self.raw[2] & SIGNED_FLAG
        return self.raw[-SIGNATURE_LENGTH:] if signed else b""


def largest_frame(message: MessageType) -> int:
    """Return the number of bytes of a message's longest frame, including a signature.

    Parameters
    ----------
    message : MessageType
        Type of the message.

    Returns
    -------
    int
        Overhead, payload at full length and signature, in bytes.
    """
    return OVERHEAD + message.struct.size + SIGNATURE_LENGTH


def encode(
    message: MessageType,
    values: tuple[Any, ...],
    sequence: int,
    system: int,
    component: int,
    flags: int = 0,
) -> bytes:
    """Encode a message as one MAVLink 2 frame.

    Parameters
    ----------
    message : MessageType
        Type of the message.
    values : tuple
        Fields in wire order.
    sequence : int
        Sequence number, 0 to 255.
    system, component : int
        Ids of the sender, 0 to 255.
    flags : int
        Incompatibility flags. With SIGNED_FLAG the caller has to append a signature.

    Returns
    -------
    bytes
        The frame without a signature.
    """
    return encode_payload(message, message.pack(values), sequence, system, component, flags)


def encode_payload(
    message: MessageType,
    payload: bytes,
    sequence: int,
    system: int,
    component: int,
    flags: int = 0,
) -> bytes:
    """Encode a packed message as one MAVLink 2 frame; see ``encode``.

    Parameters
    ----------
    message : MessageType
        Type of the message.
    payload : bytes
        Packed fields at full length.
    sequence, system, component, flags : int
        As for ``encode``.

    Returns
    -------
    bytes
        The frame without a signature.
    """
    payload = payload.rstrip(b"\0") or b"\0"
    number = message.message_id
    body = (
        _HEAD.pack(
            len(payload), flags, 0, sequence, system, component, number & 0xFFFF, number >> 16
        )
        + payload
    )
    return b"\xfd" + body + _CRC.pack(_crc(body + message.crc_seed))


class Framer:
    """Cut byte streams into frames, skip noise and reject frames with a wrong CRC.

    Parameters
    ----------
    senders : container of (int, int)
        System and component ids of known senders. A frame of one of them passes even if the dialect
        does not define its message.
    max_rejected : int, optional
        Number of frames with a wrong CRC in one call of ``feed`` after which its other bytes are
        skipped, as ``MAX_REJECTED``; default: no limit, for a log.

    Notes
    -----
    The ``stream`` argument of ``feed`` keeps the bytes of several streams apart, for example those
    of the clients of one server. If more than ``MAX_PARTIAL_STREAMS`` streams have an incomplete
    frame, the oldest incomplete frame is dropped.

    The CRC of an undefined message cannot be checked, because its seed is part of the definition.
    Such a frame passes if ``senders`` contains its sender and one of the 256 seeds explains its
    CRC. Noise meets both conditions once in 16 million times.
    """

    def __init__(
        self, senders: Container[tuple[int, int]] = (), max_rejected: int | None = None
    ) -> None:
        self._senders, self._max_rejected = senders, max_rejected
        self._partial_frames: dict[Hashable, bytes] = {}
        self.rejected_frames = 0
        """Number of frames with a wrong CRC."""
        self.skipped_bytes = 0
        """Number of bytes that belonged to no frame."""

    @property
    def partial_streams(self) -> int:
        """Number of streams with an incomplete frame."""
        return len(self._partial_frames)

    def forget(self, stream: Hashable) -> None:
        """Drop the incomplete frame of a stream that has ended.

        Parameters
        ----------
        stream : hashable
            Key of the stream, as given to `feed`.
        """
        self._partial_frames.pop(stream, None)

    def feed(self, data: bytes, stream: Hashable = None) -> list[Frame]:
        """Return the frames that received bytes complete.

        Parameters
        ----------
        data : bytes
            Received bytes.
        stream : hashable
            Identifies the stream that the bytes belong to.

        Returns
        -------
        list of Frame
            Complete frames in the order of arrival.
        """
        buffer = self._partial_frames.pop(stream, b"") + data if self._partial_frames else data
        frames: list[Frame] = []
        start, end = 0, len(buffer)
        limit = None if self._max_rejected is None else self.rejected_frames + self._max_rejected
        while start < end:
            if self.rejected_frames == limit:
                self.skipped_bytes += end - start
                return frames
            if buffer[start] not in (MAGIC_V2, MAGIC_V1):
                start = self._skip_noise(buffer, start)
                continue
            length = _frame_length(buffer, start)
            if length == 0 or start + length > end:
                break
            frame = _parse_frame(buffer[start : start + length], self._senders)
            if frame is None:
                self.rejected_frames += 1
                self.skipped_bytes += 1
                start += 1
            else:
                frames.append(frame)
                start += length
        if start < end:
            self._store_partial_frame(stream, buffer[start:])
        return frames

    def _store_partial_frame(self, stream: Hashable, partial_frame: bytes) -> None:
        """Keep the beginning of a frame until the rest arrives."""
        if len(self._partial_frames) >= MAX_PARTIAL_STREAMS:
            del self._partial_frames[next(iter(self._partial_frames))]
        self._partial_frames[stream] = partial_frame

    def _skip_noise(self, buffer: bytes, start: int) -> int:
        """Count the bytes up to the next magic byte as skipped and return its position."""
        next_start = _next_magic(buffer, start)
        self.skipped_bytes += next_start - start
        return next_start


def _frame_length(buffer: bytes, start: int) -> int:
    """Return the length of the frame at ``start`` in bytes; 0 if its head is incomplete."""
    if len(buffer) - start < 3:
        return 0
    if buffer[start] == MAGIC_V1:
        return buffer[start + 1] + 8
    return int(
        buffer[start + 1] + OVERHEAD + (SIGNATURE_LENGTH if buffer[start + 2] & SIGNED_FLAG else 0)
    )


def _next_magic(buffer: bytes, start: int) -> int:
    """Return the position of the next magic byte from ``start`` on; the buffer's length if none."""
    positions = [
        position for magic in (b"\xfd", b"\xfe") if (position := buffer.find(magic, start)) >= 0
    ]
    return min(positions, default=len(buffer))


def is_intact(raw: bytes) -> bool:
    """Return whether a frame's checksum is right.

    Parameters
    ----------
    raw : bytes
        A whole frame by the length in its header.

    Returns
    -------
    bool
        For a message that the dialect does not define: whether any seed explains the checksum.
    """
    sender = (raw[3], raw[4]) if raw[0] == MAGIC_V1 else (raw[5], raw[6])
    return _parse_frame(raw, (sender,)) is not None


def _parse_frame(raw: bytes, senders: Container[tuple[int, int]]) -> Frame | None:
    """Return the frame in ``raw``; None if its CRC is wrong or its flags are not supported."""
    if raw[0] == MAGIC_V2:
        if raw[2] > SIGNED_FLAG:  # an incompatibility flag that this codec does not support
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
    received_crc = raw[end] | raw[end + 1] << 8
    if known is None:
        if (system, component) not in senders or not _has_matching_seed(raw[1:end], received_crc):
            return None
    elif _crc(raw[1:end] + known.crc_seed) != received_crc:
        return None
    return Frame(system, component, message_id, sequence, payload, raw)


_SEED_EFFECTS = frozenset(_crc(bytes((seed,)), 0) for seed in range(256))
"""Effects of a last byte: CRC-16/MCRF4XX computes byte by byte ``crc = (crc >> 8) ^ effect``."""


def _has_matching_seed(body: bytes, received_crc: int) -> bool:
    """Return whether any seed makes the CRC of ``body`` equal to ``received_crc``."""
    return received_crc ^ _crc(body) >> 8 in _SEED_EFFECTS
