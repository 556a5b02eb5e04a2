"""Links between real processes: signing, and unplugged serial cables."""

import contextlib
import itertools
import json
import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from autopilot.control.params import PARAMETERS
from mavlink_io import dialect
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport, wait
from tests.clients.mavproxy_console import Console
from tests.helpers.fake_hil import TICK_US, sensors
from tests.helpers.pty_pair import Line, line
from tests.helpers.subprocesses import Finished, Process, autopilot, free_port, process, wait_for

pytestmark = pytest.mark.process

PASSPHRASE = "under-the-ice"
TIMEOUT_S = 30.0


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set a temporary state directory and return the folder that the programs use."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "caribou"


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    file = tmp_path / "key"
    file.touch(0o600)
    file.write_text(PASSPHRASE + "\n")
    return file


def ground(*arguments: str) -> Finished:
    with process("-m", "ground", *arguments) as child:
        return child.finish()


def get_parameter(address: str, *options: str) -> Finished:
    return ground("params", "get", "HDG_P", "--connect", address, *options, "--json")


class LinkedAutopilot(NamedTuple):
    """Autopilot process with the addresses of its signed and its unsigned link."""

    process: Process
    signed: str
    unsigned: str


@pytest.fixture
def linked_autopilot(state: Path, key_file: Path) -> Iterator[LinkedAutopilot]:
    ports = [free_port(socket.SOCK_STREAM) for _ in range(2)]
    signed, unsigned = (f"tcpin:127.0.0.1:{port}" for port in ports)
    options = ("--sign", f"{signed}={key_file}")
    with autopilot(f"udpin:127.0.0.1:{free_port()}", signed, unsigned, options=options) as child:
        yield LinkedAutopilot(child, *(f"tcp:127.0.0.1:{port}" for port in ports))


def test_parameter_request_needs_signature_on_signed_link(
    linked_autopilot: LinkedAutopilot, key_file: Path, state: Path
) -> None:
    signed = get_parameter(linked_autopilot.signed, "--sign", str(key_file))
    assert (signed.status, json.loads(signed.stdout)) == (0, {"HDG_P": pytest.approx(0.65)})
    assert get_parameter(linked_autopilot.unsigned).status == 0
    unsigned = get_parameter(linked_autopilot.signed)
    assert unsigned.status == 1
    assert "no answer to the request for parameter HDG_P" in unsigned.stderr
    message = unsigned.stderr.removeprefix("ground: ").rstrip("\n")
    assert json.loads(unsigned.stdout) == {"error": {"code": "vehicle", "message": message}}
    linked_autopilot.process.signal(signal.SIGINT)
    linked_autopilot.process.finish()
    saved = int((state / "signing_timestamp").read_text())
    assert abs(saved / 1e5 + 1_420_070_400 - time.time()) < 60.0


def test_bad_key_file_gives_one_error_line(tmp_path: Path) -> None:
    finished = get_parameter("udpin:127.0.0.1:14550", "--sign", str(tmp_path / "none"))
    assert (finished.status, finished.stderr) == (
        2,
        f"ground: --sign {tmp_path}/none: No such file or directory\n",
    )
    with process("-m", "autopilot", "--sign", f"serial:x:9={tmp_path}/none") as child:
        finished = child.finish()
    assert finished.status == 2
    assert finished.stderr.startswith("autopilot: --sign serial:x:9=")
    assert finished.stderr.count("\n") == 1


def test_mavproxy_needs_key_for_commands_only(state: Path, key_file: Path, tmp_path: Path) -> None:
    port = free_port()
    address = f"udpout:127.0.0.1:{port}"
    with (
        autopilot(
            f"udpin:127.0.0.1:{free_port()}", address, options=("--sign", f"{address}={key_file}")
        ),
        contextlib.closing(Console(tmp_path, f"udpin:127.0.0.1:{port}")) as mavproxy,
    ):
        mavproxy.wait_for("Detected vehicle 1:1 on link 0", TIMEOUT_S)
        with pytest.raises(TimeoutError):
            mavproxy.ask("param fetch HDG_P", "HDG_P = ", within_s=3.0)
        assert mavproxy.messages()["HEARTBEAT"][0] > 1, "telemetry must be readable without a key"
        mavproxy.ask(f"signing key {PASSPHRASE}", "Setup signing key")
        mavproxy.wait_for(f"Received {len(PARAMETERS)} parameters", TIMEOUT_S)
        mavproxy.type_line("param set HDG_P 0.75")
        wait_for(
            lambda: (
                float(mavproxy.ask("param fetch HDG_P", r"HDG_P = ([\d.]+)", attempts=5)[1]) == 0.75
            )
        )


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Line]:
    with line(tmp_path, 57_600) as cable_:
        yield cable_


def test_unplugged_radio_reconnects(cable: Line, state: Path) -> None:
    address = f"serial:{cable.device['vehicle']}:57600"
    ground_address = f"serial:{cable.device['ground']}:57600"
    with autopilot(f"udpin:127.0.0.1:{free_port()}", address) as child:
        assert get_parameter(ground_address).status == 0
        cable.unplug("vehicle")
        assert child.wait_for_line().startswith(f"{address}: lost (")
        busy_s = processor_s(child)
        time.sleep(1.5)
        assert processor_s(child) - busy_s < 0.5, (
            "waiting for a lost line must not use the processor"
        )
        cable.plug("vehicle")
        assert child.wait_for_line() == f"{address}: back\n"
        assert get_parameter(ground_address).status == 0


def processor_s(child: Process) -> float:
    fields = Path(f"/proc/{child._popen.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_replugged_sensors_are_answered(cable: Line, state: Path) -> None:
    hil = f"serial:{cable.device['vehicle']}:57600"
    far = open_transport(f"serial:{cable.device['ground']}:57600")
    controller = Endpoint(far, 1, 200)

    def answered(time_us: int) -> bool:
        controller.send_values(dialect.by_name("HIL_SENSOR"), sensors(time_us))
        until_s = time.monotonic() + 1.0
        while time.monotonic() < until_s:
            wait([far], 0.1)
            if any(frame.decode().time_usec == time_us for frame in controller.receive()):
                return True
        return False

    with (
        contextlib.closing(far),
        autopilot(hil, f"udpout:127.0.0.1:{free_port()}") as child,
    ):
        ticks = itertools.count(1)
        wait_for(lambda: answered(next(ticks) * TICK_US))
        cable.unplug("vehicle")
        assert child.wait_for_line().startswith(f"{hil}: lost (")
        assert not answered(next(ticks) * TICK_US)
        cable.plug("vehicle")
        assert child.wait_for_line() == f"{hil}: back\n"
        wait_for(lambda: answered(next(ticks) * TICK_US))


def test_missing_radio_is_awaited(cable: Line, state: Path) -> None:
    cable.unplug("vehicle")
    address = f"serial:{cable.device['vehicle']}:57600"
    arguments = ("--hil", f"udpin:127.0.0.1:{free_port()}", "--gcs", address)
    with process("-m", "autopilot", *arguments) as child:
        assert child.wait_for_line() == f"{address}: not there yet; trying every second\n"
        assert child.wait_for_line().startswith("autopilot: system 1")
        cable.plug("vehicle")
        assert child.wait_for_line() == f"{address}: back\n"
        assert get_parameter(f"serial:{cable.device['ground']}:57600").status == 0
