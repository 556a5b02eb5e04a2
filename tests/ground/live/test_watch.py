"""The live view: of any vehicle, true to its messages, and calm when nothing comes."""

import io
import json
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from ground.live.watch import mode_names, view
from ground.live.watch import rows as reading
from ground.live.watch.receiver import Receiver
from mavlink_io import dialect
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport
from tests.helpers.subprocesses import autopilot, free_port

SUBMARINE, QUADROTOR, GCS = 12, 2, 6
GENERIC, ARDUPILOT, INVALID, PX4 = 0, 3, 8, 12
LEAK, EXTENSION, GYRO = 2, 1 << 31, 1
_names = count()


class Sea:
    """A vehicle that says what it is told to, and the ears that listen to it."""

    def __init__(self) -> None:
        name = f"memory:watch-{next(_names)}"
        self._ends = open_transport(name), open_transport(name)
        self.vehicle, self.ears = Endpoint(self._ends[0], 1, 1), Receiver(self._ends[1])

    def close(self) -> None:
        for end in self._ends:
            end.close()

    def say(self, message: str, **fields: Any) -> None:
        """One message, zero where nothing is said; and the ears take it."""
        kind = dialect.by_name(message)
        blank = kind.unpack(b"")._asdict()
        self.vehicle.send(message, **{**blank, **fields})
        self.ears.listen(0.0)

    def heartbeat(self, **fields: Any) -> None:
        self.say("HEARTBEAT", **{"type": SUBMARINE, "autopilot": GENERIC, "base_mode": 1, **fields})

    def rows(self, later_s: float = 0.0) -> dict[str, reading.WatchRow]:
        return {row.label: row for row in reading.rows(self.ears, time.monotonic() + later_s)}

    def words(self, label: str) -> str:
        seen = self.rows()[label].seen
        return "" if seen is None else seen.words

    def drawn(self, later_s: float = 0.0) -> str:
        console = Console(width=100, file=io.StringIO())
        with console.capture() as captured:
            console.print(view.draw(self.ears, time.monotonic() + later_s))
        return captured.get()

    def heard(self) -> list[str]:
        return [frame.name for _ in range(5) for frame in self.vehicle.receive()]


@pytest.fixture
def sea() -> Iterator[Sea]:
    with closing(Sea()) as sea:
        yield sea


def test_depth_is_told_of_a_submarine_and_height_of_others(sea: Sea) -> None:
    sea.heartbeat()
    sea.say("GLOBAL_POSITION_INT", relative_alt=-4200, hdg=9000)
    assert sea.words("height") == "4.20 m deep"
    sea.heartbeat(type=QUADROTOR)
    assert sea.words("height") == "-4.2 m up"


def test_listen_reads_what_has_arrived_before_it_judges(sea: Sea) -> None:
    """One call reads the heartbeat that waits behind other messages; memory links queue ten
    datagrams."""
    for n in range(8):
        sea.vehicle.send("STATUSTEXT", severity=6, text=f"text {n}")
    fields = {"base_mode": 1, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
    sea.vehicle.send("HEARTBEAT", type=SUBMARINE, autopilot=GENERIC, **fields)
    sea.ears.listen(0.0)
    assert sea.ears.vehicle_id == (1, 1)


def test_a_value_goes_stale_by_its_own_period(sea: Sea) -> None:
    sea.heartbeat()
    sea.say("VFR_HUD", airspeed=1.3)
    assert not sea.rows()["speed"].stale
    assert sea.rows(later_s=4.0)["speed"].stale
    assert "4 s ago" in sea.drawn(later_s=4.0)
    assert "no heartbeat for 4 s" in sea.drawn(later_s=4.0)
    slow = reading.LatestMessage(None, 0.0, 5.0)
    assert not reading.is_stale(slow, 14.0)
    assert reading.is_stale(slow, 16.0)


def test_a_leak_and_a_sick_gyro_are_alarming_and_named(sea: Sea) -> None:
    sea.heartbeat()
    bits = GYRO | EXTENSION
    well = {
        "onboard_control_sensors_present": bits,
        "onboard_control_sensors_enabled": bits,
        "onboard_control_sensors_health": bits,
        "onboard_control_sensors_present_extended": LEAK,
        "onboard_control_sensors_enabled_extended": LEAK,
        "onboard_control_sensors_health_extended": LEAK,
    }
    sea.say("SYS_STATUS", **well)
    assert sea.rows()["health"].seen == ("all well", [], False)
    sea.say(
        "SYS_STATUS",
        **{
            **well,
            "onboard_control_sensors_health": EXTENSION,
            "onboard_control_sensors_health_extended": 0,
        },
    )
    assert sea.rows()["health"].seen == ("not well: 3d gyro, leak", ["3d gyro", "leak"], True)


@pytest.mark.parametrize(
    ("autopilot_id", "kind", "number", "name"),
    [
        (GENERIC, SUBMARINE, 65536, "mode 65536"),
        (PX4, QUADROTOR, 4 << 16 | 4 << 24, "MISSION"),
        (PX4, QUADROTOR, 2 << 16, "ALTCTL"),
        (ARDUPILOT, SUBMARINE, 19, "MANUAL"),
        (ARDUPILOT, QUADROTOR, 6, "RTL"),
        (ARDUPILOT, QUADROTOR, 999, "mode 999"),
    ],
)
def test_modes_that_a_vehicle_does_not_list_are_called_as_their_makers_do(
    sea: Sea,
    autopilot_id: int,
    kind: int,
    number: int,
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    sea.heartbeat(autopilot=autopilot_id, type=kind, custom_mode=number)
    assert sea.words("mode") == name
    (tmp_path / ".pymavlink").mkdir()
    (tmp_path / ".pymavlink" / "custom_mode_map.json").write_text(
        json.dumps({str(kind): {str(number): "OWN"}})
    )
    assert sea.words("mode") == "OWN"
    assert mode_names.name(sea.ears.latest["HEARTBEAT"].message, {number: "LISTED"}) == "LISTED"


def test_the_vehicles_own_list_of_modes_is_asked_for_and_used(sea: Sea) -> None:
    sea.heartbeat(custom_mode=65536)
    sea.ears.listen(0.0)
    assert "COMMAND_LONG" in sea.heard()
    sea.say("AVAILABLE_MODES", number_modes=1, mode_index=1, custom_mode=65536, mode_name="MANUAL")
    assert sea.words("mode") == "MANUAL"


def test_a_watcher_is_no_ground_station_to_the_vehicle(sea: Sea) -> None:
    sea.ears.listen(0.0)
    (heartbeat,) = [frame.decode() for frame in sea.vehicle.receive() if frame.name == "HEARTBEAT"]
    assert heartbeat.type != GCS


def test_ground_stations_are_not_taken_for_vehicles_and_that_is_said(sea: Sea) -> None:
    sea.heartbeat(type=GCS, autopilot=INVALID)
    assert sea.ears.vehicle_id is None
    assert "no vehicle yet" in sea.drawn()
    assert "MAVLink was received from 1/1" in sea.drawn()


def test_losses_and_texts_are_shown(sea: Sea) -> None:
    sea.heartbeat()
    for _ in range(3):
        sea.vehicle.encode_values(
            dialect.by_name("HEARTBEAT"), (0, 12, 0, 1, 3, 3)
        )  # three that never leave
    sea.heartbeat()
    sea.say("STATUSTEXT", severity=0, text="Leak detected")
    assert "3 (50.0 %)" in sea.drawn()
    assert "Leak detected" in sea.drawn()


@given(
    st.sampled_from(sorted({name for _, _, sources in reading.ROWS for name, _ in sources})),
    st.binary(max_size=255),
)
def test_no_message_whatever_its_bytes_upsets_the_view(name: str, payload: bytes) -> None:
    with closing(Sea()) as sea:
        sea.heartbeat()
        sea.ears.latest[name] = reading.LatestMessage(
            dialect.by_name(name).unpack(payload), time.monotonic(), 0.0
        )
        assert "system 1" in sea.drawn()
        json.dumps(reading.as_json(sea.ears, time.monotonic()))


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "ground", "watch", *words]


@pytest.fixture
def moored() -> Iterator[str]:
    port = free_port()
    with autopilot(f"udpin:127.0.0.1:{free_port()}", f"udpout:127.0.0.1:{port}"):
        yield f"udpin:127.0.0.1:{port}"


@pytest.mark.process
def test_one_look_gives_one_json_object(moored: str) -> None:
    done = subprocess.run(
        command("--connect", moored, "--json"), capture_output=True, text=True, check=True
    )
    told = json.loads(done.stdout)
    assert (told["system"], told["mode"]["value"], told["armed"]["value"]) == (1, "HOLD", False)
    assert told["identity"]["value"] == {"type": "submarine", "autopilot": "generic"}


@pytest.mark.process
def test_the_live_view_ends_cleanly_at_ctrl_c(moored: str) -> None:
    master, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100", "LINES": "40"}
    with subprocess.Popen(
        command("--connect", moored), stdout=terminal, stderr=terminal, env=environment
    ) as child:
        os.close(terminal)
        drawn = b""
        while b"HOLD" not in drawn:
            drawn += os.read(master, 65_536)
        child.send_signal(signal.SIGINT)
        try:
            while part := os.read(master, 65_536):
                drawn += part
        except OSError:  # how a pseudo terminal says that nobody holds its other end any more
            pass
    os.close(master)
    assert child.returncode == 0
    assert b"Traceback" not in drawn


@pytest.mark.process
def test_a_look_at_nothing_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    done = subprocess.run(
        command("--connect", f"udpin:127.0.0.1:{free_port()}", "--once"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("ground: no vehicle on udpin:127.0.0.1:")
    assert done.stderr.count("\n") == 1
