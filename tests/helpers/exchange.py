"""Exchange of a MAVLink service that blocks until its end."""

from typing import TypeVar

from mavlink_io.clock import wall_s
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import Exchange
from mavlink_io.transport import wait

T = TypeVar("T")
TIMEOUT_S = 30.0
"""Maximum wall time of an exchange."""


def run(exchange: Exchange[T], endpoint: Endpoint) -> T:
    """Run an exchange to its end and return its result; no other code reads the endpoint."""
    deadline_s = wall_s() + TIMEOUT_S
    while not exchange.done:
        now_s = wall_s()
        assert now_s < deadline_s, "the exchange did not end"
        exchange.poll(now_s)
        wait([endpoint.transport], 0.02)
        for frame in endpoint.receive():
            exchange.feed(frame)
    return exchange.result()
