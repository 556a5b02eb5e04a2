"""Telemetry of a flight for the live page, which a process of its own serves.

The flight only writes to a socket that never blocks. What does not fit waits: the newest message of
each type, at most `MAX_SAMPLES` samples of the motion and `MAX_TEXTS` texts. A page process that is
slow, stopped or dead therefore costs the flight a refused write ten times a second, and no more.
"""

import contextlib
import os
import socket
import struct
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any, Self

import msgspec
from rich.console import RenderableType
from rich.text import Text

from ground.client.vehicle import StatusText
from ground.live.page.dive import LinkCounts
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame
from mavlink_io.dialect import by_name
from mavlink_io.frame_loss import FrameLoss
from mavlink_io.mission_items import MissionItem

SEND_PERIOD_S = 0.1
"""Wall time between two messages to the page process."""
SAMPLE_MS = 100
"""Vehicle time between two samples; doubled whenever `MAX_SAMPLES` are not enough."""
MAX_SAMPLES = 400
"""Number of frames of the motion that one message carries at most."""
MAX_TEXTS = 20
END_TIMEOUT_S = 4.0
"""Wall time in which the page process must end before it is killed."""
LENGTH = struct.Struct("<I")
"""Number of bytes of the message that follows."""
_SAMPLED = frozenset(
    by_name(name).message_id
    for name in (
        "ATTITUDE",
        "LOCAL_POSITION_NED",
        "ACTUATOR_OUTPUT_STATUS",
        "ATTITUDE_TARGET",
        "POSITION_TARGET_LOCAL_NED",
    )
)
_ATTITUDE, _MODES = by_name("ATTITUDE").message_id, by_name("AVAILABLE_MODES").message_id
_SOURCES = str(Path(__file__).parents[3])


class FeedMessage(msgspec.Struct, array_like=True):
    """What a dive sends to the page process; empty fields bring nothing new."""

    dive: str
    frames: list[tuple[int, int, int, bytes]] = []
    """System, component, message number and payload."""
    texts: list[StatusText] = []
    counts: LinkCounts = LinkCounts()
    travel_deg: float = 0.0
    items: list[MissionItem] = []
    estimate: dict[str, Any] | None = None
    ended: str = ""


class PageProcess:
    """Process that serves the live page, and the socket to it.

    Parameters
    ----------
    listener : socket.socket
        Listening socket of the page, which the process takes over.
    """

    def __init__(self, listener: socket.socket) -> None:
        self._socket, other_end = socket.socketpair()
        self._socket.setblocking(False)
        self._lock, self._unsent = Lock(), b""
        paths = [_SOURCES, *filter(None, [os.environ.get("PYTHONPATH")])]
        with listener, other_end:
            descriptors = other_end.fileno(), listener.fileno()
            self._process = subprocess.Popen(
                [sys.executable, "-m", "ground.live.page", *map(str, descriptors)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=descriptors,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                start_new_session=True,  # Ctrl-C is for the flight, which then ends this process
            )

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Return the process."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        """Let the process send its last picture, and end it."""
        self._socket.close()
        try:
            self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def offer(self, message: FeedMessage) -> bool:
        """Send a message unless an earlier one still waits to be sent; never block.

        Parameters
        ----------
        message : FeedMessage
            News of a dive.

        Returns
        -------
        bool
            Whether the message was taken.
        """
        with self._lock:
            self._flush()
            if self._unsent:
                return False
            data = msgspec.msgpack.encode(message)
            self._unsent = LENGTH.pack(len(data)) + data
            self._flush()
            return True

    def _flush(self) -> None:
        """Write what the socket accepts; after the end of the process all of it is dropped."""
        with contextlib.suppress(BlockingIOError):
            try:
                while self._unsent:
                    self._unsent = self._unsent[self._socket.send(self._unsent) :]
            except (BrokenPipeError, ConnectionResetError):
                self._unsent = b""


class DiveFeed:
    """Listener that sends the telemetry of one dive to the page process.

    Parameters
    ----------
    page : PageProcess
        Process of the page.
    name : str
        Name of the dive.
    items : sequence of MissionItem
        Mission of the dive.
    estimate : callable, optional
        Return the live estimate as `estimate_view.as_panel` does.
    """

    def __init__(
        self,
        page: PageProcess,
        name: str,
        items: Sequence[MissionItem] = (),
        estimate: Callable[[], dict[str, Any]] | None = None,
    ) -> None:
        self._page, self._name, self._items = page, name, list(items)
        self._estimate = estimate
        self._due = Interval(SEND_PERIOD_S)
        self._latest: dict[object, Frame] = {}
        self._samples: list[Frame] = []
        self._wanted: set[int] = set()
        self._sampled_ms, self._sample_ms = -SAMPLE_MS, SAMPLE_MS
        self._texts: deque[StatusText] = deque(maxlen=MAX_TEXTS)
        self._travel_deg = 0.0
        self._messages = self._bytes = 0
        self._loss = FrameLoss()

    def begin(self, parameters: Mapping[str, float]) -> None:
        """Take the travel of the surfaces from the parameters."""
        self._travel_deg = parameters.get("ACT_TRAVEL_DEG", 0.0)

    def on_frame(self, frame: Frame) -> None:
        """Keep a frame until the next message; thin out the motion by vehicle time."""
        number = frame.message_id
        self._messages += 1
        self._bytes += len(frame.raw)
        self._loss.count(frame.sequence, number, frame.payload)
        if number == _ATTITUDE:
            time_ms = int.from_bytes(frame.payload[:4], "little")
            if not 0 <= time_ms - self._sampled_ms < self._sample_ms:
                self._sampled_ms = time_ms
                self._wanted.update(_SAMPLED)
        if number in self._wanted:
            self._wanted.discard(number)
            self._samples.append(frame)
            if len(self._samples) > MAX_SAMPLES:
                self._samples = self._samples[len(self._samples) // 2 :]
                self._sample_ms *= 2
        elif number not in _SAMPLED:
            self._latest[(number, frame.payload) if number == _MODES else number] = frame

    def on_text(self, text: StatusText) -> None:
        """Keep a text until the next message."""
        self._texts.append(text)

    def poll(self, *, last: bool = False) -> None:
        """Send the news when due; the ``last`` call shows the end of the dive."""
        if not (last or self._due.due()):
            return
        frames = [*self._latest.values(), *self._samples]
        taken = self._page.offer(
            FeedMessage(
                dive=self._name,
                frames=[(f.system, f.component, f.message_id, f.payload) for f in frames],
                texts=list(self._texts),
                counts=LinkCounts(self._messages, self._bytes, self._loss.lost),
                travel_deg=self._travel_deg,
                items=self._items,
                estimate=self._estimate() if self._estimate else None,
                ended="the dive has ended" if last else "",
            )
        )
        if taken:
            if len(self._samples) < MAX_SAMPLES // 4:
                self._sample_ms = max(SAMPLE_MS, self._sample_ms // 2)
            self._latest, self._samples, self._items = {}, [], []
            self._texts.clear()

    def picture(self) -> RenderableType:
        """Return nothing for the terminal: the page shows it."""
        return Text()
