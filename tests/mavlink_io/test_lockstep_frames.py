"""The frames of a lockstep tick, against the codec that every other message uses."""

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_io import dialect, jit, lockstep_frames
from mavlink_io.codec import encode
from mavlink_io.fixed_frame import FIELDS, FixedFrame
from mavlink_io.lockstep_frames import (
    CONTROLS,
    PAYLOAD,
    SENSOR,
    START,
    TRUTH,
    FrameMemory,
    MessageLayout,
    frame_memory,
)

_FLOATS = st.floats(width=32, allow_nan=False)
_TIMES = st.integers(0, 2**62)
_SENSOR_TYPE = dialect.by_name("HIL_SENSOR")
_TRUTH_TYPE = dialect.by_name("HIL_STATE_QUATERNION")
_CONTROLS_TYPE = dialect.by_name("HIL_ACTUATOR_CONTROLS")
LONGEST = 280


@jit.entry_point
def _write_sensors(
    memory: FrameMemory, time_us: int, readings: jit.Numbers, updated: int, sequence: int
) -> int:
    lockstep_frames.write_sensors(memory, time_us, readings, updated)
    return lockstep_frames.seal(memory, SENSOR, sequence, (7 << 8) | 25)


@jit.entry_point
def _read_sensors(octets: Any, memory: FrameMemory, values: jit.Numbers) -> bool:
    size = lockstep_frames.frame_size(octets, 1, len(octets))
    valid = lockstep_frames.open_frame(octets, 1, size, SENSOR, memory)
    if valid:
        lockstep_frames.read_sensors(memory, values)
    return valid


@jit.entry_point
def _write_controls(
    memory: FrameMemory, time_us: int, rudder: float, thrust: float, mode: int
) -> int:
    lockstep_frames.write_controls(memory, time_us, 1, (rudder, 0.0, thrust, 0.0), mode)
    return lockstep_frames.seal(memory, CONTROLS, 3, (1 << 8) | 1)


@jit.entry_point
def _read_controls(octets: Any, memory: FrameMemory) -> tuple[bool, int, float, float, int]:
    size = lockstep_frames.frame_size(octets, 1, len(octets))
    valid = lockstep_frames.open_frame(octets, 1, size, CONTROLS, memory)
    return (
        valid and 1 + size == len(octets),
        lockstep_frames.time_us(memory),
        lockstep_frames.control(memory, 0),
        lockstep_frames.control(memory, 15),
        lockstep_frames.mode(memory),
    )


def _datagram(data: bytes) -> Any:
    """Return memory with a datagram from its second octet on."""
    octets = jit.octets(1 + len(data))
    memoryview(octets)[1:] = data
    return octets


def _used_memory() -> FrameMemory:
    """Return memory that has held another frame."""
    memory = frame_memory(LONGEST)
    memoryview(memory.octets)[:] = b"\xff" * len(memory.octets)
    return memory


def _sent(memory: FrameMemory, length: int) -> bytes:
    return bytes(memoryview(memory.octets)[START : START + length])


@pytest.mark.parametrize(
    ("layout", "name"),
    [
        (SENSOR, "HIL_SENSOR"),
        (CONTROLS, "HIL_ACTUATOR_CONTROLS"),
        (TRUTH, "HIL_STATE_QUATERNION"),
    ],
)
def test_layout_is_that_of_dialect(layout: MessageLayout, name: str) -> None:
    message = dialect.by_name(name)
    assert layout.number == message.message_id
    assert layout.length == message.struct.size
    assert bytes([layout.seed]) == message.crc_seed


@given(_TIMES, st.lists(_FLOATS, min_size=13, max_size=13), st.integers(0, 2**32 - 1))
def test_sensors_have_the_bytes_of_codec(time_us: int, readings: list[float], updated: int) -> None:
    memory, values = frame_memory(LONGEST), jit.numbers(13)
    for i, reading in enumerate(readings):
        values[i] = reading
    for sequence in (0, 255):  # the second frame is written over the first one
        length = _write_sensors(memory, time_us, values, updated, sequence)
        expected = encode(_SENSOR_TYPE, (time_us, *readings, updated, 0), sequence, 7, 25)
        assert _sent(memory, length) == expected


@jit.entry_point
def _write_truth(
    memory: FrameMemory,
    time_us: int,
    numbers: tuple[float, float, float, float, float, float, float],
    position: tuple[int, int, int],
    motion: tuple[int, int, int, int, int, int, int, int],
) -> int:
    lockstep_frames.write_truth(memory, time_us, numbers[:4], numbers[4:], position, motion)
    return lockstep_frames.seal(memory, TRUTH, 255, (1 << 8) | 25)


_SHORT, _LONG = st.integers(-(2**15), 2**15 - 1), st.integers(-(2**31), 2**31 - 1)
_SPEED = st.integers(0, 2**16 - 1)


@given(
    _TIMES,
    st.tuples(*(_FLOATS,) * 7),
    st.tuples(*(_LONG,) * 3),
    st.tuples(*(_SHORT,) * 3, _SPEED, _SPEED, *(_SHORT,) * 3),
)
def test_truth_has_the_bytes_of_codec(
    time_us: int,
    numbers: tuple[float, float, float, float, float, float, float],
    position: tuple[int, int, int],
    motion: tuple[int, int, int, int, int, int, int, int],
) -> None:
    memory = frame_memory(LONGEST)
    for _ in range(2):  # the second frame is written over the first one
        length = _write_truth(memory, time_us, numbers, position, motion)
        fields = (time_us, numbers[:4], *numbers[4:], *position, *motion)
        assert _sent(memory, length) == encode(_TRUTH_TYPE, fields, 255, 1, 25)


@given(_TIMES, _FLOATS, _FLOATS, st.integers(0, 255))
def test_controls_have_the_bytes_of_codec(
    time_us: int, rudder: float, thrust: float, mode: int
) -> None:
    memory = frame_memory(LONGEST)
    for _ in range(2):
        length = _write_controls(memory, time_us, rudder, thrust, mode)
        controls = (rudder, 0.0, thrust, *(0.0,) * 13)
        assert _sent(memory, length) == encode(
            _CONTROLS_TYPE, (time_us, 1, controls, mode), 3, 1, 1
        )


@given(_TIMES, st.lists(_FLOATS, min_size=13, max_size=13), st.integers(0, 0xFFFF))
def test_sensors_are_read_as_sent(time_us: int, readings: list[float], updated: int) -> None:
    data = encode(_SENSOR_TYPE, (time_us, *readings, updated, 0), 5, 1, 25)
    values = jit.numbers(16)
    assert _read_sensors(_datagram(data), _used_memory(), values)
    assert values.tolist() == [float(time_us), *readings, float(updated), 0.0]


@given(_TIMES, st.lists(_FLOATS, min_size=16, max_size=16), st.integers(0, 255))
def test_controls_are_read_as_sent(time_us: int, controls: list[float], mode: int) -> None:
    data = encode(_CONTROLS_TYPE, (time_us, 1, tuple(controls), mode), 5, 1, 1)
    assert _read_controls(_datagram(data), _used_memory()) == (
        True,
        time_us,
        controls[0],
        controls[15],
        mode,
    )


@given(st.data())
def test_changed_datagrams_are_refused_as_by_fixed_frame(data: st.DataObject) -> None:
    frame = encode(_CONTROLS_TYPE, (20_000, 1, (0.25,) * 16, 129), 9, 1, 1)
    changed = bytearray(frame)
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(changed[: data.draw(st.integers(0, len(changed)))])
    decoded = FixedFrame(_CONTROLS_TYPE).decode(cut)
    valid, *values = _read_controls(_datagram(cut), _used_memory())
    assert valid is (decoded is not None)
    if decoded is not None:
        assert values[0] == decoded[FIELDS]


def test_refused_frame_leaves_the_memory_unchanged() -> None:
    data = bytearray(encode(_CONTROLS_TYPE, (20_000, 1, (0.25,) * 16, 129), 9, 1, 1))
    data[20] ^= 1
    memory = _used_memory()
    assert not _read_controls(_datagram(bytes(data)), memory)[0]
    assert set(memoryview(memory.octets)) == {0xFF}


def test_signed_frame_is_refused() -> None:
    data = encode(_CONTROLS_TYPE, (20_000, 1, (0.25,) * 16, 129), 9, 1, 1, flags=1)
    assert not _read_controls(_datagram(data), _used_memory())[0]


def test_readings_beyond_floats_are_infinite() -> None:
    memory, values = frame_memory(LONGEST), jit.numbers(13)
    values[0] = 1e39
    if not jit.COMPILED:
        pytest.skip("a memory view refuses the number, and the records have none so large")
    _write_sensors(memory, 0, values, 0, 0)
    (value,) = struct.unpack_from("<f", memory.octets, PAYLOAD + 8)
    assert math.isinf(value)
