"""Recorded frames cannot be replayed after a restart of the autopilot."""

import time
from pathlib import Path

import pytest

from autopilot.comms.signing_keys import STREAMS_MARGIN_UNITS, SigningKeys
from mavlink_io.codec import Frame
from mavlink_io.signing import UNITS_PER_S, Signing, Timestamp, key_from_passphrase
from tests.mavlink_io.test_signing import beat, framed, peer

ADDRESS = "udpin:127.0.0.1:14550"


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "radio.key"
    path.touch(mode=0o600)
    path.write_text("under the ice\n")
    return path


def start(key_file: Path) -> tuple[SigningKeys, Signing]:
    folder = key_file.parent
    keys = SigningKeys({ADDRESS: key_file}, Timestamp(folder / "t"), folder / "streams")
    signing = keys.signing(ADDRESS)
    assert signing is not None
    return keys, signing


def sent(age_s: float) -> Frame:
    """Return a frame that a ground station signs at a time before now."""
    now = Timestamp().now()
    stamp = now - round(age_s * UNITS_PER_S)
    return framed(beat(peer(key_from_passphrase("under the ice"), timestamp=stamp)))


@pytest.mark.parametrize("ordered_end", [True, False])
def test_recorded_frame_is_refused_after_restart(key_file: Path, ordered_end: bool) -> None:
    keys, signing = start(key_file)
    recorded = sent(age_s=20.0)
    assert signing.accepts(recorded)
    if ordered_end:
        assert keys.save() == ""
    else:
        assert keys.save_when_due() == ""  # a thread writes, then the process is killed
        assert keys._writing is not None
        keys._writing.result()
    _, restarted = start(key_file)
    assert not restarted.accepts(recorded)
    margin_s = STREAMS_MARGIN_UNITS / UNITS_PER_S
    assert not restarted.accepts(sent(age_s=20.0 - 0.5 * margin_s))  # accepted after the last save
    assert restarted.accepts(sent(age_s=20.0 - 2.0 * margin_s))


def test_damaged_file_of_streams_is_ignored(key_file: Path) -> None:
    (key_file.parent / "streams").write_text('[["x", 1')
    _, signing = start(key_file)
    assert signing.accepts(sent(age_s=1.0))


def test_unwritable_file_of_streams_is_reported(key_file: Path) -> None:
    (key_file.parent / "streams").mkdir()
    keys, _ = start(key_file)
    assert keys.save_when_due() == ""
    deadline_s = time.monotonic() + 10.0
    while not (text := keys.save_when_due()):
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    assert text.startswith("Signing time cannot be stored: ")
