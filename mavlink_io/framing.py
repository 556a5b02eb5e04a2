"""Where MAVLink frames begin and end in a stream; CRC and contents: ``mavlink_io.codec``."""

MAGIC_V2 = 0xFD
MAGIC_V1 = 0xFE
SIGNED_FLAG = 0x01
SIGNATURE_LENGTH = 13
OVERHEAD = 12
"""Bytes of a MAVLink 2 frame around its payload, without a signature."""
LARGEST_FRAME = OVERHEAD + 255 + SIGNATURE_LENGTH
"""Bytes of the longest MAVLink 2 frame."""


def frame_length(buffer: bytes, at: int) -> int:
    """Return the length of the frame that starts at ``at``; 0 while it cannot be known yet."""
    if len(buffer) - at < 3:
        return 0
    if buffer[at] == MAGIC_V1:
        return buffer[at + 1] + 8
    return int(
        buffer[at + 1] + OVERHEAD + (SIGNATURE_LENGTH if buffer[at + 2] & SIGNED_FLAG else 0)
    )


def next_magic(buffer: bytes, at: int) -> int:
    """Return where the next frame may start from ``at`` on; the buffer's length where none does."""
    starts = [start for magic in (b"\xfd", b"\xfe") if (start := buffer.find(magic, at)) >= 0]
    return min(starts, default=len(buffer))
