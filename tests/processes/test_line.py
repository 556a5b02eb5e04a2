"""The serial cable of other tests: its rate, its noise and its plugs behave as configured."""

import os
import time
from collections import Counter
from pathlib import Path

import pytest
import serial
from pymavlink.dialects.v20 import all as mavlink

from tests.helpers.pty_pair import QUANTUM_S, Line, Noise, line

BAUD = 57_600
TEXT = bytes(range(256)) * 16


TIMEOUT_S, QUIET_S = 30.0, 0.2


def opened(device: str, timeout_s: float = TIMEOUT_S) -> serial.Serial:
    return serial.Serial(device, BAUD, timeout=timeout_s, exclusive=True)


def through(
    cable: Line, data: bytes, end: str = "vehicle", other: str = "ground", sent_before: int = 0
) -> bytes:
    """Send data; return all bytes that arrive until the line has carried them and is quiet."""
    parts = []
    with opened(cable.device[end]) as sender, opened(cable.device[other], QUIET_S) as receiver:
        sender.write(data)
        while (part := receiver.read(65_536)) or cable.carried(end) < sent_before + len(data):
            parts.append(part)
    return b"".join(parts)


def wait_until_carried(cable: Line, count: int) -> None:
    """Wait until this number of bytes has left the vehicle's end."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while cable.carried("vehicle") < count:
        assert time.monotonic() < deadline_s
        time.sleep(QUANTUM_S)


@pytest.mark.parametrize(("end", "other"), [("vehicle", "ground"), ("ground", "vehicle")])
def test_clean_line_transfers_every_byte(tmp_path: Path, end: str, other: str) -> None:
    with line(tmp_path, 921_600) as cable:
        assert through(cable, TEXT, end, other) == TEXT
        assert (cable.carried(end), cable.carried(other), cable.spoilt(end)) == (len(TEXT), 0, 0)


def test_byte_takes_ten_bit_times(tmp_path: Path) -> None:
    data = TEXT[:2880]  # half a second at this rate
    with (
        line(tmp_path, BAUD) as cable,
        opened(cable.device["vehicle"]) as sender,
        opened(cable.device["ground"]) as receiver,
    ):

        def transfer_s() -> float:
            began_s = time.monotonic()
            sender.write(data)
            for count in range(288, len(data) + 1, 288):
                assert len(receiver.read(288)) == 288
                assert time.monotonic() - began_s > 10 * count / BAUD - 2 * QUANTUM_S
            return time.monotonic() - began_s

        # the quickest counts: on a busy machine a transfer may wait for a core
        assert min(transfer_s() for _ in range(3)) < 2.0


def test_noise_has_given_rates_and_is_repeatable(tmp_path: Path) -> None:
    noise = Noise(drop=0.02, flip=0.03)
    results = []
    for run in range(2):
        folder = tmp_path / str(run)
        folder.mkdir()
        with line(folder, 921_600, noise, seed=5) as cable:
            results.append(through(cable, TEXT))
            assert cable.spoilt("vehicle") == pytest.approx(0.05 * len(TEXT), rel=0.3)
    assert results[0] == results[1]
    lost = len(TEXT) - len(results[0])
    assert lost == pytest.approx(0.02 * len(TEXT), rel=0.4)


def test_flipped_byte_differs_in_one_bit(tmp_path: Path) -> None:
    with line(tmp_path, 921_600, Noise(flip=1.0)) as cable:
        got = through(cable, TEXT)
    bits = Counter((a ^ b).bit_count() for a, b in zip(TEXT, got, strict=True))
    assert bits == {1: len(TEXT)}


def test_lost_frames_are_lost_whole(tmp_path: Path) -> None:
    """A tenth of 400 frames, signed ones too, with payloads that contain the first byte's value."""
    plain, signed = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 1, 1)
    signed.signing.secret_key, signed.signing.sign_outgoing = b"k" * 32, True
    frames = []
    for n in range(400):
        plain.seq = signed.seq = n % 256
        text = mavlink.MAVLink_statustext_message(6, b"\xfd" * (n % 50 + 1))
        frames.append(bytes(text.pack((plain, signed)[n % 2])))
    with line(tmp_path, 921_600, Noise(frame=0.1)) as cable:
        got = b"".join(  # in parts that the buffer of a device holds
            through(cable, b"".join(frames[n : n + 80]), sent_before=cable.carried("vehicle"))
            for n in range(0, len(frames), 80)
        )
        assert cable.lost_frames("vehicle") == pytest.approx(0.1, abs=0.05)
    left = [frame for frame in frames if frame in got]
    assert b"".join(left) == got
    assert len(left) == round(400 * (1.0 - cable.lost_frames("vehicle")))


def test_unplugged_device_disappears_and_reader_gets_error(tmp_path: Path) -> None:
    with line(tmp_path, BAUD) as cable, opened(cable.device["ground"]) as port:
        cable.unplug("ground")
        assert not Path(cable.device["ground"]).exists()
        with pytest.raises(serial.SerialException):
            port.read(1)


def test_replugged_device_continues(tmp_path: Path) -> None:
    with line(tmp_path, BAUD) as cable, opened(cable.device["vehicle"]) as far:
        cable.unplug("ground")
        far.write(b"lost")
        wait_until_carried(cable, 4)
        cable.plug("ground")
        with opened(cable.device["ground"]) as port:
            far.write(b"back")
            assert port.read(4) == b"back"
            port.write(b"and here")
            assert far.read(8) == b"and here"


def test_unread_bytes_are_lost_without_blocking(tmp_path: Path) -> None:
    with line(tmp_path, 3_000_000) as cable:
        device = os.open(cable.device["vehicle"], os.O_WRONLY | os.O_NOCTTY)
        for _ in range(20):
            os.write(device, TEXT)
        os.close(device)
        wait_until_carried(cable, 20 * len(TEXT))
        assert cable.carried("vehicle") == 20 * len(TEXT)
