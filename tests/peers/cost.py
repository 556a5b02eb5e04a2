"""Processor time of `sitl` per simulated second, as the simulator of ArduPilot and of PX4.

Usage: python -m tests.peers.cost [SECONDS]

SECONDS are simulated at each rate (10). The time is that of the simulator's process alone, physics
and messages; the peer's is not counted. Median and minimum of the simulated seconds: on a busy
machine other programs empty the caches. The process has one core, where it blocks while it waits
for its peer: on several free cores it polls, and that time would be counted.
"""

import os
import statistics
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from socket import SOCK_STREAM

from tests.helpers.subprocesses import Process, free_port, process
from tests.peers.ardupilot import ArduPilot
from tests.peers.px4 import Px4

RATES_HZ = (250, 400, 1200)
CORE = 0
NS_PER_MS = 1e6


def cpu_ms(program: Process) -> float:
    """Return the processor time of a process so far (ms), from schedstat of proc(5)."""
    threads = Path(f"/proc/{program.pid}/task").iterdir()
    return sum(int((thread / "schedstat").read_text().split()[0]) for thread in threads) / NS_PER_MS


def measure(program: Process, fly_second: Callable[[], object], seconds: int) -> str:
    """Return the processor time of simulated seconds, after one that is not counted."""
    program.pin(CORE)
    fly_second()
    times_ms = []
    for _ in range(seconds):
        before_ms = cpu_ms(program)
        fly_second()
        times_ms.append(cpu_ms(program) - before_ms)
    return f"{statistics.median(times_ms):.0f} ms | {min(times_ms):.0f} ms"


def ardupilot_cost(rate_hz: int, seconds: int) -> str:
    """Return the cost of simulated seconds with ArduPilot's frames."""
    port = free_port()
    command = ("-m", "sitl", "--autopilot", "ardupilot", "--hil", f"udpin:127.0.0.1:{port}")
    with process(*command) as sitl, closing(ArduPilot(port, rate_hz)) as peer:
        return measure(sitl, lambda: peer.fly(rate_hz), seconds)


def px4_cost(rate_hz: int, seconds: int) -> str:
    """Return the cost of simulated seconds with PX4 in lockstep."""
    address = f"tcpin:127.0.0.1:{(port := free_port(SOCK_STREAM))}"
    command = ("-m", "sitl", "--autopilot", "px4", "--hil", address, "--speed", "max")
    with (
        process(*command, "--rate", str(rate_hz)) as sitl,
        closing(Px4(port)) as peer,
    ):
        return measure(sitl, lambda: list(peer.fly(rate_hz)), seconds)


def main(seconds: int) -> None:
    """Print a table of both autopilots at each rate."""
    print("| autopilot | rate | median | minimum |\n|---|---|---|---|")
    for rate_hz in RATES_HZ:
        print(f"| ArduPilot | {rate_hz} Hz | {ardupilot_cost(rate_hz, seconds)} |", flush=True)
    for rate_hz in RATES_HZ:
        print(f"| PX4 | {rate_hz} Hz | {px4_cost(rate_hz, seconds)} |", flush=True)
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
