"""MAVSDK's offboard plugin controls attitude, depth and position, and starts the return."""

import json
from pathlib import Path

import pytest

from tests.helpers.subprocesses import free_port, process, vehicle

pytestmark = [pytest.mark.process, pytest.mark.client]

CLIENT = Path(__file__).with_name("mavsdk_offboard_client.py")


def test_mavsdk_offboard_setpoints_and_return() -> None:
    port = free_port()
    with (
        vehicle(f"udpout:127.0.0.1:{port}", speed="5") as _,
        process(str(CLIENT), f"udpin://127.0.0.1:{port}") as client,
    ):
        finished = client.finish()
    assert finished.status == 0, finished.stderr
    seen = json.loads(finished.stdout.splitlines()[-1])
    assert (seen["mode"], seen["after"], seen["home"], seen["disarmed"]) == (
        "OFFBOARD",
        "HOLD",
        "RETURN_TO_LAUNCH",
        True,
    )
    assert seen["depth_of_snippet_m"] > 1.0
    assert seen["attitude"][1] < -2.0, "nose down, as asked"
    assert seen["altitude_m"] < -2.0
    assert 0.01 < seen["variance"] < 9.0
