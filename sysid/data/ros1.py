"""Batches of ROS 1 messages as numpy records, by the schema text that the log itself carries.

A MAVLink payload at full length is such a message when its fields stand in wire order: fixed
length, little-endian, no padding. So a whole channel decodes in one call."""

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
    """The numpy record of a ``ros1msg`` definition of fixed-length fields.

    Raises:
        ValueError: a field has no fixed length, or a type of its own.
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
    """All messages of one channel as a record array, shape (len(payloads),).

    Raises:
        ValueError: a payload is not as long as its schema says.
    """
    wrong = [len(p) for p in payloads if len(p) != record.itemsize]
    if wrong:
        raise ValueError(
            f"{len(wrong)} messages are {wrong[0]} bytes long, their schema says {record.itemsize}"
        )
    return np.frombuffer(b"".join(payloads), dtype=record)
