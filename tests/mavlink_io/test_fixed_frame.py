"""Frames of fixed layout: the same bytes and fields as the general codec's, and nothing else."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.endpoint import Endpoint
from mavlink_io.fixed_frame import FIELDS, SENDER, SEQUENCE, FixedFrame
from mavlink_io.signing import Signing, Timestamp
from tests.mavlink_io.test_codec import message_values, peer
from tests.mavlink_io.test_endpoint import Inbox

SENSOR, CONTROLS = dialect.by_name("HIL_SENSOR"), dialect.by_name("HIL_ACTUATOR_CONTROLS")
MESSAGES = (SENSOR, CONTROLS)
KEY = bytes(range(32))


def flat(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return fields with the elements of arrays as fields."""
    return tuple(x for v in values for x in (v if isinstance(v, tuple) else (v,)))


@given(st.data(), st.sampled_from(MESSAGES), st.integers(0, 255))
def test_frame_equals_that_of_general_codec(
    data: st.DataObject, message: dialect.MessageType, sequence: int
) -> None:
    values = data.draw(message_values(message))
    fixed = FixedFrame(message)
    frame = fixed.encode(flat(values), sequence, 7, 9)
    assert frame == encode(message, values, sequence, 7, 9)
    decoded = fixed.decode(frame)
    assert decoded is not None
    assert (decoded[SEQUENCE], decoded[SENDER]) == (sequence, (7, 9))
    (general,) = Framer().feed(frame)
    assert repr(decoded[FIELDS:]) == repr(flat(general.decode()))


@given(st.data(), st.sampled_from(MESSAGES))
def test_frame_with_a_changed_byte_is_left_to_framer(
    data: st.DataObject, message: dialect.MessageType
) -> None:
    frame = bytearray(encode(message, data.draw(message_values(message)), 3, 7, 9))
    index = data.draw(st.integers(0, len(frame) - 1))
    frame[index] ^= data.draw(st.integers(1, 255))
    assert FixedFrame(message).decode(bytes(frame)) is None


@given(st.binary(max_size=200))
def test_other_bytes_are_left_to_framer(noise: bytes) -> None:
    assert FixedFrame(SENSOR).decode(noise) is None


def sensor_fields(time_us: int) -> tuple[Any, ...]:
    return (time_us, *(0.5,) * 13, 0x1FFF, 0)


def variants() -> dict[str, bytes]:
    """Return bytes that hold HIL_SENSOR but are not one plain frame of it."""
    own, fields = FixedFrame(SENSOR), sensor_fields(20_000)
    frame = own.encode(fields, 1, 7, 9)
    signed = Endpoint(Inbox(), 7, 9, Signing(KEY, 1, Timestamp()))
    return {
        "two frames": frame + own.encode(sensor_fields(40_000), 2, 7, 9),
        "noise before": b"\x00" + frame,
        "cut off": frame[:-1],
        "signed": signed.encode_fixed(own, fields),
        "other message": encode(CONTROLS, (1, 0, (0.0,) * 16, 1), 1, 7, 9),
    }


@pytest.mark.parametrize("name", variants())
def test_endpoint_frames_what_is_not_one_frame(name: str) -> None:
    data = variants()[name]
    endpoint = Endpoint(Inbox(data), 1, 1)
    decoded, _, frames = endpoint.receive_fixed(FixedFrame(SENSOR))
    assert decoded is None
    assert [frame.raw for frame in frames] == [frame.raw for frame in Framer().feed(data)]


def test_endpoint_with_key_refuses_unsigned_frame() -> None:
    own = FixedFrame(SENSOR)
    inbox = Inbox(own.encode(sensor_fields(20_000), 1, 7, 9), variants()["signed"])
    endpoint = Endpoint(inbox, 1, 1, Signing(KEY, 0, Timestamp()))
    assert endpoint.receive_fixed(own) == (None, b"", [])
    _, _, (frame,) = endpoint.receive_fixed(own)
    assert frame.decode().time_usec == 20_000


def test_endpoint_completes_a_frame_in_two_parts_before_the_next() -> None:
    own = FixedFrame(SENSOR)
    first, second = (own.encode(sensor_fields(k), k, 7, 9) for k in (1, 2))
    endpoint = Endpoint(Inbox(first[:30], first[30:], second), 1, 1)
    received = [endpoint.receive_fixed(own) for _ in range(3)]
    assert [len(frames) for _, _, frames in received] == [0, 1, 0]
    decoded, raw, _ = received[2]
    assert decoded is not None
    assert (decoded[FIELDS], raw) == (2, second)
    assert endpoint.lost_frames == 0


def test_mavlink_1_peer_is_left_to_framer() -> None:
    other = peer()
    message = other.hil_sensor_encode(*sensor_fields(20_000)[:-1])
    frame = bytes(message.pack(other, force_mavlink1=True))
    assert frame[0] == 0xFE
    assert FixedFrame(SENSOR).decode(frame) is None
    assert len(Framer().feed(frame)) == 1
