"""Writer of MCAP logs for tests: pymavlink's own packing, none of the product's code."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mcap.writer import Writer
from pymavlink.dialects.v20 import all as mavlink

START_NS = 1_700_000_000_000_000_000
_ROS = {
    "uint8_t": "uint8",
    "int8_t": "int8",
    "uint16_t": "uint16",
    "int16_t": "int16",
    "uint32_t": "uint32",
    "int32_t": "int32",
    "uint64_t": "uint64",
    "int64_t": "int64",
    "float": "float32",
    "double": "float64",
    "char": "uint8",
}

Entry = tuple[float, Any]
"""Vehicle time in seconds and a pymavlink message."""


def schema(message: Any) -> str:
    """ros1msg text with units as comments, fields in wire order."""
    lines = []
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    for name, length in zip(message.ordered_fieldnames, message.array_lengths, strict=True):
        array = f"[{length}]" if length else ""
        lines.append(
            f"{_ROS[kinds[name]]}{array} {name}  # {message.fieldunits_by_name.get(name, '')}"
        )
    return "\n".join(lines)


def payload(message: Any) -> bytes:
    """The message's payload, zero-padded to full length."""
    frame = message.pack(mavlink.MAVLink(None, 1, 1))
    return bytes(frame[10:-2]).ljust(message.unpacker.size, b"\0")


def write(
    path: Path,
    entries: Iterable[Entry],
    parameters: dict[str, float],
    system: int = 1,
    components: dict[str, int] | None = None,
) -> Path:
    """Write a log; ``components`` gives the sender of messages that the autopilot does not send."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels: dict[str, int] = {}
        for time_s, message in entries:
            name = message.msgname
            if name not in channels:
                number = writer.register_schema(
                    f"mavlink/{name}", "ros1msg", schema(message).encode()
                )
                channels[name] = writer.register_channel(
                    f"/mavlink/{system}/{(components or {}).get(name, 1)}/{name}", "ros1", number
                )
            stamp = START_NS + round(time_s * 1e9)
            writer.add_message(channels[name], stamp, payload(message), stamp)
        writer.add_attachment(
            START_NS, START_NS, "params.json", "application/json", json.dumps(parameters).encode()
        )
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def texts(time_s: float, text: str, number: int) -> list[Entry]:
    """One STATUSTEXT, or its chunks of 50 when it is longer."""
    chunks = [text[i : i + 50] for i in range(0, len(text), 50)]
    chunk_id = number if len(chunks) > 1 else 0
    return [
        (time_s, mavlink.MAVLink_statustext_message(6, chunk.encode(), chunk_id, sequence))
        for sequence, chunk in enumerate(chunks)
    ]
