"""The codec against pymavlink: every message of the dialect in both directions, byte for byte."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_io import dialect
from mavlink_io.codec import MAX_REJECTED, Frame, Framer, encode
from mavlink_io.dialect import MessageField, MessageType

MESSAGES = [
    dialect.by_name(name)
    for name in dialect.names()
    if hasattr(mavlink, f"MAVLINK_MSG_ID_{name}") and name != "TIMESYNC"
]
"""Messages that pymavlink knows with all their fields; test_dialect.py has the others."""
_BITS = {"int8_t": 8, "int16_t": 16, "int32_t": 32, "int64_t": 64}
LONGEST_FRAME = 300


def numbers(kind: str) -> st.SearchStrategy[Any]:
    if kind in ("float", "double"):
        return st.floats(width=32 if kind == "float" else 64, allow_nan=False)
    if kind == "char":
        return st.characters(min_codepoint=33, max_codepoint=126)
    kind = kind.removesuffix("_mavlink_version")
    bits = _BITS[kind.removeprefix("u")]
    return (
        st.integers(0, 2**bits - 1)
        if kind.startswith("u")
        else st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    )


def field_values(field: MessageField) -> st.SearchStrategy[Any]:
    if field.type == "char" and field.array_length:
        return st.text(
            st.characters(min_codepoint=32, max_codepoint=126), max_size=field.array_length
        )
    if field.array_length:
        return st.lists(
            numbers(field.type), min_size=field.array_length, max_size=field.array_length
        ).map(tuple)
    return numbers(field.type)


def message_values(message: MessageType) -> st.SearchStrategy[tuple[Any, ...]]:
    return st.tuples(*(field_values(field) for field in message.fields))


def peer(sequence: int = 0) -> Any:
    """Return pymavlink's codec as system 7, component 9."""
    other = mavlink.MAVLink(None, srcSystem=7, srcComponent=9)
    other.seq = sequence
    other.robust_parsing = True
    return other


def peer_message(message: MessageType, values: tuple[Any, ...]) -> Any:
    fields = {
        field.name: value.encode() if isinstance(value, str) else value
        for field, value in zip(message.fields, values, strict=True)
    }
    return mavlink.mavlink_map[message.message_id](**fields)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.name)
@given(data=st.data(), sequence=st.integers(0, 255))
@settings(max_examples=8)
def test_encode_equals_pymavlink(message: MessageType, data: st.DataObject, sequence: int) -> None:
    values = data.draw(message_values(message))
    assert encode(message, values, sequence, 7, 9) == peer_message(message, values).pack(
        peer(sequence)
    )


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.name)
@given(data=st.data())
@settings(max_examples=4)
def test_decode_of_pymavlink_frames_is_equal(message: MessageType, data: st.DataObject) -> None:
    values = data.draw(message_values(message))
    frames = Framer().feed(peer_message(message, values).pack(peer(5)))
    assert [(f.system, f.component, f.sequence, f.name) for f in frames] == [
        (7, 9, 5, message.name)
    ]
    assert tuple(frames[0].decode()) == values


ATTITUDE = dialect.by_name("ATTITUDE")
attitudes = st.lists(message_values(ATTITUDE), min_size=1, max_size=6)


def stream(values: list[tuple[Any, ...]]) -> list[bytes]:
    return [encode(ATTITUDE, v, n, 1, 1) for n, v in enumerate(values)]


@given(attitudes, st.data())
def test_framer_any_split_of_stream_gives_all_frames(
    values: list[tuple[Any, ...]], data: st.DataObject
) -> None:
    sent = b"".join(stream(values))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=8)))
    framer = Framer()
    parts = [sent[a:b] for a, b in zip([0, *cuts], [*cuts, len(sent)], strict=True)]
    received = [tuple(frame.decode()) for part in parts for frame in framer.feed(part)]
    assert received == values
    assert (framer.rejected_frames, framer.skipped_bytes) == (0, 0)


@given(attitudes, st.lists(st.binary(max_size=40), min_size=7, max_size=7))
def test_framer_noise_between_frames_loses_no_frame(
    values: list[tuple[Any, ...]], noise: list[bytes]
) -> None:
    sent = b"".join(n + frame for n, frame in zip(noise, stream(values), strict=False))
    received = [frame.raw for frame in Framer().feed(sent + bytes(LONGEST_FRAME))]
    assert [raw for raw in received if raw in stream(values)] == stream(values)


@given(message_values(ATTITUDE), st.data())
def test_framer_flipped_bit_is_rejected(values: tuple[Any, ...], data: st.DataObject) -> None:
    frame = bytearray(encode(ATTITUDE, values, 0, 1, 1))
    position = data.draw(st.integers(3, len(frame) - 1))
    frame[position] ^= 1 << data.draw(st.integers(0, 7))
    framer = Framer()
    assert framer.feed(bytes(frame) + bytes(LONGEST_FRAME)) == []
    assert framer.skipped_bytes > 0


def test_framer_mavlink_1_frames_are_decoded() -> None:
    raw = mavlink.MAVLink_heartbeat_message(12, 0, 1, 50_593_792, 3, 3).pack(
        peer(), force_mavlink1=True
    )
    (frame,) = Framer().feed(b"\xfe\x09" + raw)
    assert raw[0] == 0xFE
    assert (frame.system, frame.component, frame.name) == (7, 9, "HEARTBEAT")
    assert frame.decode().custom_mode == 50_593_792


def test_framer_signed_frame_has_correct_length() -> None:
    other = peer()
    other.signing.secret_key = bytes(32)
    other.signing.link_id = 1
    other.signing.sign_outgoing = True
    other.signing.timestamp = 1
    raw = mavlink.MAVLink_heartbeat_message(12, 0, 1, 0, 3, 3).pack(other)
    plain = encode(dialect.by_name("HEARTBEAT"), (0, 12, 0, 1, 3, 3), 1, 1, 1)
    assert [f.raw for f in Framer().feed(raw + plain)] == [raw, plain]


def stranger(seed: int, payload: bytes = b"\x01\x02\x03") -> bytes:
    """Return a frame of system 7, component 9 with a message that the dialect lacks."""
    body = bytes((len(payload), 0, 0, 5, 7, 9, 0x34, 0x12, 0xAB)) + payload
    crc: int = mavlink.x25crc(body + bytes((seed,))).crc
    return b"\xfd" + body + crc.to_bytes(2, "little")


@given(st.integers(0, 255), st.binary(min_size=1, max_size=255))
def test_framer_unknown_message_of_known_sender_passes(seed: int, payload: bytes) -> None:
    raw = stranger(seed, payload)
    (frame,) = Framer({(7, 9)}).feed(raw)
    assert (frame.system, frame.component, frame.message_id, frame.raw) == (7, 9, 0xAB1234, raw)
    for senders in ((), {(9, 7)}):
        framer = Framer(senders)
        assert framer.feed(raw + bytes(LONGEST_FRAME)) == []
        assert framer.rejected_frames > 0


def test_framer_unknown_message_1_of_256_crcs_passes() -> None:
    raw = stranger(0)
    passed = [
        crc
        for crc in range(0, 65_536, 7)
        if Framer({(7, 9)}).feed(raw[:-2] + crc.to_bytes(2, "little"))
    ]
    assert len(passed) <= 65_536 / 7 / 256 * 1.5


def test_framer_unknown_incompat_flag_is_rejected() -> None:
    body = b"\x01\x02\x00\x00\x07\x09\x00\x00\x00\x01"
    seed = dialect.by_name("HEARTBEAT").crc_extra
    raw = b"\xfd" + body + mavlink.x25crc(body + bytes((seed,))).crc.to_bytes(2, "little")
    assert Framer().feed(raw + bytes(LONGEST_FRAME)) == []


def test_decode_unknown_message_raises_error() -> None:
    with pytest.raises(KeyError, match="no message number 16777215"):
        Frame(1, 1, 0xFFFFFF, 0, b"", b"").decode()


def test_values_wrong_field_names_raise_error() -> None:
    with pytest.raises(TypeError, match="HEARTBEAT has no field depth"):
        dialect.by_name("HEARTBEAT").values(
            type=1,
            autopilot=0,
            base_mode=0,
            custom_mode=0,
            system_status=0,
            mavlink_version=3,
            depth=1,
        )
    with pytest.raises(TypeError, match="ATTITUDE needs field 'roll'"):
        ATTITUDE.values(time_boot_ms=0)
    with pytest.raises(KeyError, match="no message NONSENSE"):
        dialect.by_name("NONSENSE")


@pytest.mark.parametrize("magic", [b"\xfd", b"\xfe"])
def test_datagram_of_frame_heads_is_skipped_after_a_while(magic: bytes) -> None:
    """Each byte begins a frame: 60 kB of 0xfe took 76 ms, a tick has 20 ms."""
    framer, size = Framer(max_rejected=MAX_REJECTED), 60_000
    assert framer.feed(magic * size) == []
    assert framer.rejected_frames == MAX_REJECTED
    assert framer.skipped_bytes == size
    system_time = dialect.by_name("SYSTEM_TIME")
    (frame,) = framer.feed(encode(system_time, (1, 2), 0, 1, 1))
    assert frame.name == "SYSTEM_TIME"
