"""A MAVLink participant on one transport: its identity, its outgoing sequence, the gaps in what it
hears."""

from typing import Any

from mavlink_io import dialect
from mavlink_io.codec import SIGNED_FLAG, Frame, Framer, encode
from mavlink_io.signing import Signing
from mavlink_io.transport import SharedTransport, Transport


class Endpoint:
    """Sends as one system and component, receives from all: with ``signing``, from all who hold its
    key."""

    def __init__(
        self,
        transport: Transport,
        system: int,
        component: int,
        signing: Signing | None = None,
        *,
        strangers: bool = False,
    ) -> None:
        """With ``strangers``, messages that the dialect lacks are received too, for whoever may
        know them."""
        self.transport, self.system, self.component = transport, system, component
        self._shared = transport if isinstance(transport, SharedTransport) else None
        self.signing = signing
        self._sequence = 0
        self._expected: dict[tuple[int, int], int] = {}
        self._framer = Framer(self._expected if strangers else ())
        self.lost_frames = 0
        """Frames that other participants sent and that never arrived, by their sequence numbers."""

    def send(self, name: str, **fields: Any) -> None:
        """Send one message; extension fields may be left out."""
        message = dialect.by_name(name)
        self.send_values(message, message.values(**fields))

    def send_values(self, message: dialect.MessageType, values: tuple[Any, ...]) -> None:
        """Send one message whose fields stand in wire order: the fast path."""
        self.transport.send(self.encode_values(message, values))

    def encode_values(self, message: dialect.MessageType, values: tuple[Any, ...]) -> bytes:
        """One message as the next frame of this participant, for a caller that sends several in one
        datagram."""
        sequence, flags = (self._sequence + 1) & 0xFF, 0 if self.signing is None else SIGNED_FLAG
        frame = encode(message, values, sequence, self.system, self.component, flags)
        self._sequence = sequence  # a message that could not be packed leaves no gap
        return frame if self.signing is None else self.signing.sign(frame)

    def receive(self) -> list[Frame]:
        """The frames that have arrived since the last call. Raises LinkLostError when the other end
        is gone."""
        if self._shared is not None:
            frames = self._receive_from(self._shared)
        else:
            data = self.transport.receive()
            frames = self._framer.feed(data) if data else []
        if not frames:
            return frames
        if self.signing is not None:
            frames = [frame for frame in frames if self.signing.accepts(frame)]
        for frame in frames:
            self._count(frame)
        return frames

    def _receive_from(self, shared: SharedTransport) -> list[Frame]:
        """The frames of every peer, each cut from the peer's own bytes."""
        frames: list[Frame] = []
        for peer, data in shared.receive_from():
            if data:
                frames += self._framer.feed(data, peer)
            else:
                self._framer.forget(peer)
        return frames

    @property
    def partial_streams(self) -> int:
        """Peers that have sent the beginning of a frame and not its end."""
        return self._framer.partial_streams

    @property
    def rejected_frames(self) -> int:
        """Received frames whose CRC was wrong."""
        return self._framer.rejected_frames

    @property
    def skipped_bytes(self) -> int:
        """Received bytes that belonged to no frame."""
        return self._framer.skipped_bytes

    def _count(self, frame: Frame) -> None:
        sender = frame.system, frame.component
        expected = self._expected.get(sender)
        if expected is not None:
            self.lost_frames += (frame.sequence - expected) & 0xFF
        self._expected[sender] = (frame.sequence + 1) & 0xFF
