"""Parameters with third-party programs: download as one file, and storage over restarts."""

import json
import signal
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from autopilot.control.params import PARAMETERS
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import MavlinkId
from mavlink_io.services import params
from mavlink_io.transport import open_transport
from tests.clients.mavproxy_console import Console
from tests.helpers.exchange import run
from tests.helpers.subprocesses import TIMEOUT_S, Process, autopilot, free_port, process

pytestmark = [pytest.mark.process, pytest.mark.client]

METADATA_CLIENT = str(Path(__file__).with_name("mavsdk_metadata_client.py"))
VEHICLE, GROUND = MavlinkId(1, 1), MavlinkId(250, 190)


def test_mavproxy_downloads_parameter_file(tmp_path: Path) -> None:
    port = free_port()
    with autopilot(f"udpin:127.0.0.1:{free_port()}", f"udpout:127.0.0.1:{port}"):
        console = Console(tmp_path, f"udp:127.0.0.1:{port}")
        try:
            console.wait_for(rf"Received {len(PARAMETERS)} parameters \(ftp\)", TIMEOUT_S)
            console.ask("param show HDG_P", r"HDG_P\s+0\.64999")
            console.type_line("param set HDG_P 0.75")
            console.ask("param diff", r"HDG_P\s+0\.750000 +0\.650000", attempts=5)
        finally:
            console.close()


def test_mavsdk_downloads_parameter_metadata() -> None:
    port = free_port()
    with (
        autopilot(f"udpin:127.0.0.1:{free_port()}", f"udpout:127.0.0.1:{port}"),
        process(METADATA_CLIENT, f"udpin://127.0.0.1:{port}") as client,
    ):
        finished = client.finish()
    assert finished.status == 0, finished.stderr
    described = json.loads(finished.stdout.splitlines()[-1])["parameters"]
    assert {row["name"]: row["max"] for row in described} == {
        row.name: row.maximum for row in PARAMETERS
    }


def test_parameter_set_by_ground_survives_kill(tmp_path: Path) -> None:
    def ask(value: float | None) -> float:
        port = free_port()
        options = ("--state", str(tmp_path))
        with autopilot(
            f"udpin:127.0.0.1:{free_port()}", f"tcpin:127.0.0.1:{port}", options=options
        ) as process:
            endpoint = Endpoint(open_transport(f"tcp:127.0.0.1:{port}"), *GROUND)
            client = params.ParamClient(endpoint.send, GROUND, VEHICLE)
            if value is not None:
                run(client.set("HDG_P", value), endpoint)
                run(client.set("HDG_D", value + 1.0), endpoint)
            found = run(client.get("HDG_P"), endpoint)
            endpoint.transport.close()
            kept = tmp_path / "parameters.param"
            while value is not None and f"HDG_D,{value + 1.0:g}" not in (
                kept.read_text() if kept.exists() else ""
            ):
                assert process.running
            process.kill()
            return found

    assert ask(0.75) == 0.75
    assert ask(None) == 0.75


def test_second_autopilot_on_a_state_folder_reports_it(tmp_path: Path) -> None:
    def started() -> AbstractContextManager[Process]:
        options = ("--state", str(tmp_path))
        return autopilot(
            f"udpin:127.0.0.1:{free_port()}", f"udpout:127.0.0.1:{free_port()}", options=options
        )

    def next_line(process: Process) -> str:
        """Return what the process says before it ends."""
        process.signal(signal.SIGTERM)
        return process.wait_for_line()

    with started() as first, started() as second:
        shared = f"{tmp_path}: another autopilot stores its parameters here too"
        assert shared in next_line(second)
        assert next_line(first) == ""
    with started() as later:
        assert next_line(later) == ""
