"""The ways to the ground: what leaves by each, when, and how much at a time."""

from collections import deque
from collections.abc import Sequence
from functools import partial

from autopilot.comms.bandwidth_limiter import (
    BITS_PER_BYTE,
    MAX_LINE_SHARE,
    Budget,
    Queue,
    Waiting,
)
from autopilot.comms.stream_rates import Schedule, profile_for
from autopilot.telemetry.encoding import encoded
from autopilot.telemetry.identity import COMPONENT
from mavlink_io import dialect
from mavlink_io.codec import LARGEST_FRAME, Frame, largest_frame
from mavlink_io.dialect import MessageType, Values
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import MavlinkId
from mavlink_io.signing import Signing
from mavlink_io.transport import Transport, baud_rate

DATAGRAM_FILL_S = 0.02
"""Wall seconds for which telemetry is gathered; the first after a pause leaves at once."""
DATAGRAM_BYTES, STREAM_BYTES = 1200, 16_384
"""The most that is sent at a time: what fits a common network's datagram, and what a pipe likes."""
BULK_BYTES = 16_384
"""How much bulk may wait on a link without a baud rate: with GATHER_S, some 800 kB/s."""
BULK_BACKLOG_S = 0.25
"""How much, by the time that it takes to leave, may wait on a serial line before bulk is added."""

_BULK = frozenset(
    dialect.by_name(name).message_id for name in ("LOG_DATA", "FILE_TRANSFER_PROTOCOL")
)
_HIGH_PRIORITY = frozenset(
    dialect.by_name(name).message_id
    for name in dialect.names()
    if name.startswith(("COMMAND_", "MISSION_", "PARAM_"))
    or name
    in ("HEARTBEAT", "STATUSTEXT", "SET_MODE", "PING", "TIMESYNC", "LOG_ENTRY", "AUTOPILOT_VERSION")
)
"""What others say that is not dropped either; of the rest the newest counts."""


class GroundLink:
    """One way to the ground, as fast as need be. Frames leave in order, gathered for some
    milliseconds of wall time: far above real time one system call a tick would cost more than the
    tick."""

    def __init__(self, transport: Transport, system: int, signing: Signing | None = None) -> None:
        self.transport = transport
        self.endpoint = Endpoint(transport, system, COMPONENT, signing, accept_unknown=True)
        self.profile = profile_for(baud_rate(transport.address))
        self.schedule = Schedule(self.profile)
        self._largest = DATAGRAM_BYTES if transport.address.startswith("udp") else STREAM_BYTES
        self._devices: dict[int, Endpoint] = {}
        self._outbox: list[bytes] = []
        self.backlog: deque[Frame] = deque()
        """Received frames that are not served yet, in the order of arrival."""
        self._due_s = 0.0
        self._known: set[MavlinkId] = set()

    @property
    def trusted(self) -> bool:
        """Whether a secret may come by it: a wire, or a link on which all is signed already."""
        return self.endpoint.signing is not None or baud_rate(self.transport.address) is not None

    def meets(self, sender: MavlinkId) -> bool:
        """Whether this is the first that is heard of ``sender`` by this link."""
        if sender in self._known:
            return False
        self._known.add(sender)
        return True

    def take_in(self) -> None:
        """Read what has arrived, once all that was read before is served. Raises LinkLostError.

        Meanwhile the rest waits in the operating system, which holds back a sender on TCP.
        """
        if not self.backlog:
            self.backlog.extend(self.endpoint.receive())

    def write(self, message: MessageType, values: Values) -> None:
        """Add a message to what leaves at the next flush. It may wait, and is never dropped."""
        self._outbox.append(encoded(self.endpoint, message, values))

    def stream(self, message: MessageType, values: Values, part: int = 0) -> None:
        """Add a message of the telemetry: on a slow line only the newest of its kind, and part,
        leaves."""
        self._outbox.append(encoded(self.endpoint, message, values))

    def relay(self, frame: Frame) -> None:
        """Add what one of the vehicle's devices said, as that component of the vehicle's system."""
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the HIL link lets only known messages pass"
        self._outbox.append(encoded(self._device(frame.component), message, frame.decode()))

    def forward(self, frame: Frame) -> None:
        """Add what somebody said on another link, byte for byte."""
        self._outbox.append(frame.raw)

    def room_bytes(self) -> int:
        """How much bulk - a log, a file, a list - may be added now. Ask before each message of it,
        and go on later."""
        return max(0, BULK_BYTES - sum(map(len, self._outbox)))

    def flush(self, now_s: float, lost: bool = False) -> None:
        """Send what was gathered, or let it be ``lost``. Raises LinkLostError."""
        frames, self._outbox = [] if lost else self._outbox, []
        self._due_s = now_s + DATAGRAM_FILL_S
        self._send(frames)

    def hasten(self) -> None:
        """Let what waits leave at the next chance: somebody waits for an answer."""
        self._due_s = 0.0

    def wait_s(self, now_s: float) -> float | None:
        """Seconds until the next flush, None when there is nothing to send."""
        return max(0.0, self._due_s - now_s) if self._outbox else None

    def _device(self, component: int) -> Endpoint:
        device = self._devices.get(component)
        if device is None:
            here = self.endpoint
            device = self._devices[component] = Endpoint(
                self.transport, here.system, component, here.signing
            )
        return device

    def _send(self, frames: Sequence[bytes]) -> None:
        packet = b""
        for frame in frames:
            if packet and len(packet) + len(frame) > self._largest:
                self.transport.send(packet)
                packet = b""
            packet += frame
        if packet:
            self.transport.send(packet)


class MeteredLink(GroundLink):
    """A way to the ground that carries only so many bytes a second of wall time: a serial line."""

    def __init__(
        self, transport: Transport, system: int, baud: int, signing: Signing | None = None
    ) -> None:
        super().__init__(transport, system, signing)
        self._budget = Budget(MAX_LINE_SHARE * baud / BITS_PER_BYTE)
        self._queue = Queue()

    def write(self, message: MessageType, values: Values) -> None:
        waiting = _queue_entry(self.endpoint, message, values)
        if message.message_id in _BULK:
            self._queue.add_bulk(waiting)
        else:
            self._queue.add_vital(waiting)

    def stream(self, message: MessageType, values: Values, part: int = 0) -> None:
        kind = self.endpoint.system, COMPONENT, message.message_id, part
        self._queue.add_telemetry(kind, _queue_entry(self.endpoint, message, values))

    def relay(self, frame: Frame) -> None:
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the HIL link lets only known messages pass"
        waiting = _queue_entry(self._device(frame.component), message, frame.decode())
        if frame.message_id in _HIGH_PRIORITY:
            self._queue.add_vital(waiting)
        else:
            self._queue.add_telemetry(
                (self.endpoint.system, frame.component, frame.message_id), waiting
            )

    def forward(self, frame: Frame) -> None:
        waiting = Waiting(len(frame.raw), lambda: frame.raw)
        if frame.message_id in _HIGH_PRIORITY:
            self._queue.add_vital(waiting)
        elif frame.message_id not in _BULK:
            self._queue.add_telemetry((frame.system, frame.component, frame.message_id), waiting)
        elif self.room_bytes() >= len(
            frame.raw
        ):  # nobody can hold the sender back: it has to ask again
            self._queue.add_bulk(waiting)

    def room_bytes(self) -> int:
        ahead = max(LARGEST_FRAME, BULK_BACKLOG_S * self._budget.bytes_per_s)
        return max(0, round(ahead) - self._queue.promised_bytes)

    def flush(self, now_s: float, lost: bool = False) -> None:
        self._due_s = now_s + DATAGRAM_FILL_S
        if lost:
            self._queue.clear()
        frames: list[bytes] = []
        while (frame := self._queue.take(self._budget.left(now_s))) is not None:
            self._budget.spend(len(frame))
            frames.append(frame)
        self._send(frames)

    def wait_s(self, now_s: float) -> float | None:
        return max(0.0, self._due_s - now_s) if self._queue else None


def ground_link(transport: Transport, system: int, signing: Signing | None = None) -> GroundLink:
    """The link over a transport: metered where its address gives a baud rate."""
    baud = baud_rate(transport.address)
    return (
        GroundLink(transport, system, signing)
        if baud is None
        else MeteredLink(transport, system, baud, signing)
    )


def _queue_entry(endpoint: Endpoint, message: MessageType, values: Values) -> Waiting:
    return Waiting(largest_frame(message), partial(encoded, endpoint, message, values))
