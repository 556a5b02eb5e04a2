"""Three vehicles on one machine, in one sea: one ground station flies them at once."""

import contextlib
import json
import subprocess
import sys

import pytest

from tests.clients.fixture import STANDBY, wait_for_heartbeat
from tests.helpers.subprocesses import TIMEOUT_S, autopilot, free_port, process

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]
SYSTEMS = (1, 2, 3)


@contextlib.contextmanager
def vehicle_of_fleet(system: int, *links: str):  # type: ignore[no-untyped-def]
    """Start a vehicle with a system id and port of its own, 10 m east of the one before."""
    hil = free_port()
    with (
        autopilot(f"udpin:127.0.0.1:{hil}", *links, options=("--system-id", str(system))),
        process(
            *("-m", "sitl", "--hil", f"udpout:127.0.0.1:{hil}", "--seed", str(system)),
            *("--scenario", "swell", "--sea-seed", "7", "--place", f"0,{10 * system}"),
        ),
    ):
        yield


def test_mavsdk_flies_three_vehicles_at_once_and_ground_reaches_each(
    capsys: pytest.CaptureFixture[str],
) -> None:
    port, ground = free_port(), free_port()
    links = [f"udpout:127.0.0.1:{number}" for number in (port, ground)]
    with contextlib.ExitStack() as stack:
        for system in SYSTEMS:  # one after the other: the first one may compile the physics
            spare = free_port()
            own = (*links, f"udpout:127.0.0.1:{spare}")
            stack.enter_context(vehicle_of_fleet(system, *own))
            wait_for_heartbeat(f"udpin:127.0.0.1:{spare}", STANDBY)
        client = stack.enter_context(
            process("-m", "tests.clients.fleet_flight", f"udpin://127.0.0.1:{port}", "3")
        )
        address = f"udpin:127.0.0.1:{ground}"
        for system in SYSTEMS:
            arguments = ("--connect", address, "--vehicle-id", str(system))
            set_radius = ("params", "set", "STN_RADIUS_M", str(20 + system))
            run_ground(*set_radius, *arguments)
        arguments = ("--connect", address, "--vehicle-id", str(SYSTEMS[0]))
        assert float(run_ground("params", "get", "STN_RADIUS_M", *arguments)) == 20 + SYSTEMS[0]
        finished = client.finish(timeout_s=400.0)
    assert finished.status == 0, finished.stderr[-3000:]
    flights = json.loads(finished.stdout.splitlines()[-1])
    with capsys.disabled():
        print(f"\n{flights}", end=" ")
    assert {int(system) for system in flights} == set(SYSTEMS)
    for flight in flights.values():
        assert 0.8 * flight["wanted_m"] < flight["reached_m"] < 1.5 * flight["wanted_m"]
        assert flight["items"] == 3


def run_ground(*arguments: str) -> str:
    """Run a command of ``ground``; return its output."""
    command = [sys.executable, "-m", "ground", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
