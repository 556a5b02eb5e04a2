"""A MAVLink participant on one transport: its ids, sequence numbers and count of lost frames."""

from collections.abc import Hashable, Sequence
from typing import Any

from mavlink_io import dialect
from mavlink_io.codec import MAX_REJECTED, SIGNED_FLAG, Frame, Framer, encode_payload
from mavlink_io.fixed_frame import SENDER, SEQUENCE, FixedFrame
from mavlink_io.frame_loss import FrameLoss
from mavlink_io.signing import Signing
from mavlink_io.transport import (
    SPIN_S,
    LockstepTransport,
    Peer,
    Piece,
    SharedTransport,
    Transport,
    wait,
)


class Endpoint:
    """Send messages as one system and component; receive the messages of all senders.

    Parameters
    ----------
    transport : Transport
        Carries the bytes.
    system, component : int
        Ids of this participant, 1 to 255.
    signing : Signing, optional
        Key of the link. With it every sent frame is signed, and received frames that are not
        correctly signed are dropped.
    accept_unknown : bool
        Also receive messages that the dialect does not define, from senders of earlier frames, so
        that they can be forwarded.
    """

    def __init__(
        self,
        transport: Transport,
        system: int,
        component: int,
        signing: Signing | None = None,
        *,
        accept_unknown: bool = False,
    ) -> None:
        self.transport, self.system, self.component = transport, system, component
        self._shared = transport if isinstance(transport, SharedTransport) else None
        self._lockstep = transport if isinstance(transport, LockstepTransport) else None
        self.signing = signing
        self._sequence = 0
        self._losses: dict[tuple[int, int], FrameLoss] = {}
        self._unread = b""
        """Datagram that ``put_back`` has returned."""
        self._framer = Framer(self._losses if accept_unknown else (), MAX_REJECTED)

    def send(self, name: str, **fields: Any) -> None:
        """Send one message.

        Parameters
        ----------
        name : str
            Name of the message, such as "HEARTBEAT".
        **fields
            Fields of the message; extension fields may be left out.

        Raises
        ------
        KeyError
            The dialect does not define the message.
        TypeError
            A field is unknown or missing.
        LinkLostError
            The other end of the link is gone.
        """
        message = dialect.by_name(name)
        self.send_values(message, message.values(**fields))

    def send_values(self, message: dialect.MessageType, values: tuple[Any, ...]) -> None:
        """Send one message whose fields are in wire order: faster than ``send``.

        Parameters
        ----------
        message : MessageType
            Type of the message.
        values : tuple
            Fields in wire order.

        Raises
        ------
        LinkLostError
            The other end of the link is gone.
        """
        self.transport.send(self.encode_values(message, values))

    def encode_values(self, message: dialect.MessageType, values: tuple[Any, ...]) -> bytes:
        """Encode one message as the next frame of this participant, without sending it.

        For a caller that sends several frames in one datagram.

        Parameters
        ----------
        message : MessageType
            Type of the message.
        values : tuple
            Fields in wire order.

        Returns
        -------
        bytes
            The frame, signed if the endpoint has a key.
        """
        return self.encode_payload(message, message.pack(values))

    def encode_fixed(self, message: FixedFrame, fields: tuple[Any, ...]) -> bytes:
        """Encode one message, as ``encode_values`` does, from fields without nested arrays.

        Parameters
        ----------
        message : FixedFrame
            Codec of the message.
        fields : tuple
            Fields in wire order, arrays element by element.

        Returns
        -------
        bytes
            The frame, signed if the endpoint has a key.
        """
        return self.encode_payload(message.message, message.pack(*fields))

    def encode_payload(self, message: dialect.MessageType, payload: bytes) -> bytes:
        """Encode one packed message, as ``encode_values`` does.

        Parameters
        ----------
        message : MessageType
            Type of the message.
        payload : bytes
            Fields in wire order; trailing zeros may be missing.

        Returns
        -------
        bytes
            The frame, signed if the endpoint has a key.
        """
        self._sequence = sequence = (self._sequence + 1) & 0xFF
        if self.signing is None:
            return encode_payload(message, payload, sequence, self.system, self.component)
        return self.signing.sign(
            encode_payload(message, payload, sequence, self.system, self.component, SIGNED_FLAG)
        )

    @property
    def sequence(self) -> int:
        """Sequence number of the next frame."""
        return (self._sequence + 1) & 0xFF

    @property
    def sender(self) -> int:
        """256 times the system id plus the component id."""
        return self.system << 8 | self.component

    def take_sequence(self, count: int = 1) -> int:
        """Return the sequence number of a frame that the caller encodes, and count it as sent.

        Parameters
        ----------
        count : int
            Number of frames that the caller encodes.

        Returns
        -------
        int
            Sequence number of the last of them, 0 to 255.
        """
        self._sequence = sequence = (self._sequence + count) & 0xFF
        return sequence

    def peer(self) -> Peer | None:
        """Return the socket and the only peer, for compiled code.

        Returns
        -------
        Peer or None
            None if the transport carries no datagrams, or has no peer or several ones.
        """
        return None if self._lockstep is None else self._lockstep.peer()

    def record_sender(self, sender: tuple[str, int] | None) -> bool:
        """Record the sender of a datagram that compiled code has read.

        Parameters
        ----------
        sender : tuple of str and int, or None
            Its address; None for the ``peer``.

        Returns
        -------
        bool
            Whether the datagram may be used: False if there are too many peers.
        """
        return self._lockstep is not None and self._lockstep.record_sender(sender)

    @property
    def has_unread(self) -> bool:
        """Whether a datagram of ``put_back`` waits."""
        return bool(self._unread)

    def put_back(self, datagram: bytes) -> None:
        """Return a datagram that was read: ``receive`` or ``receive_fixed`` reads it next.

        Parameters
        ----------
        datagram : bytes
            The datagram.
        """
        self._unread = datagram

    def receive(self, *, eager: bool = False) -> list[Frame]:
        """Return the frames that have arrived since the last call.

        Parameters
        ----------
        eager : bool
            Whether to wait for them, at most `SPIN_S`, with the shortest reaction time.

        Returns
        -------
        list of Frame
            Frames in the order of arrival; with a key, only correctly signed ones.

        Raises
        ------
        LinkLostError
            The other end of the link is gone.
        """
        return self._frames(self._receive_pieces(eager=eager))

    def receive_fixed(
        self, expected: FixedFrame, *, eager: bool = False
    ) -> tuple[tuple[Any, ...] | None, bytes, list[Frame]]:
        """Receive as ``receive`` does, on a link where one message arrives nearly always alone.

        Parameters
        ----------
        expected : FixedFrame
            Codec of that message.
        eager : bool
            Whether to wait, as in ``receive``.

        Returns
        -------
        decoded : tuple or None
            The message as ``FixedFrame.decode`` returns it; None if anything else has arrived.
        raw : bytes
            The whole frame of that message.
        frames : list of Frame
            The frames that have arrived, if it is anything else.

        Raises
        ------
        LinkLostError
            The other end of the link is gone.
        """
        pieces = self._receive_pieces(eager=eager)
        if len(pieces) == 1 and self.signing is None and not self._framer.partial_streams:
            data = pieces[0][1]
            decoded = expected.decode(data)
            if decoded is not None:
                self._loss_of(decoded[SENDER]).count(decoded[SEQUENCE])
                return decoded, data, []
        return None, b"", self._frames(pieces)

    def _receive_pieces(self, *, eager: bool) -> Sequence[Piece]:
        """Return a datagram of ``put_back``, or the bytes that have arrived from each peer.

        Wait for them if ``eager``.
        """
        if self._unread:
            datagram, self._unread = self._unread, b""
            return ((None, datagram),)
        if self._lockstep is not None:
            self._lockstep.eager = eager
        elif eager:
            wait((self.transport,), SPIN_S, eager=True)
        return self._read()

    def receive_from_peers(self) -> list[tuple[Hashable, list[Frame]]]:
        """Read once; return the peers that have sent, each with the frames that are complete.

        Returns
        -------
        list of (peer, list of Frame)
            A peer may have sent bytes that complete no frame. The peer of a transport with one
            other end is None. The list is empty if nothing has arrived.

        Raises
        ------
        LinkLostError
            The other end of the link is gone.
        """
        received: list[tuple[Hashable, list[Frame]]] = []
        for peer, data in self._read():
            if data:
                received.append((peer, self._frames([(peer, data)])))
            else:
                self._framer.forget(peer)
        return received

    def _read(self) -> Sequence[Piece]:
        """Return the bytes that have arrived from each peer."""
        if self._shared is not None:
            return self._shared.receive_from()
        data = self.transport.receive()
        return ((None, data),) if data else ()

    def _frames(self, pieces: Sequence[Piece]) -> list[Frame]:
        """Return the frames in received bytes; the bytes of each peer are framed separately."""
        frames: list[Frame] = []
        for peer, data in pieces:
            if data:
                frames += self._framer.feed(data, peer)
            else:
                self._framer.forget(peer)
        if self.signing is not None:
            frames = [frame for frame in frames if self.signing.accepts(frame)]
        for frame in frames:
            loss = self._loss_of((frame.system, frame.component))
            loss.count(frame.sequence, frame.message_id, frame.payload)
        return frames

    @property
    def partial_streams(self) -> int:
        """Number of peers that have sent an incomplete frame."""
        return self._framer.partial_streams

    @property
    def rejected_frames(self) -> int:
        """Number of received frames with a wrong CRC."""
        return self._framer.rejected_frames

    @property
    def skipped_bytes(self) -> int:
        """Number of received bytes that belonged to no frame."""
        return self._framer.skipped_bytes

    @property
    def lost_frames(self) -> int:
        """Number of frames of other participants that did not arrive, by sequence numbers."""
        return sum(loss.lost for loss in self._losses.values())

    def _loss_of(self, sender: tuple[int, int]) -> FrameLoss:
        """Return the count of a sender; it is new at its first frame."""
        loss = self._losses.get(sender)
        if loss is None:
            loss = self._losses[sender] = FrameLoss()
        return loss
