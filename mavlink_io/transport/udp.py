"""UDP: datagrams to one peer, or to whoever spoke lately."""

import contextlib
import socket
from collections.abc import Sequence

from mavlink_io.clock import wall_s
from mavlink_io.transport.base import MAX_DATAGRAM, Handle, open_or_raise

PEER_IDLE_S = 10.0
"""A UDP peer that was silent for longer is forgotten."""


class UdpTransport:
    """A UDP socket: bound (``udpin``, learns its peers) or aimed at one peer (``udpout``).

    Datagrams that cannot leave or arrive, as while a network is down, are lost like any other.
    """

    def __init__(self, address: str, host: str, port: int, *, bind: bool) -> None:
        self.address = address
        self._peers: dict[tuple[str, int], float] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        with contextlib.suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        if bind:
            open_or_raise(address, lambda: self._socket.bind((host, port)))
        else:
            open_or_raise(
                address,
                lambda: self._peers.update({(socket.gethostbyname(host), port): float("inf")}),
            )

    def handles(self) -> Sequence[Handle]:
        return (self._socket,)

    def send(self, data: bytes) -> None:
        for peer in list(self._peers):
            with contextlib.suppress(OSError):
                self._socket.sendto(data, peer)

    def receive(self) -> bytes:
        try:
            data, peer = self._socket.recvfrom(MAX_DATAGRAM)
        except OSError:
            return b""
        self._remember(peer)
        return data

    def close(self) -> None:
        self._socket.close()

    def _remember(self, peer: tuple[str, int]) -> None:
        if self._peers.get(peer) == float("inf"):
            return
        now = wall_s()
        if peer not in self._peers:
            for idle in [p for p, seen in self._peers.items() if now - seen > PEER_IDLE_S]:
                del self._peers[idle]
        self._peers[peer] = now
