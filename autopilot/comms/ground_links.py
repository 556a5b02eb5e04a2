"""Ground links: queueing, batching and rate limiting of outgoing frames."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple, Protocol

from autopilot.comms.bandwidth_limiter import (
    BITS_PER_BYTE,
    MAX_LINE_SHARE,
    QueuedFrame,
    SendQueue,
    TokenBucket,
)
from autopilot.comms.inbox import Inbox
from autopilot.comms.stream_rates import Schedule, profile_for
from autopilot.reports import SteadyReport, TickReport
from autopilot.telemetry.encoding import pack_payload
from autopilot.telemetry.identity import COMPONENT
from autopilot.telemetry.streams import STREAMS, StreamGroup, TelemetryStream
from mavlink_io import dialect
from mavlink_io.clock import wall_s
from mavlink_io.codec import MAX_FRAME_BYTES, Frame, largest_frame
from mavlink_io.dialect import MessageType, Values
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import MavlinkId
from mavlink_io.signing import Signing
from mavlink_io.transport import Transport, baud_rate

BATCH_S = 0.02
"""Wall time over which frames are batched; the first frame after a pause is sent at once."""
MAX_DATAGRAM_BYTES, MAX_STREAM_BYTES = 1200, 16_384
"""Largest packet: a UDP datagram that common networks do not fragment, and a stream write."""
BULK_BYTES = 16_384
"""Limit of bulk data in the queue of a link without a baud rate: about 800 kB/s with BATCH_S."""
BULK_BACKLOG_S = 0.25
"""Queue length on a serial line, as time to send it, below which bulk data is added."""

MAX_SENDERS = 64
"""Number of senders of a link that are recorded for routing and greeted with a heartbeat."""
STREAM_BACKLOG_FRAMES = 64
"""Number of waiting frames below which a stream is read again."""
MAX_READING_S = 2e-3
"""Wall time for which one pass of the main loop reads datagrams of a link."""

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
"""Forwarded and relayed messages that are never dropped; of others only the newest is sent."""


class _TickTelemetry(NamedTuple):
    """Telemetry of a tick in the queue."""

    group: StreamGroup
    report: TickReport | SteadyReport

    @property
    def max_bytes(self) -> int:
        """Upper bound of the bytes of all frames."""
        return self.group.max_bytes


class TelemetryEncoder(Protocol):
    """Compiled code that encodes telemetry in batches: ``compiled_streams.FrameEncoder``."""

    def add(self, group: StreamGroup, report: SteadyReport, max_bytes: int) -> bool:
        """Add messages of a tick to the batch, if they belong to it."""
        ...

    def take(self, endpoint: Endpoint) -> bytes:
        """Return the frames of the batch, which ends, as the next ones of an endpoint."""
        ...


class GroundLink:
    """A ground link without a rate limit. Frames are sent in order, batched over BATCH_S.

    Far above real time one system call per tick would take longer than the tick itself. For the
    same reason the frames of a batch are encoded together: the processor then has this code and its
    data in its caches, and encodes a frame in less than half the time.
    """

    def __init__(
        self,
        transport: Transport,
        system: int,
        signing: Signing | None = None,
        streams: Sequence[TelemetryStream] = STREAMS,
        modem_s: float | None = None,
        encoder: TelemetryEncoder | None = None,
    ) -> None:
        """``modem_s`` is the time between two HIGH_LATENCY2 on a modem; None is no modem.

        ``encoder`` is used where the link does not sign.
        """
        self.transport, self._encoder = transport, None if signing else encoder
        self.endpoint = Endpoint(transport, system, COMPONENT, signing, accept_unknown=True)
        self.profile = profile_for(baud_rate(transport.address), streams)
        self.schedule = Schedule(self.profile, streams, modem_s)
        self._datagrams = transport.address.startswith("udp")
        self._max_packet_bytes = MAX_DATAGRAM_BYTES if self._datagrams else MAX_STREAM_BYTES
        self._devices: dict[int, Endpoint] = {COMPONENT: self.endpoint}
        """Endpoint of each component: receivers count gaps in the sequence of an id as losses."""
        self._outbox: list[QueuedFrame | _TickTelemetry] = []
        self.errors: list[Exception] = []
        """Exceptions of messages that could not be encoded; the other messages were sent."""
        self.backlog = Inbox()
        """Received frames that are not processed yet."""
        self._due_s = 0.0
        self._known_senders: set[MavlinkId] = set()

    @property
    def trusted(self) -> bool:
        """Whether the link may carry a signing key: a serial line, or a link that is signed."""
        return self.endpoint.signing is not None or baud_rate(self.transport.address) is not None

    def register_sender(self, sender: MavlinkId) -> bool:
        """Record a sender; return whether this is its first message on this link.

        Senders beyond `MAX_SENDERS` are served, but not recorded.
        """
        if sender in self._known_senders or len(self._known_senders) >= MAX_SENDERS:
            return False
        self._known_senders.add(sender)
        return True

    def read_pending(self) -> None:
        """Read received frames into the backlog. Raises LinkLostError.

        Datagrams are read until none waits: the system drops those of all senders when its buffer
        is full. A stream is read when the backlog is short: until then its data waits in the
        operating system, which slows down its sender.
        """
        if not self._datagrams:
            if len(self.backlog) < STREAM_BACKLOG_FRAMES:
                self._read_once()
            return
        until_s = wall_s() + MAX_READING_S
        while self._read_once() and wall_s() < until_s:
            pass

    def _read_once(self) -> bool:
        """Read once from the transport; return whether anything had arrived."""
        pieces = self.endpoint.receive_from_peers()
        for peer, frames in pieces:
            for frame in frames:
                self.backlog.add(peer, frame)
        return bool(pieces)

    def write(self, message: MessageType, values: Values) -> None:
        """Queue a message that is never dropped."""
        self._outbox.append(_queue_entry(self.endpoint, message, pack_payload(message, values)))

    def stream(self, message: MessageType, values: Values, part: int = 0) -> None:
        """Queue telemetry; on a slow line only the newest of each message and part is sent."""
        self.write(message, values)  # only a `BandwidthLimitedLink` drops telemetry

    def publish(self, group: StreamGroup, report: TickReport | SteadyReport) -> None:
        """Queue the messages of streams that a report is enough for, as ``stream`` does."""
        self._outbox.append(_TickTelemetry(group, report))

    def relay(self, frame: Frame) -> None:
        """Queue a message of an onboard device, with the device's component id."""
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the HIL link lets only known messages pass"
        self._outbox.append(_queue_entry(self._device(frame.component), message, frame.payload))

    def forward(self, frame: Frame) -> None:
        """Queue a frame received on another link, byte for byte."""
        self._outbox.append(QueuedFrame(len(frame.raw), lambda: frame.raw))

    def room_bytes(self) -> int:
        """Return how many bytes of bulk data (log, file, list) may be queued now.

        Services call it before each message, and continue later when there is no room.
        """
        return max(0, BULK_BYTES - sum(entry.max_bytes for entry in self._outbox))

    def flush(self, now_s: float, discard: bool = False) -> None:
        """Send the queued frames, or ``discard`` them. Raises LinkLostError."""
        entries, self._outbox = [] if discard else self._outbox, []
        self._due_s = now_s + BATCH_S
        frames: list[bytes] = []
        for entry in entries:
            if self._add_to_batch(entry):
                continue
            self._end_batch(frames)
            if isinstance(entry, QueuedFrame):
                frames.append(entry.encode())
            elif not self._add_to_batch(entry):
                self._encode_telemetry(entry, frames)
        self._end_batch(frames)
        self._send(frames)

    def _add_to_batch(self, entry: "QueuedFrame | _TickTelemetry") -> bool:
        """Add an entry to the batch of the compiled encoder; return whether that is possible."""
        return (
            self._encoder is not None
            and isinstance(entry, _TickTelemetry)
            and entry.group.is_numeric
            and isinstance(entry.report, SteadyReport)
            and self._encoder.add(entry.group, entry.report, self._max_packet_bytes)
        )

    def _end_batch(self, frames: list[bytes]) -> None:
        """Append the frames of the batch of the compiled encoder."""
        if self._encoder is not None and (batch := self._encoder.take(self.endpoint)):
            frames.append(batch)

    def _encode_telemetry(self, telemetry: _TickTelemetry, frames: list[bytes]) -> None:
        """Build and encode the telemetry of a tick, and append its frames."""
        group, report = telemetry
        for stream in group.streams:
            message = stream.message
            try:
                payload = pack_payload(message, stream.build(report))
            except Exception as error:  # the other messages are sent
                self.errors.append(error)
            else:
                frames.append(self.endpoint.encode_payload(message, payload))

    def flush_soon(self) -> None:
        """Make the next flush due now: a client waits for a reply."""
        self._due_s = 0.0

    def wait_s(self, now_s: float) -> float | None:
        """Return the seconds until the next flush; None when there is nothing to send."""
        return max(0.0, self._due_s - now_s) if self._outbox else None

    def _device(self, component: int) -> Endpoint:
        """Return the endpoint that sends under the id of an onboard device."""
        device = self._devices.get(component)
        if device is None:
            own = self.endpoint
            device = self._devices[component] = Endpoint(
                self.transport, own.system, component, own.signing
            )
        return device

    def _send(self, frames: Sequence[bytes]) -> None:
        """Send frames, as many in one packet as its size allows."""
        packet, length = list[bytes](), 0
        for frame in frames:
            if length + len(frame) > self._max_packet_bytes and packet:
                self.transport.send(b"".join(packet))
                packet, length = [], 0
            packet.append(frame)
            length += len(frame)
        if packet:
            self.transport.send(b"".join(packet))


class BandwidthLimitedLink(GroundLink):
    """A ground link with a limit of bytes per second of wall time: a serial line."""

    def __init__(
        self,
        transport: Transport,
        system: int,
        baud: int,
        signing: Signing | None = None,
        streams: Sequence[TelemetryStream] = STREAMS,
        modem_s: float | None = None,
    ) -> None:
        super().__init__(transport, system, signing, streams, modem_s)
        self._budget = TokenBucket(MAX_LINE_SHARE * baud / BITS_PER_BYTE)
        self._queue = SendQueue()

    def write(self, message: MessageType, values: Values) -> None:
        """Queue a message as a reply, or as bulk by its type."""
        entry = _queue_entry(self.endpoint, message, pack_payload(message, values))
        if message.message_id in _BULK:
            self._queue.add_bulk(entry)
        else:
            self._queue.add_reply(entry)

    def stream(self, message: MessageType, values: Values, part: int = 0) -> None:
        """Queue telemetry; it replaces a waiting message of the same type and part."""
        kind = self.endpoint.system, COMPONENT, message.message_id, part
        payload = pack_payload(message, values)
        self._queue.add_telemetry(kind, _queue_entry(self.endpoint, message, payload))

    def publish(self, group: StreamGroup, report: TickReport | SteadyReport) -> None:
        """Queue the messages of streams that a report is enough for, as ``stream`` does."""
        for stream in group.streams:
            try:
                self.stream(stream.message, stream.build(report))
            except Exception as error:  # the other messages are sent
                self.errors.append(error)

    def relay(self, frame: Frame) -> None:
        """Queue a device message as a reply or as telemetry, by its type."""
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the HIL link lets only known messages pass"
        entry = _queue_entry(self._device(frame.component), message, frame.payload)
        if frame.message_id in _HIGH_PRIORITY:
            self._queue.add_reply(entry)
        else:
            self._queue.add_telemetry(
                (self.endpoint.system, frame.component, frame.message_id), entry
            )

    def forward(self, frame: Frame) -> None:
        """Queue a forwarded frame as a reply, telemetry or bulk, by its type."""
        entry = QueuedFrame(len(frame.raw), lambda: frame.raw)
        if frame.message_id in _HIGH_PRIORITY:
            self._queue.add_reply(entry)
        elif frame.message_id not in _BULK:
            self._queue.add_telemetry((frame.system, frame.component, frame.message_id), entry)
        elif self.room_bytes() >= len(frame.raw):
            # Otherwise the frame is dropped: the sender cannot be slowed down and has to repeat it.
            self._queue.add_bulk(entry)

    def room_bytes(self) -> int:
        """Return how many bytes of bulk data may be queued now."""
        limit_bytes = max(MAX_FRAME_BYTES, BULK_BACKLOG_S * self._budget.bytes_per_s)
        return max(0, round(limit_bytes) - self._queue.committed_bytes)

    def flush(self, now_s: float, discard: bool = False) -> None:
        """Send as many queued frames as the rate allows."""
        self._due_s = now_s + BATCH_S
        if discard:
            self._queue.clear()
        frames: list[bytes] = []
        while (frame := self._queue.pop(self._budget.available_bytes(now_s))) is not None:
            self._budget.spend(len(frame))
            frames.append(frame)
        self._send(frames)

    def wait_s(self, now_s: float) -> float | None:
        """Return the seconds until the next flush; None when the queue is empty."""
        return max(0.0, self._due_s - now_s) if self._queue else None


def ground_link(
    transport: Transport,
    system: int,
    signing: Signing | None = None,
    streams: Sequence[TelemetryStream] = STREAMS,
    modem_s: float | None = None,
    encoder: TelemetryEncoder | None = None,
) -> GroundLink:
    """Return the ground link over a transport, rate-limited when its address has a baud rate."""
    baud = baud_rate(transport.address)
    return (
        GroundLink(transport, system, signing, streams, modem_s, encoder)
        if baud is None
        else BandwidthLimitedLink(transport, system, baud, signing, streams, modem_s)
    )


def _queue_entry(endpoint: Endpoint, message: MessageType, payload: bytes) -> QueuedFrame:
    """Return a queue entry that makes the frame of a payload when it is sent."""
    return QueuedFrame(largest_frame(message), partial(endpoint.encode_payload, message, payload))
