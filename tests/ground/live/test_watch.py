"""Live view of any MAVLink vehicle: content, stale values and missing vehicles."""

import contextlib
import gc
import io
import json
import math
import os
import pty
import signal
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from ground.errors import INTERRUPTED, Interrupted
from ground.live import plausible
from ground.live.watch import mode_names, receiver, session, view
from ground.live.watch import rows as reading
from ground.live.watch.receiver import LatestMessage, Receiver
from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport
from tests.helpers.subprocesses import autopilot, free_port

SUBMARINE, QUADROTOR, GCS = 12, 2, 6
GENERIC, ARDUPILOT, INVALID, PX4 = 0, 3, 8, 12
LEAK, EXTENSION, GYRO = 2, 1 << 31, 1
_names = count()


class Sea:
    """Simulated vehicle connected to a receiver by a memory link."""

    def __init__(self) -> None:
        name = f"memory:watch-{next(_names)}"
        self._ends = open_transport(name), open_transport(name)
        self.vehicle, self.receiver = Endpoint(self._ends[0], 1, 1), Receiver(self._ends[1])

    def close(self) -> None:
        for end in self._ends:
            end.close()

    def send(self, message: str, **fields: Any) -> None:
        """Send a message, with zeros in all other fields, and let the receiver process it."""
        kind = dialect.by_name(message)
        blank = kind.unpack(b"")._asdict()
        self.vehicle.send(message, **{**blank, **fields})
        self.receiver.listen(0.0)

    def heartbeat(self, **fields: Any) -> None:
        self.send(
            "HEARTBEAT", **{"type": SUBMARINE, "autopilot": GENERIC, "base_mode": 1, **fields}
        )

    def rows(self, later_s: float = 0.0) -> dict[str, reading.WatchRow]:
        return {row.label: row for row in reading.rows(self.receiver, time.monotonic() + later_s)}

    def text(self, label: str) -> str:
        cell = self.rows()[label].cell
        return "" if cell is None else cell.text

    def screen(self, later_s: float = 0.0) -> str:
        console = Console(width=100, file=io.StringIO())
        with console.capture() as captured:
            console.print(view.draw(self.receiver, time.monotonic() + later_s))
        return captured.get()

    def received_names(self) -> list[str]:
        return [frame.name for _ in range(5) for frame in self.vehicle.receive()]


@pytest.fixture
def sea() -> Iterator[Sea]:
    with closing(Sea()) as sea:
        yield sea


def test_height_row_shows_depth_for_submarine_only(sea: Sea) -> None:
    sea.heartbeat()
    sea.send("GLOBAL_POSITION_INT", relative_alt=-4200, hdg=9000)
    assert sea.text("height") == "4.20 m deep"
    sea.heartbeat(type=QUADROTOR)
    assert sea.text("height") == "-4.2 m up"


def test_listen_reads_all_queued_messages(sea: Sea) -> None:
    """One call reads a heartbeat that is queued behind other messages.

    Memory links queue ten datagrams.
    """
    for n in range(8):
        sea.vehicle.send("STATUSTEXT", severity=6, text=f"text {n}")
    fields = {"base_mode": 1, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
    sea.vehicle.send("HEARTBEAT", type=SUBMARINE, autopilot=GENERIC, **fields)
    sea.receiver.listen(0.0)
    assert sea.receiver.vehicle_id == (1, 1)


def test_value_becomes_stale_after_several_of_its_periods(sea: Sea) -> None:
    sea.heartbeat()
    sea.send("VFR_HUD", airspeed=1.3)
    assert not sea.rows()["speed"].stale
    assert sea.rows(later_s=4.0)["speed"].stale
    assert "4 s ago" in sea.screen(later_s=4.0)
    assert "no heartbeat for 4 s" in sea.screen(later_s=4.0)
    slow = LatestMessage(None, 0.0, 5.0)
    assert not reading.is_stale(slow, 14.0)
    assert reading.is_stale(slow, 16.0)


def test_receiver_whose_rates_nobody_reads_keeps_its_size(
    sea: Sea, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`ground live` reads no rates: it grew by 33 MB an hour at 80 messages/s."""
    clock_s = count(time.monotonic())
    monkeypatch.setattr(receiver, "wall_s", lambda: next(clock_s))
    sea.heartbeat()
    tracemalloc.start()
    try:
        for _ in range(1000):
            sea.heartbeat()
        gc.collect()
        grown_bytes, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert grown_bytes < 20_000  # 1,000 times and sizes take 120,000


def test_unhealthy_sensors_are_named_with_alarm(sea: Sea) -> None:
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
    sea.send("SYS_STATUS", **well)
    assert sea.rows()["health"].cell == ("all healthy", [], False)
    sea.send(
        "SYS_STATUS",
        **{
            **well,
            "onboard_control_sensors_health": EXTENSION,
            "onboard_control_sensors_health_extended": 0,
        },
    )
    assert sea.rows()["health"].cell == ("unhealthy: 3d gyro, leak", ["3d gyro", "leak"], True)


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
def test_unlisted_mode_has_published_or_installed_name(
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
    assert sea.text("mode") == name
    (tmp_path / ".pymavlink").mkdir()
    (tmp_path / ".pymavlink" / "custom_mode_map.json").write_text(
        json.dumps({str(kind): {str(number): "OWN"}})
    )
    assert sea.text("mode") == "OWN"
    assert mode_names.name(sea.receiver.latest["HEARTBEAT"].message, {number: "LISTED"}) == "LISTED"


def test_mode_list_of_vehicle_is_requested_and_used(sea: Sea) -> None:
    sea.heartbeat(custom_mode=65536)
    sea.receiver.listen(0.0)
    assert "COMMAND_LONG" in sea.received_names()
    sea.send("AVAILABLE_MODES", number_modes=1, mode_index=1, custom_mode=65536, mode_name="MANUAL")
    assert sea.text("mode") == "MANUAL"


def test_heartbeat_of_receiver_is_not_of_type_gcs(sea: Sea) -> None:
    sea.receiver.listen(0.0)
    (heartbeat,) = [frame.decode() for frame in sea.vehicle.receive() if frame.name == "HEARTBEAT"]
    assert heartbeat.type != GCS


def test_ground_station_is_not_shown_as_vehicle(sea: Sea) -> None:
    sea.heartbeat(type=GCS, autopilot=INVALID)
    assert sea.receiver.vehicle_id is None
    assert "no vehicle yet" in sea.screen()
    assert "MAVLink was received from 1/1" in sea.screen()


def test_lost_frames_and_texts_are_shown(sea: Sea) -> None:
    sea.heartbeat()
    for _ in range(3):
        sea.vehicle.encode_values(
            dialect.by_name("HEARTBEAT"), (0, 12, 0, 1, 3, 3)
        )  # encoded, but not sent
    sea.heartbeat()
    sea.send("STATUSTEXT", severity=0, text="Leak detected")
    assert "3 (50.0 %)" in sea.screen()
    assert "Leak detected" in sea.screen()


@given(
    st.sampled_from(sorted({name for _, _, sources in reading.ROWS for name, _ in sources})),
    st.binary(max_size=255),
)
def test_view_accepts_messages_with_arbitrary_bytes(name: str, payload: bytes) -> None:
    with closing(Sea()) as sea:
        sea.heartbeat()
        sea.receiver.latest[name] = LatestMessage(
            plausible.decode(Frame(1, 1, dialect.by_name(name).message_id, 0, payload, payload)),
            time.monotonic(),
            0.0,
        )
        assert "system 1" in sea.screen()
        json.dumps(reading.as_json(sea.receiver, time.monotonic()), allow_nan=False)


def test_heading_that_is_no_number_is_not_shown(sea: Sea) -> None:
    sea.heartbeat()
    for yaw in (math.inf, math.nan):
        sea.send("ATTITUDE", yaw=yaw)
        assert sea.rows()["heading"].cell is None


UNKNOWN_I32, UNKNOWN_U16 = 2**31 - 1, 2**16 - 1


@pytest.mark.parametrize(
    ("name", "fields", "label"),
    [
        ("VFR_HUD", {"climb": math.nan}, "climb"),
        ("VFR_HUD", {"airspeed": math.nan, "groundspeed": math.inf}, "speed"),
        ("GLOBAL_POSITION_INT", {"relative_alt": UNKNOWN_I32}, "height"),
        ("GLOBAL_POSITION_INT", {"relative_alt": -UNKNOWN_I32 - 1}, "height"),
        ("GLOBAL_POSITION_INT", {"lat": UNKNOWN_I32, "lon": -UNKNOWN_I32}, "position"),
        ("GLOBAL_POSITION_INT", {"hdg": UNKNOWN_U16}, "heading"),
        ("LOCAL_POSITION_NED", {"z": 1e30}, "height"),
        ("ATTITUDE_QUATERNION", {"q1": math.nan}, "attitude"),
        ("MISSION_CURRENT", {"seq": UNKNOWN_U16}, "mission"),
        ("NAV_CONTROLLER_OUTPUT", {"target_bearing": 999, "wp_dist": UNKNOWN_U16}, "aim"),
        ("GPS_RAW_INT", {"fix_type": 9}, "gps"),
    ],
)
def test_unknown_or_impossible_value_is_not_shown(
    sea: Sea, name: str, fields: dict[str, Any], label: str
) -> None:
    sea.heartbeat()
    sea.send(name, **fields)
    assert sea.rows()[label].cell is None


def test_rounded_zero_has_no_minus(sea: Sea) -> None:
    sea.heartbeat()
    sea.send("ATTITUDE", roll=-0.0005, pitch=-0.1)
    assert sea.text("attitude") == "roll +0.0, pitch -5.7 deg"
    sea.send("GLOBAL_POSITION_INT", relative_alt=1)
    assert sea.text("height") == "0.00 m deep"


def test_bottom_without_an_echo_is_no_distance(sea: Sea) -> None:
    """A vehicle without an altimeter reports 0 cm with the signal quality 1: not valid."""
    sea.heartbeat()
    down = {"orientation": 25, "max_distance": 10_000}
    sea.send("DISTANCE_SENSOR", **down, signal_quality=1)
    assert sea.text("bottom") == "no echo"
    sea.send("DISTANCE_SENSOR", **down, current_distance=1300)
    assert sea.text("bottom") == "13.0 m below"


def test_known_value_beside_an_unknown_one_is_shown(sea: Sea) -> None:
    sea.heartbeat()
    sea.send("VFR_HUD", airspeed=math.nan, groundspeed=0.5)
    sea.send("ATTITUDE", roll=math.inf, pitch=0.1)
    assert sea.text("speed") == "unknown, 0.50 over ground"
    assert sea.text("attitude") == "roll unknown, pitch +5.7 deg"
    snapshot = json.dumps(reading.as_json(sea.receiver, time.monotonic()), allow_nan=False)
    assert json.loads(snapshot)["speed"]["value"] == {"through_mps": None, "over_ground_mps": 0.5}


def test_unknown_height_is_taken_from_the_next_message(sea: Sea) -> None:
    sea.heartbeat()
    sea.send("GLOBAL_POSITION_INT", relative_alt=UNKNOWN_I32)
    sea.send("LOCAL_POSITION_NED", z=4.2)
    assert sea.text("height") == "4.20 m deep"


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "ground", "watch", *words]


@pytest.fixture
def vehicle_address() -> Iterator[str]:
    port = free_port()
    with autopilot(f"udpin:127.0.0.1:{free_port()}", f"udpout:127.0.0.1:{port}"):
        yield f"udpin:127.0.0.1:{port}"


@pytest.mark.process
def test_snapshot_prints_one_json_object(vehicle_address: str) -> None:
    done = subprocess.run(
        command("--connect", vehicle_address, "--json"), capture_output=True, text=True, check=True
    )
    snapshot = json.loads(done.stdout)
    assert (snapshot["system"], snapshot["mode"]["value"], snapshot["armed"]["value"]) == (
        1,
        "HOLD",
        False,
    )
    assert snapshot["identity"]["value"] == {"type": "submarine", "autopilot": "generic"}


@pytest.mark.process
def test_live_view_ends_without_error_at_ctrl_c(vehicle_address: str) -> None:
    master, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100", "LINES": "40"}
    with subprocess.Popen(
        command("--connect", vehicle_address), stdout=terminal, stderr=terminal, env=environment
    ) as child:
        os.close(terminal)
        output = b""
        while b"HOLD" not in output:
            output += os.read(master, 65_536)
        child.send_signal(signal.SIGINT)
        try:
            while part := os.read(master, 65_536):
                output += part
        except OSError:  # a pseudo-terminal reports a closed other end as an error
            pass
    os.close(master)
    assert child.returncode == 0
    assert b"Traceback" not in output


@pytest.mark.process
def test_terminal_that_cannot_be_redrawn_gets_one_snapshot(vehicle_address: str) -> None:
    master, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "dumb", "COLUMNS": "100"}
    with subprocess.Popen(
        command("--connect", vehicle_address), stdout=terminal, stderr=terminal, env=environment
    ) as child:
        os.close(terminal)
        output = b""
        with contextlib.suppress(OSError):  # a pseudo-terminal reports a closed other end so
            while part := os.read(master, 65_536):
                output += part
    os.close(master)
    assert child.returncode == 0
    assert b"HOLD" in output


@pytest.mark.process
def test_snapshot_without_vehicle_gives_one_error_line(monkeypatch: pytest.MonkeyPatch) -> None:
    done = subprocess.run(
        command("--connect", f"udpin:127.0.0.1:{free_port()}", "--once"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("ground: no vehicle on udpin:127.0.0.1:")
    assert done.stderr.count("\n") == 1


def test_snapshot_interrupted_before_a_vehicle_is_no_failure(sea: Sea) -> None:
    with pytest.raises(Interrupted) as raised:
        session._listen_once(sea.receiver, lambda: True)  # type: ignore[arg-type]
    assert raised.value.status == INTERRUPTED
