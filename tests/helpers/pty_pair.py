"""A serial cable for tests: two pseudo terminals, joined by a thread that is as slow and as lossy
as a real line.

Each end is a device path that programs open as they would a USB adapter's, and that goes away while
it is unplugged."""

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
"""8N1: a start bit, eight of data, a stop bit."""
QUANTUM_S = 8e-3
"""How much of the line's time is carried at once: USB adapters gather bytes for about as long."""
IDLE_S = 0.2
ENDS = ("vehicle", "ground")


class Noise(NamedTuple):
    """What befalls a byte, as probabilities."""

    drop: float = 0.0
    flip: float = 0.0
    """One bit of it, any of the eight."""


CLEAN = Noise()


class _Way:
    """One direction: when it is free again, and what the noise made of it."""

    def __init__(self, baud: int, noise: Noise, seed: str) -> None:
        self._byte_s, self._noise, self._random = BITS_PER_BYTE / baud, noise, random.Random(seed)
        self._free_s = 0.0
        self._wire = b""
        self.carried = 0
        self.spoilt = 0

    def rest(self, now_s: float) -> None:
        """Nothing was sent up to now."""
        self._free_s = now_s

    def due_s(self) -> float | None:
        """When the bytes on the wire have arrived, None for an empty wire."""
        return self._free_s if self._wire else None

    def take(self, source: int, now_s: float) -> None:
        """Put the next bytes of a device on the free wire. A late thread makes up for it, an idle
        line does not."""
        try:
            self._wire = os.read(source, max(1, int(QUANTUM_S / self._byte_s)))
        except OSError:
            self.rest(now_s)
        else:
            self._free_s += len(self._wire) * self._byte_s

    def deliver(self, target: int | None) -> None:
        """Give the other end what has arrived; where nobody takes it, or its buffer is full, it is
        lost."""
        data, self._wire = self._spoil(self._wire), b""
        if target is not None:
            with contextlib.suppress(OSError):
                os.write(target, data)

    def _spoil(self, data: bytes) -> bytes:
        """The same draws for every byte, so that what is spoilt does not depend on how the stream
        was cut up."""
        kept = bytearray()
        for byte in data:
            drop, flip, bit = (
                self._random.random(),
                self._random.random(),
                self._random.randrange(8),
            )
            if drop >= self._noise.drop:
                kept.append(byte ^ (1 << bit if flip < self._noise.flip else 0))
            self.spoilt += drop < self._noise.drop or flip < self._noise.flip
        self.carried += len(data)
        return bytes(kept)


class _Port:
    """One end: a pseudo terminal behind a path. We keep its device open, so that programs may come
    and go."""

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
        """The device appears."""
        with self._lock:
            self._ports[end].plug()
            self._ways[end].rest(time.monotonic())

    def unplug(self, end: str) -> None:
        """The device goes away under whoever has it open, with what was on the wire."""
        with self._lock:
            self._ports[end].unplug()

    def carried(self, end: str) -> int:
        """Bytes that left an end."""
        return self._ways[end].carried

    def spoilt(self, end: str) -> int:
        """Bytes that left an end and arrived wrong or not at all."""
        return self._ways[end].spoilt

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
        """Move what can be moved; how long there is nothing to do."""
        with self._lock:
            wait_s = IDLE_S
            for end, other in (ENDS, ENDS[::-1]):
                way, source, target = (
                    self._ways[end],
                    self._ports[end].master,
                    self._ports[other].master,
                )
                due_s = way.due_s()
                if due_s is not None and due_s <= time.monotonic():
                    way.deliver(target)
                    due_s = None
                if due_s is None and source is not None:
                    way.take(source, time.monotonic())
                    due_s = way.due_s()
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
    """A cable that is gone when the test is over."""
    cable = Line(folder, baud, noise, seed)
    cable.start()
    try:
        yield cable
    finally:
        cable.stop()
