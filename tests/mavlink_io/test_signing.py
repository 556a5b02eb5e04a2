"""Signatures compared with pymavlink's in both directions, and the rules on timestamps."""

import os
import stat
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_io import dialect
from mavlink_io.codec import SIGNED_FLAG, Frame, Framer, encode
from mavlink_io.endpoint import Endpoint
from mavlink_io.signing import (
    EPOCH_UNIX_S,
    UNITS_PER_S,
    KeyFileError,
    Signing,
    Timestamp,
    key_from_passphrase,
    load_key,
    save_key,
)
from tests.mavlink_io.test_endpoint import Inbox

KEY, OTHER_KEY = key_from_passphrase("under the ice"), key_from_passphrase("over the ice")
NOW_S = 1_700_000_000.0
NOW = round((NOW_S - EPOCH_UNIX_S) * UNITS_PER_S)
HEARTBEAT = dialect.by_name("HEARTBEAT")
VALUES = (0, 12, 0, 1, 3, 3)


def peer(key: bytes = KEY, timestamp: int = NOW, link_id: int = 3) -> Any:
    """Return pymavlink's end of a signed link, as system 7."""
    other = mavlink.MAVLink(None, srcSystem=7, srcComponent=9)
    other.robust_parsing = True
    other.signing.secret_key = key
    other.signing.link_id = link_id
    other.signing.timestamp = timestamp
    other.signing.sign_outgoing = True
    return other


def beat(other: Any) -> bytes:
    return bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(other))


def framed(raw: bytes) -> Frame:
    (frame,) = Framer().feed(raw)
    return frame


def signing(key: bytes = KEY, unix_s: float = NOW_S) -> Signing:
    return Signing(key, 5, Timestamp(unix_s=lambda: unix_s))


def signed(signer: Signing) -> bytes:
    return signer.sign(encode(HEARTBEAT, VALUES, 0, 1, 1, SIGNED_FLAG))


@given(
    st.binary(min_size=32, max_size=32),
    st.integers(0, 255),
    st.floats(EPOCH_UNIX_S, EPOCH_UNIX_S + 2.8e9),
)
def test_signature_equals_pymavlink(key: bytes, link_id: int, unix_s: float) -> None:
    ours = Signing(key, link_id, Timestamp(unix_s=lambda: unix_s)).sign(
        encode(HEARTBEAT, VALUES, 0, 7, 9, SIGNED_FLAG)
    )
    stamp = int.from_bytes(ours[-12:-6], "little")
    assert abs(stamp - (unix_s - EPOCH_UNIX_S) * UNITS_PER_S) <= 2
    theirs = mavlink.MAVLink_heartbeat_message(12, 0, 1, 0, 3, 3).pack(peer(key, stamp, link_id))
    assert ours == theirs


def test_signed_frame_is_accepted_by_pymavlink() -> None:
    signer, stranger = signing(), signing(OTHER_KEY)
    listener = peer()
    listener.signing.timestamp = NOW
    for _ in range(3):
        assert listener.parse_buffer(signed(signer))[0].get_type() == "HEARTBEAT"
    assert listener.parse_buffer(signed(stranger))[0].get_type() == "BAD_DATA"


def test_pymavlink_signed_frame_is_accepted_once() -> None:
    ours, theirs = signing(), peer()
    first, second = framed(beat(theirs)), framed(beat(theirs))
    assert ours.accepts(first)
    assert not ours.accepts(first), "said again"
    assert ours.accepts(second)
    assert not ours.accepts(first), "said later"


@pytest.mark.parametrize("field", [0, 12, -13, -7, -1])
def test_signature_covers_every_byte(field: int) -> None:
    raw = bytearray(beat(peer()))
    frame = framed(bytes(raw))
    raw[field] ^= 1
    assert signing().accepts(frame)
    assert not signing().accepts(frame._replace(raw=bytes(raw)))


def test_unsigned_or_other_key_is_refused() -> None:
    ours = signing()
    assert not ours.accepts(framed(encode(HEARTBEAT, VALUES, 0, 7, 9)))
    assert not ours.accepts(framed(beat(peer(OTHER_KEY))))


def test_unsigned_radio_status_is_accepted() -> None:
    plain = peer()
    plain.signing.sign_outgoing = False
    status = mavlink.MAVLink_radio_status_message(100, 100, 90, 20, 20, 0, 0)
    assert signing().accepts(framed(status.pack(plain)))
    plain.signing.sign_outgoing, plain.signing.secret_key = True, OTHER_KEY
    assert not signing().accepts(framed(status.pack(plain)))


@pytest.mark.parametrize(("behind_s", "accepted"), [(59.9, True), (60.1, False), (-3600.0, True)])
def test_new_stream_over_a_minute_late_is_refused(behind_s: float, accepted: bool) -> None:
    assert (
        signing().accepts(framed(beat(peer(timestamp=NOW - round(behind_s * UNITS_PER_S)))))
        is accepted
    )


def test_stream_timestamps_must_grow_per_stream() -> None:
    ours = signing()
    assert ours.accepts(framed(beat(peer(timestamp=NOW + 10, link_id=1))))
    assert ours.accepts(framed(beat(peer(timestamp=NOW + 5, link_id=2))))
    assert not ours.accepts(framed(beat(peer(timestamp=NOW + 4, link_id=2))))


def test_timestamp_advances_to_signed_frame() -> None:
    ours = signing()
    ahead = NOW + 3600 * UNITS_PER_S
    ours.accepts(framed(beat(peer(OTHER_KEY, timestamp=ahead))))
    assert stamp(signed(ours)) < ahead
    ours.accepts(framed(beat(peer(timestamp=ahead))))
    assert stamp(signed(ours)) > ahead


def stamp(raw: bytes) -> int:
    return int.from_bytes(framed(raw).signature[1:7], "little")


@given(st.lists(st.one_of(st.just("send"), st.floats(-1e6, 1e6)), max_size=40))
def test_timestamp_is_unique_for_any_clock(steps: list[Any]) -> None:
    unix_s = NOW_S
    timestamp = Timestamp(unix_s=lambda: unix_s)
    given_out = []
    for step in steps:
        if step == "send":
            given_out.append(timestamp.next())
        else:
            unix_s += step
    assert given_out == sorted(set(given_out))


def test_timestamp_is_kept_over_restart(tmp_path: Path) -> None:
    path = tmp_path / "state" / "timestamp"
    first = Timestamp(path, lambda: NOW_S)
    first.advance_to(NOW + 77)
    first.save()
    assert Timestamp(path, lambda: NOW_S - 1e6).next() == NOW + 78
    older = Timestamp(None, lambda: NOW_S - 1e6)
    older._path = path
    older.save()
    assert Timestamp(path, lambda: 0.0).next() == NOW + 78, (
        "another program's newer one was taken back"
    )
    path.write_text("what?")
    assert Timestamp(path, lambda: NOW_S).next() == NOW
    assert [file.name for file in path.parent.iterdir()] == ["timestamp"]


def test_timestamp_is_saved_once_per_minute(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall_s = [0.0]
    monkeypatch.setattr("mavlink_io.clock.wall_s", lambda: wall_s[0])
    path = tmp_path / "timestamp"
    timestamp = Timestamp(path, lambda: NOW_S + wall_s[0])
    timestamp._save._now = lambda: wall_s[0]
    timestamp._save.hasten()
    saved = set()
    for second in range(181):
        wall_s[0] = float(second)
        timestamp.next()
        timestamp.save_when_due()
        saved.add(path.read_text())
    assert len(saved) == 4


def test_endpoint_with_key_receives_signed_frames_only() -> None:
    plain = encode(HEARTBEAT, VALUES, 0, 9, 9)
    endpoint = Endpoint(
        Inbox(plain + beat(peer()) + beat(peer(OTHER_KEY))), 1, 1, Signing(KEY, 0, Timestamp(None))
    )
    now = round((time.time() - EPOCH_UNIX_S) * UNITS_PER_S)
    endpoint.transport = Inbox(
        plain + beat(peer(timestamp=now)) + beat(peer(OTHER_KEY, timestamp=now))
    )
    assert [(f.system, f.component) for f in endpoint.receive()] == [(7, 9)]
    assert endpoint.lost_frames == 0


@given(
    st.lists(st.tuples(st.binary(max_size=30), st.booleans()), min_size=1, max_size=8), st.data()
)
def test_framer_signed_frames_in_noise_are_complete(
    parts: list[tuple[bytes, bool]], data: st.DataObject
) -> None:
    signer = signing()
    frames = [signed(signer) if sign else encode(HEARTBEAT, VALUES, 0, 1, 1) for _, sign in parts]
    stream = b"".join(
        noise + frame for (noise, _), frame in zip(parts, frames, strict=True)
    ) + bytes(300)
    cut = data.draw(st.integers(0, len(stream)))
    framer = Framer()
    received = [frame.raw for part in (stream[:cut], stream[cut:]) for frame in framer.feed(part)]
    assert [raw for raw in received if raw in frames] == frames


def write_private(file: Path, text: bytes) -> None:
    file.touch(0o600)
    file.write_bytes(text)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o660, 0o666])
def test_key_file_that_others_may_use_is_refused(tmp_path: Path, mode: int) -> None:
    """ssh refuses such files too ("UNPROTECTED PRIVATE KEY FILE", sshkey_perm_ok in authfile.c)."""
    file = tmp_path / "key"
    file.write_text("under the ice\n")
    file.chmod(mode)
    with pytest.raises(
        KeyFileError, match=rf"^{file}: mode {mode:o}: others may read this key; chmod 600 {file}$"
    ):
        load_key(file)
    file.chmod(0o600)
    assert load_key(file) == KEY
    file.chmod(0o400)
    assert load_key(file) == KEY


def test_key_file_is_private_from_its_creation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The new file is private even if the old or a temporary file was readable for all."""
    file, created = tmp_path / "key", []
    half = tmp_path / f".key.{os.getpid()}"
    for old in (file, half):
        old.write_text("old")
        old.chmod(0o666)
    fdopen = os.fdopen

    def looking(descriptor: int, *how: Any, **more: Any) -> Any:
        created.append(stat.S_IMODE(os.fstat(descriptor).st_mode))
        return fdopen(descriptor, *how, **more)

    monkeypatch.setattr(os, "fdopen", looking)
    before = os.umask(0)
    try:
        save_key(file, KEY)
    finally:
        os.umask(before)
    assert created == [0o600]
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert list(tmp_path.iterdir()) == [file]


def test_key_file_passphrase_or_hex_is_loaded(tmp_path: Path) -> None:
    file = tmp_path / "key"
    write_private(file, b"under the ice\n")
    assert load_key(file) == KEY
    save_key(file, OTHER_KEY)
    assert load_key(file) == OTHER_KEY
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


@pytest.mark.parametrize("text", [b"", b"\n", b"one\ntwo", b"\xff\xfe"])
def test_key_file_without_key_raises_error(tmp_path: Path, text: bytes) -> None:
    file = tmp_path / "key"
    write_private(file, text)
    with pytest.raises(KeyFileError, match=r"key: (must hold one line|no text)"):
        load_key(file)
    with pytest.raises(KeyFileError, match="No such file"):
        load_key(tmp_path / "none")
