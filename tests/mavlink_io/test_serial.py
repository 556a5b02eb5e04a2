"""A serial line that is unplugged, replugged, blocked and missing, with pseudo terminals."""

import os
import select
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from mavlink_io.transport import AddressError, SerialTransport, open_transport, wait
from mavlink_io.transport.serial_line import BACKLOG_BYTES, REOPEN_S
from tests.helpers.pty_pair import Line, line

BAUD = 115_200
TIMEOUT_S = 10.0


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Line]:
    with line(tmp_path, BAUD) as cable_:
        yield cable_


def opened(
    cable: Line, end: str, texts: list[str], *, wait_for_device: bool = False
) -> SerialTransport:
    return SerialTransport(
        f"serial:{end}",
        cable.device[end],
        BAUD,
        wait_for_device=wait_for_device,
        report=texts.append,
    )


def until(happened: Callable[[], bool], transport: SerialTransport) -> None:
    """Wait on a transport, as its user does, until a condition holds."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not happened():
        assert time.monotonic() < deadline_s
        if wait([transport], 0.02):
            transport.receive()


def test_serial_unplugged_line_reopens(cable: Line) -> None:
    texts: list[str] = []
    with (
        closing(opened(cable, "vehicle", texts)) as vehicle,
        closing(opened(cable, "ground", [])) as ground,
    ):
        cable.unplug("vehicle")
        until(lambda: bool(texts), vehicle)
        assert vehicle.handles() == ()
        vehicle.send(b"into the sea")
        assert vehicle.receive() == b""
        cable.plug("vehicle")
        until(lambda: len(texts) == 2, vehicle)
        assert [text.split(" (")[0] for text in texts] == [
            "serial:vehicle: lost",
            "serial:vehicle: back",
        ]
        vehicle.send(b"here again")
        assert wait([ground], TIMEOUT_S) == [ground]
        assert ground.receive().startswith(b"here")


def test_serial_line_that_is_only_read_reopens(cable: Line) -> None:
    texts: list[str] = []
    with closing(opened(cable, "vehicle", texts)) as vehicle:
        for change, count in ((cable.unplug, 1), (cable.plug, 2)):
            change("vehicle")
            deadline_s = time.monotonic() + TIMEOUT_S
            while len(texts) < count:
                assert time.monotonic() < deadline_s
                assert vehicle.receive() == b""
                time.sleep(0.02)
        assert texts[1] == "serial:vehicle: back"


def test_serial_loss_during_write_is_reported_once(cable: Line) -> None:
    texts: list[str] = []
    with closing(opened(cable, "vehicle", texts)) as vehicle:
        cable.unplug("vehicle")
        deadline_s = time.monotonic() + TIMEOUT_S
        while not texts:
            assert time.monotonic() < deadline_s
            vehicle.send(b"anybody there")
        vehicle.send(b"nobody")
        assert len(texts) == 1
        assert texts[0].startswith("serial:vehicle: lost")


def test_serial_lost_line_is_reopened_once_per_second(
    cable: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s, attempts = [100.0], 0
    monkeypatch.setattr("mavlink_io.transport.serial_line.wall_s", lambda: now_s[0])
    texts: list[str] = []
    with closing(opened(cable, "vehicle", texts)) as vehicle:

        def refused() -> None:
            nonlocal attempts
            attempts += 1
            raise OSError("not yet")

        monkeypatch.setattr(vehicle, "_open", refused)
        cable.unplug("vehicle")
        until(lambda: bool(texts), vehicle)
        for _ in range(1000):
            now_s[0] += 0.01
            assert vehicle.handles() == ()
        assert round(10.0 / REOPEN_S) - 1 <= attempts <= round(10.0 / REOPEN_S)


def test_serial_blocked_line_drops_whole_sends() -> None:
    far, near = os.openpty()
    tty.setraw(near)
    blocks = [b"<%06d>" % n * 8 for n in range(20_000)]
    with closing(open_transport(f"serial:{os.ttyname(near)}:{BAUD}")) as transport:
        began_s = time.monotonic()
        for block in blocks:
            transport.send(block)
        assert time.monotonic() - began_s < 2.0
        read = b""
        while select.select((far,), (), (), 0.3)[0]:
            read += os.read(far, 65_536)
            transport.handles()
    os.close(far)
    os.close(near)
    assert len(read) >= BACKLOG_BYTES
    size = len(blocks[0])
    arrived = [read[start : start + size] for start in range(0, len(read) - size, size)]
    assert set(arrived) <= set(blocks)
    assert arrived == sorted(arrived)


def test_serial_missing_device_is_error_or_awaited(cable: Line) -> None:
    cable.unplug("vehicle")
    with pytest.raises(AddressError, match=r"serial:vehicle': no such device$"):
        opened(cable, "vehicle", [])
    texts: list[str] = []
    with closing(opened(cable, "vehicle", texts, wait_for_device=True)) as vehicle:
        assert texts == ["serial:vehicle: not there yet; trying every second"]
        cable.plug("vehicle")
        until(lambda: texts[1:] == ["serial:vehicle: back"], vehicle)


@pytest.mark.parametrize("wait_for_device", [False, True])
def test_serial_wrong_or_busy_device_is_an_error(cable: Line, wait_for_device: bool) -> None:
    for device in ("/dev/null", "/dev"):
        with pytest.raises(AddressError, match=f"{device}:57600': not a serial line$"):
            open_transport(f"serial:{device}:57600", wait_for_device=wait_for_device)
    with (
        closing(opened(cable, "vehicle", [])),
        pytest.raises(AddressError, match=r"in use by another program$"),
    ):
        opened(cable, "vehicle", [], wait_for_device=wait_for_device)


def test_serial_closed_line_stays_closed(cable: Line) -> None:
    vehicle = opened(cable, "vehicle", [])
    vehicle.close()
    assert vehicle.handles() == ()
    assert vehicle.receive() == b""
    vehicle.send(b"x")
