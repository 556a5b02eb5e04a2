"""What stands whole in a damaged .ulg: pyulog seeks byte by byte, or back and forth for ever, where
a size is wrong.

A ULog file is a header of 16 bytes and then messages, each a size (uint16), a type (one letter) and
so many bytes (PX4, "ULog File Format")."""

import struct

_HEADER_LENGTH = 16
_TYPES = frozenset(b"ABCDFILMOPQRST")
_MAX_MESSAGE_BYTES = 10_000
"""Bytes of a message that pyulog itself takes for undamaged."""
_RESYNC_MESSAGES = 3
"""So many messages in a row, where one was lost, are hardly there by chance."""
_head = struct.Struct("<HB")
_FLAGS, _APPENDED = ord("B"), 16
"""The message whose bytes from the sixteenth on say where in the file further data were
appended."""


def keep_sound_messages(data: bytes) -> bytes:
    """The file with those of its messages that are sound, in their order; a sound file as it is."""
    kept, at, lost = [data[:_HEADER_LENGTH]], _HEADER_LENGTH, False
    while at < len(data):
        end = _end(data, at)
        if end is None or (lost and not _is_message_sequence(data, at)):
            lost, at = True, at + 1
            continue
        kept.append(_clear_appended_offsets(data[at:end]))
        at, lost = end, False
    return b"".join(kept)


def _end(data: bytes, at: int) -> int | None:
    """Where the message ends that begins here; None where none does."""
    if at + _head.size > len(data):
        return None
    size, kind = _head.unpack_from(data, at)
    end = at + _head.size + size
    return end if kind in _TYPES and 0 < size <= _MAX_MESSAGE_BYTES and end <= len(data) else None


def _is_message_sequence(data: bytes, at: int) -> bool:
    """Whether _CHAIN messages follow each other from here, or as many as there are up to the
    end."""
    for _ in range(_RESYNC_MESSAGES):
        if at == len(data):
            return True
        end = _end(data, at)
        if end is None:
            return False
        at = end
    return True


def _clear_appended_offsets(message: bytes) -> bytes:
    """Flags without the places of appended data, which stand in the order of the file anyway."""
    if message[2] != _FLAGS or len(message) < _head.size + _APPENDED:
        return message
    return message[: _head.size + _APPENDED] + bytes(len(message) - _head.size - _APPENDED)
