"""Floor of a tick in lockstep: round trip of two datagrams between two processes on one core.

    python -m benchmarks.speed.ping_pong [CORE]

Both ends block while they wait, as the processes of a dive do. Prints the median round trip (us).
"""

import os
import socket
import statistics
import sys
import time

from benchmarks.speed import machine
from ground.simulation import affinity

SENSOR_BYTES, ACTUATOR_BYTES = 150, 93
"""Sizes of the datagrams of a tick in both directions."""
ROUNDS, WARM_UP = 5000, 500


def round_trip_us() -> float:
    """Return the median round trip of a new pair of processes, on the core with the least load."""
    core = affinity.take_core()
    if core is not None:
        affinity.release_core(core)
    arguments = ["-m", "benchmarks.speed.ping_pong", *([] if core is None else [str(core)])]
    return float(machine.output_of(arguments))


def _answer(own: socket.socket) -> None:
    """Answer each datagram until an empty one arrives."""
    answer = bytes(ACTUATOR_BYTES)
    while True:
        data, sender = own.recvfrom(2048)
        if not data:
            return
        own.sendto(answer, sender)


def _measure(own: socket.socket) -> float:
    """Return the median round trip (us)."""
    question, trips_s = bytes(SENSOR_BYTES), []
    for _ in range(WARM_UP + ROUNDS):
        began_s = time.perf_counter()
        own.send(question)
        own.recv(2048)
        trips_s.append(time.perf_counter() - began_s)
    own.send(b"")
    return 1e6 * statistics.median(trips_s[WARM_UP:])


def main() -> None:
    """Start the other end as a child, and print the median round trip."""
    if len(sys.argv) > 1:
        affinity.pin(0, int(sys.argv[1]))
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
    ):
        server.bind(("127.0.0.1", 0))
        client.connect(server.getsockname())
        if not os.fork():
            _answer(server)
            os._exit(0)
        sys.stdout.write(f"{_measure(client):.3f}\n")
        os.wait()


if __name__ == "__main__":
    main()
