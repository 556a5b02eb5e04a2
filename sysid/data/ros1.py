"""Decode batches of ROS 1 messages to numpy records with the schema text of the log.

A MAVLink payload at full length is a ROS 1 message with the fields in wire order: fixed length,
little-endian, no padding. Therefore a whole channel is decoded in one call.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TYPES = {
    "bool": "u1",
    "byte": "i1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "<i2",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "float32": "<f4",
    "float64": "<f8",
}


def record_type(schema_text: str) -> np.dtype[Any]:
    """Return the numpy record type of a ``ros1msg`` definition with fixed-length fields.

    Parameters
    ----------
    schema_text : str
        Message definition, one field per line; comments and constants are ignored.

    Returns
    -------
    numpy.dtype
        Record type, little-endian, without padding.

    Raises
    ------
    ValueError
        A field has no fixed length, or a message type.
    """
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for line in schema_text.splitlines():
        text = line.split("#", 1)[0].strip()
        if not text or "=" in text:
            continue
        kind, name = text.split()
        base, _, length = kind.partition("[")
        if base not in _TYPES or length == "]":
            raise ValueError(f"field {name!r} of type {kind!r} has no fixed length")
        fields.append((name, _TYPES[base], (int(length[:-1]),)) if length else (name, _TYPES[base]))
    return np.dtype(fields)


def decode(payloads: Sequence[bytes], record: np.dtype[Any]) -> NDArray[Any]:
    """Decode all messages of one channel.

    Parameters
    ----------
    payloads : sequence of bytes
        Messages of the channel.
    record : numpy.dtype
        Record type from ``record_type``.

    Returns
    -------
    ndarray, shape (len(payloads),)
        Record array.

    Raises
    ------
    ValueError
        The length of a payload differs from that of the schema.
    """
    lengths = np.fromiter(map(len, payloads), np.int64, len(payloads))
    return decode_joined(b"".join(payloads), lengths, record)


def decode_joined(data: bytes, lengths: NDArray[np.int64], record: np.dtype[Any]) -> NDArray[Any]:
    """Decode all messages of one channel that follow one another.

    Parameters
    ----------
    data : bytes
        Messages of the channel, one after the other.
    lengths : ndarray, shape (messages,)
        Length of each message in bytes.
    record : numpy.dtype
        Record type from ``record_type``.

    Returns
    -------
    ndarray, shape (messages,)
        Record array.

    Raises
    ------
    ValueError
        The length of a message differs from that of the schema.
    """
    wrong_lengths = lengths[lengths != record.itemsize]
    if wrong_lengths.size:
        raise ValueError(
            f"{wrong_lengths.size} messages are {wrong_lengths[0]} bytes long; the schema has"
            f" {record.itemsize}"
        )
    return np.frombuffer(data, dtype=record)
