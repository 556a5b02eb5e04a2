"""A serial cable for tests: two pseudo terminals, joined by a thread with rate and noise.

Each end is a device path that programs open like a USB adapter's. The path disappears while the
device is unplugged.
"""

import contextlib
import os
import random
import select
import termios
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

BITS_PER_BYTE = 10
"""Bits per byte, 8N1: a start bit, eight data bits, a stop bit."""
QUANTUM_S = 8e-3
"""Line time that is transferred at once, in s: USB adapters buffer bytes for about as long."""
IDLE_S = 0.2
ENDS = ("vehicle", "ground")


class Noise(NamedTuple):
    """Probabilities of the errors of a byte, and of the loss of a whole frame."""

    drop: float = 0.0
    flip: float = 0.0
    """Probability that one of its eight bits is inverted."""
    frame: float = 0.0
    """Probability that a MAVLink 2 frame is lost whole, as by a radio that discards packets."""


CLEAN = Noise()


MAVLINK_2, SIGNED = 0xFD, 1
"""First byte of a frame, and the flag in its third byte."""
FRAME_BYTES, SIGNATURE_BYTES = 12, 13
"""Length of header and checksum, and of the signature."""


class _FrameLoss:
    """Losses of whole frames of a byte stream, which may arrive in parts."""

    def __init__(self, probability: float, rng: random.Random) -> None:
        self._probability, self._random = probability, rng
        self._head = b""
        self._left = 0
        """Number of bytes of the present frame that are still to come, after its third one."""
        self._dropped = False
        self.frames = 0
        self.lost = 0

    def is_dropped(self, byte: int) -> bool:
        """Return whether the next byte belongs to a lost frame."""
        if self._left:
            self._left -= 1
            return self._dropped
        if not self._head:
            if byte != MAVLINK_2:
                return False
            self.frames += 1
            self._dropped = self._random.random() < self._probability
            self.lost += self._dropped
        self._head += bytes([byte])
        if len(self._head) == 3:
            signature = SIGNATURE_BYTES if self._head[2] & SIGNED else 0
            self._left = self._head[1] + FRAME_BYTES + signature - 3
            self._head = b""
        return self._dropped


class _Way:
    """One direction: the time at which it is free again, and the noise on its bytes."""

    def __init__(self, baud: int, noise: Noise, seed: str) -> None:
        self._byte_s, self._noise, self._random = BITS_PER_BYTE / baud, noise, random.Random(seed)
        self.loss = _FrameLoss(noise.frame, random.Random(f"{seed}: frames"))
        self._free_s = 0.0
        self._wire = b""
        self.carried = 0
        self.spoilt = 0

    def rest(self, now_s: float) -> None:
        """Mark the direction as idle until now."""
        self._free_s = now_s

    def due_s(self) -> float | None:
        """Return when the bytes on the wire arrive; None for an empty wire."""
        return self._free_s if self._wire else None

    def take(self, source: int, now_s: float) -> None:
        """Put the next bytes of a device on the free wire.

        The delay of a late thread is made up; the idle time of the line is not.
        """
        try:
            self._wire = os.read(source, max(1, int(QUANTUM_S / self._byte_s)))
        except OSError:
            self.rest(now_s)
        else:
            self._free_s += len(self._wire) * self._byte_s

    def deliver(self, target: int | None) -> None:
        """Pass the arrived bytes to the other end; they are lost if its buffer is full."""
        data, self._wire = self._spoil(self._wire), b""
        if target is not None:
            with contextlib.suppress(OSError):
                os.write(target, data)

    def _spoil(self, data: bytes) -> bytes:
        """Apply the noise to bytes.

        Every byte takes the same number of random draws, so that the errors do not depend on how
        the stream was divided.
        """
        received = bytearray()
        for byte in data:
            dropped = self.loss.is_dropped(byte)
            drop = self._random.random()
            flip = self._random.random()
            bit = self._random.randrange(8)
            if drop >= self._noise.drop and not dropped:
                received.append(byte ^ (1 << bit if flip < self._noise.flip else 0))
            self.spoilt += dropped or drop < self._noise.drop or flip < self._noise.flip
        self.carried += len(data)
        return bytes(received)


class _Port:
    """One end: a pseudo terminal behind a path.

    The class keeps the device open, so that programs can open and close it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.master: int | None = None
        self._device = -1

    def plug(self) -> None:
        self.master, self._device = os.openpty()
        tty.setraw(self._device, termios.TCSANOW)
        os.set_blocking(self.master, False)
        self.path.symlink_to(os.ttyname(self._device))

    def unplug(self) -> None:
        if self.master is None:
            return
        self.path.unlink()
        master, self.master = self.master, None
        os.close(master)
        os.close(self._device)


class Line:
    """A cable whose ends are ``device["vehicle"]`` and ``device["ground"]``."""

    def __init__(self, folder: Path, baud: int, noise: Noise = CLEAN, seed: int = 1) -> None:
        self._ports = {end: _Port(folder / f"tty-{end}") for end in ENDS}
        self._ways = {end: _Way(baud, noise, f"{seed} from {end}") for end in ENDS}
        self.device = {end: str(port.path) for end, port in self._ports.items()}
        self._lock = threading.Lock()
        self._over = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def plug(self, end: str) -> None:
        """Create the device path."""
        with self._lock:
            self._ports[end].plug()
            self._ways[end].rest(time.monotonic())

    def unplug(self, end: str) -> None:
        """Remove the device from the programs that have it open, and drop the bytes on the wire."""
        with self._lock:
            self._ports[end].unplug()

    def carried(self, end: str) -> int:
        """Number of bytes that left an end."""
        return self._ways[end].carried

    def spoilt(self, end: str) -> int:
        """Number of bytes that left an end and arrived wrong or not at all."""
        return self._ways[end].spoilt

    def lost_frames(self, end: str) -> float:
        """Fraction of the frames that left an end and were lost whole."""
        loss = self._ways[end].loss
        return loss.lost / max(1, loss.frames)

    def start(self) -> None:
        for end in ENDS:
            self.plug(end)
        self._thread.start()

    def stop(self) -> None:
        self._over = True
        self._thread.join()
        for end in ENDS:
            self.unplug(end)

    def _run(self) -> None:
        while not self._over:
            time.sleep(self._carry())

    def _carry(self) -> float:
        """Transfer what is due; return the time until the next transfer, in s."""
        with self._lock:
            wait_s = IDLE_S
            for end, other in (ENDS, ENDS[::-1]):
                direction = self._ways[end]
                source = self._ports[end].master
                target = self._ports[other].master
                due_s = direction.due_s()
                if due_s is not None and due_s <= time.monotonic():
                    direction.deliver(target)
                    due_s = None
                if due_s is None and source is not None:
                    direction.take(source, time.monotonic())
                    due_s = direction.due_s()
                if due_s is not None:
                    wait_s = min(wait_s, max(0.0, due_s - time.monotonic()))
            idle = [port.master for port in self._ports.values() if port.master is not None]
        if wait_s < IDLE_S:
            return wait_s
        with contextlib.suppress(OSError, ValueError):  # unplugged meanwhile
            select.select(idle, (), (), QUANTUM_S)
        return 0.0


@contextlib.contextmanager
def line(folder: Path, baud: int, noise: Noise = CLEAN, seed: int = 1) -> Iterator[Line]:
    """Yield a cable that is removed after the test."""
    cable = Line(folder, baud, noise, seed)
    cable.start()
    try:
        yield cable
    finally:
        cable.stop()
