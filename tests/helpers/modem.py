"""Half-duplex modem channel with delay and losses, in virtual time, and between processes."""

import contextlib
import random
import selectors
import socket
import threading
import time
from collections.abc import Iterator
from typing import NamedTuple

from mavlink_io.codec import Frame, Framer


class _Transmission(NamedTuple):
    """A packet on its way."""

    begin_s: float
    """Time at which its first bit arrives."""
    end_s: float
    data: bytes


class ModemEnd:
    """One end of the channel, as a transport; its own packets leave one after the other."""

    def __init__(self, channel: "ModemChannel", address: str) -> None:
        self.address, self._channel = address, channel
        self.busy_until_s = 0.0
        """End of its own transmission."""
        self._sending: list[tuple[float, float]] = []
        self.arriving: list[_Transmission] = []
        self.sent: list[tuple[float, bytes]] = []
        """Time and bytes of each packet that was sent."""
        self.collisions = 0

    def handles(self) -> tuple[()]:
        return ()

    def send(self, data: bytes) -> None:
        """Queue a packet; it occupies the modem for the time that its bits take."""
        channel = self._channel
        self.sent.append((channel.now_s, data))
        begin_s = max(channel.now_s, self.busy_until_s)
        self.busy_until_s = begin_s + 8 * len(data) / channel.bit_per_s
        self._sending.append((begin_s, self.busy_until_s))
        if channel.rng.random() >= channel.loss:
            first_s, last_s = begin_s + channel.delay_s, self.busy_until_s + channel.delay_s
            channel.other(self).arriving.append(_Transmission(first_s, last_s, data))

    def receive(self) -> bytes:
        """Return what has arrived, without packets that came while this end was sending."""
        data, waiting = b"", []
        for packet in self.arriving:
            if packet.end_s > self._channel.now_s:
                waiting.append(packet)
            elif any(b < packet.end_s and e > packet.begin_s for b, e in self._sending):
                self.collisions += 1
            else:
                data += packet.data
        self.arriving = waiting
        return data

    def close(self) -> None:
        pass


class ModemChannel:
    """Two modems, of which each receives nothing while it sends."""

    def __init__(
        self, seed: int, *, delay_s: float = 3.0, loss: float = 0.3, bit_per_s: float = 1200.0
    ) -> None:
        self.rng = random.Random(seed)
        self.delay_s = delay_s
        self.loss = loss
        self.bit_per_s = bit_per_s
        self.now_s = 0.0
        self.vehicle, self.ground = ModemEnd(self, "modem"), ModemEnd(self, "ground")

    def other(self, end: ModemEnd) -> ModemEnd:
        return self.ground if end is self.vehicle else self.vehicle


@contextlib.contextmanager
def between_processes(channel: ModemChannel, ground_port: int) -> Iterator[str]:
    """Join a vehicle's UDP link to a ground station's port by the channel, on the wall clock.

    Yields the address for ``autopilot --gcs``. A datagram is a packet of the modem.
    """
    stop, period_s = threading.Event(), 0.02
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground,
        selectors.DefaultSelector() as selector,
    ):
        for end in (vehicle, ground):
            end.bind(("127.0.0.1", 0))
            selector.register(end, selectors.EVENT_READ)

        def relay() -> None:
            start_s, autopilot_address = time.monotonic(), None
            while not stop.is_set():
                ready = [key.fileobj for key, _ in selector.select(period_s)]
                channel.now_s = time.monotonic() - start_s
                if vehicle in ready:
                    data, autopilot_address = vehicle.recvfrom(65536)
                    channel.vehicle.send(data)
                if ground in ready:
                    channel.ground.send(ground.recv(65536))
                if arrived := channel.ground.receive():
                    ground.sendto(arrived, ("127.0.0.1", ground_port))
                if (arrived := channel.vehicle.receive()) and autopilot_address:
                    vehicle.sendto(arrived, autopilot_address)

        thread = threading.Thread(target=relay)
        thread.start()
        try:
            yield f"udpout:127.0.0.1:{vehicle.getsockname()[1]}"
        finally:
            stop.set()
            thread.join()


@contextlib.contextmanager
def tcp_server(port: int) -> Iterator[int]:
    """Join a UDP port to a TCP server for one client, as programs for serial modems do.

    Yields the port of the server. Bytes that are received at once are a packet of the modem.
    """
    stop, period_s = threading.Event(), 0.05
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
        socket.create_server(("127.0.0.1", 0)) as server,
        selectors.DefaultSelector() as selector,
    ):
        link.bind(("127.0.0.1", port))
        for end in (link, server):
            selector.register(end, selectors.EVENT_READ)

        def relay() -> None:
            peer = client = None
            while not stop.is_set():
                for key, _ in selector.select(period_s):
                    if key.fileobj is server:
                        client, _ = server.accept()
                        selector.register(client, selectors.EVENT_READ)
                    elif key.fileobj is link:
                        data, peer = link.recvfrom(65536)
                        if client:
                            client.sendall(data)
                    elif client and (data := client.recv(65536)):
                        if peer:
                            link.sendto(data, peer)
                    elif client:
                        selector.unregister(client)
                        client.close()
                        client = None

        thread = threading.Thread(target=relay)
        thread.start()
        try:
            yield server.getsockname()[1]
        finally:
            stop.set()
            thread.join()


def frames(packets: list[tuple[float, bytes]]) -> list[tuple[float, Frame]]:
    """Return time and frame of everything that was sent."""
    framer = Framer()
    return [(time_s, frame) for time_s, data in packets for frame in framer.feed(data)]
