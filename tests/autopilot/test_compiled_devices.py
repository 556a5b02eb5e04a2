"""Messages of devices as compiled code reads them, against the readers of Python."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.comms.hil import HilLink
from autopilot.control import steady_kernel
from autopilot.control.steady import NO_RECORDS
from mavlink_io import device_records, dialect, jit
from mavlink_io.codec import encode
from mavlink_io.dialect import MessageField, MessageType
from mavlink_io.lockstep_frames import FrameMemory, frame_memory
from tests.mavlink_io.test_endpoint import Inbox

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="only compiled code reads them so")
DEVICES = {
    "gps": dialect.by_name("HIL_GPS"),
    "altimeter": dialect.by_name("DISTANCE_SENSOR"),
    "dvl": dialect.by_name("ODOMETRY"),
    "battery": dialect.by_name("BATTERY_STATUS"),
    "leak": dialect.by_name("SYS_STATUS"),
    "duct": dialect.by_name("ACTUATOR_OUTPUT_STATUS"),
}
"""Message of each device, in the order of ``DeviceRecords``."""
SENSOR = dialect.by_name("HIL_SENSOR")
SAMPLE = encode(SENSOR, (20_000, *(0.0,) * 13, 0, 0), 0, 1, 25)
_LIKELY = {"orientation": 25, "frame_id": 20, "child_frame_id": 12}
"""Values without which a message has no record."""


def _field(field: MessageField) -> st.SearchStrategy[Any]:
    """Return values of one field."""
    if field.type == "float":
        scalar: st.SearchStrategy[Any] = st.floats(width=32)
    else:
        bits = int(field.type.removesuffix("_t").lstrip("uint"))
        low = 0 if field.type.startswith("u") else -(2 ** (bits - 1))
        high = min(2**53, 2 ** (bits if field.type.startswith("u") else bits - 1) - 1)
        scalar = st.integers(low, high) | st.sampled_from((low, high, max(low, -1)))
        if field.name in _LIKELY:
            scalar = st.just(_LIKELY[field.name]) | scalar
    return st.tuples(*(scalar,) * field.array_length) if field.array_length else scalar


def _frames(name: str) -> st.SearchStrategy[bytes]:
    """Return frames of the message of a device."""
    message: MessageType = DEVICES[name]
    values = st.tuples(*map(_field, message.fields))
    return values.map(lambda fields: encode(message, fields, 7, 1, 197))


if jit.COMPILED:  # importing it loads the compiler
    from autopilot import compiled_devices


@jit.entry_point
def _read(octets: Any, frame: FrameMemory, values: jit.Numbers, relay: Any) -> tuple[int, int, int]:
    return compiled_devices.read(octets, len(octets), frame, values, relay, 3)


@given(st.lists(st.sampled_from(sorted(DEVICES)).flatmap(_frames), max_size=4))
def test_records_equal_those_of_python(frames: list[bytes]) -> None:
    datagram = b"".join((*frames, SAMPLE))
    octets, relay = jit.octets(len(datagram)), jit.octets(2000)
    memoryview(octets)[:] = datagram
    values = jit.numbers(steady_kernel.SIZE)
    start, new, relay_end = _read(octets, frame_memory(280), values, relay)
    (sample,) = HilLink(Inbox(datagram), 1).receive() or []
    assert start == len(datagram) - len(SAMPLE)
    assert bytes(memoryview(relay)[3:relay_end]) == b"".join(f.raw for f in sample.relayed)
    records = [getattr(sample, name) for name in NO_RECORDS._fields]
    assert [bool(new >> i & 1) for i in range(len(records))] == [r is not None for r in records]
    starts = steady_kernel.STARTS[2:-1]
    for read, start, record in zip(device_records.READERS, starts, records, strict=True):
        if record is not None:
            assert repr(read(values.tolist()[start:])) == repr(record)  # NaN is not equal to itself


@pytest.mark.parametrize("name", ["HEARTBEAT", "STATUSTEXT", "COMMAND_LONG"])
def test_other_messages_are_left_to_python(name: str) -> None:
    message = dialect.by_name(name)
    zeros = tuple(
        "" if f.type == "char" else (0,) * f.array_length if f.array_length else 0
        for f in message.fields
    )
    datagram = encode(message, zeros, 0, 1, 25) + SAMPLE
    octets = jit.octets(len(datagram))
    memoryview(octets)[:] = datagram
    values = jit.numbers(steady_kernel.SIZE)
    _, new, _ = _read(octets, frame_memory(280), values, jit.octets(2000))
    assert new == compiled_devices.REFUSED
