"""An autopilot that is connected before its first sensor sample arrives, with real processes."""

import socket
from contextlib import ExitStack, closing
from threading import Timer

import pytest

from ground.client import vehicle as client
from ground.client.vehicle import VehicleClient
from ground.simulation.processes import free_port
from mavlink_io.transport import open_transport
from tests.helpers.subprocesses import autopilot, process

pytestmark = pytest.mark.process

DELAY_S = 3.0
"""Wall time from the first attempt to arm to the start of the simulator, in s."""
STANDBY_S, RETRY_S = 0.5, 120.0
"""Timeouts instead of 60 s and 15 s.

The start is too late for the first and in time for the second on a busy machine.
"""


def test_arm_before_first_sensor_sample_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until then every attempt is refused with "Not armed: no sensors", which is not final."""
    monkeypatch.setattr(client, "READY_TIMEOUT_S", STANDBY_S)
    monkeypatch.setattr(client, "ARM_RETRY_S", RETRY_S, raising=False)
    hil, ground = free_port(), free_port(socket.SOCK_STREAM)
    simulator = ("-m", "sitl", "--hil", f"udpout:127.0.0.1:{hil}", "--wait-for-arm")
    with ExitStack() as stack:
        stack.enter_context(autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{ground}"))
        link = stack.enter_context(closing(open_transport(f"tcp:127.0.0.1:{ground}")))
        vehicle = VehicleClient(link)
        vehicle.connect()
        later = Timer(DELAY_S, lambda: stack.enter_context(process(*simulator)))
        later.start()
        stack.callback(later.join)
        vehicle.arm(timeout_s=STANDBY_S)
        texts = [text.text for text in vehicle.texts]
    assert "Not armed: no sensors" in texts
    assert texts[-1] == "Armed: HOLD"
