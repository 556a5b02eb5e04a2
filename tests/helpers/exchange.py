"""Exchange of a MAVLink service that blocks until its end."""

from typing import TypeVar

from mavlink_io.clock import wall_s
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import Exchange, ExchangeError
from mavlink_io.transport import wait

T = TypeVar("T")


def run(exchange: Exchange[T], endpoint: Endpoint, timeout_s: float = 30.0) -> T:
    """Run an exchange to its end and return its result; no other code reads the endpoint.

    Raises ExchangeError if it fails or takes longer than ``timeout_s`` of wall time.
    """
    deadline_s = wall_s() + timeout_s
    while not exchange.done:
        now_s = wall_s()
        if now_s > deadline_s:
            raise ExchangeError(f"not finished within {timeout_s:g} s")
        exchange.poll(now_s)
        wait([endpoint.transport], 0.02)
        for frame in endpoint.receive():
            exchange.feed(frame)
    return exchange.result()
