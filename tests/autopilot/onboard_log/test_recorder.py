"""The onboard log: content, start and end, and independence of the flight from the disk."""

import errno
import gc
import os
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros1.decoder import DecoderFactory
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.ground_server import GroundServer
from autopilot.control import requests
from autopilot.control.params import ParamTable
from autopilot.control.types import Inputs
from autopilot.onboard_log import recorder
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.onboard_log.storage import LogStore
from autopilot.onboard_log.writer import BackgroundFile
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.vehicle import Vehicle
from ground.log_tools import mcap
from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.mission_items import FENCE_TYPE, RALLY_TYPE, MavCmd, MissionItem
from mavlink_io.vehicle_modes import VehicleMode
from sysid.data import readers as identification
from sysid.data.events import Armed, ModeChanged
from tests.helpers.fake_hil import TICK_US, Station, approach, sensors
from tests.mavlink_io.logging import decoding

SENSOR = dialect.by_name("HIL_SENSOR")


class Rig:
    """A vehicle with sensor frames, a ground server and an onboard log."""

    def __init__(self, folder: Path | None, **parameters: float) -> None:
        self.vehicle = Vehicle(ParamTable(parameters))
        self.onboard_log = OnboardLog(self.vehicle, folder, "1.2.3")
        self.station = Station()
        self.server = GroundServer(
            self.vehicle, [self.station], AutopilotId.GENERIC, onboard_log=self.onboard_log
        )
        self.time_us, self.depth_m = -TICK_US, float("nan")
        self.sent: list[Frame] = []
        self.tick(3)

    def tick(self, count: int = 1, depth_m: float = 0.0) -> None:
        for _ in range(count):
            self.time_us += TICK_US
            self.depth_m = approach(self.depth_m, depth_m)
            record = sensors(self.time_us, self.depth_m)
            (frame,) = Framer().feed(encode(SENSOR, record, self.time_us // TICK_US & 255, 1, 25))
            self.sent.append(frame)
            self.vehicle.tick(Inputs(record, None, None, None))
            self.server.publish_telemetry()
            self.onboard_log.tick((frame,))

    def ask(self, message: Any) -> None:
        self.station.transmit(message)
        self.server.receive(self.server.links[0])
        self.server.poll()

    def arm(self, wanted: bool = True) -> None:
        self.ask(
            mavlink.MAVLink_command_long_message(
                1, 1, 400, 0, float(wanted), 21196.0, 0, 0, 0, 0, 0
            )
        )
        assert self.vehicle.state.armed == wanted

    def end(self) -> list[Path]:
        self.onboard_log.close()
        store = self.onboard_log.store
        return [log.path for log in store.files()] if store else []

    def received_texts(self) -> list[str]:
        self.server.poll()
        self.server.flush()
        return [m.text for m in self.station.pop_received() if m.get_type() == "STATUSTEXT"]

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 10.0
        while not condition():
            assert time.monotonic() < deadline
            self.onboard_log.poll()
            time.sleep(0.01)


def messages(path: Path, name: str, sender: str = "1/1") -> list[Any]:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        topic = f"/mavlink/{sender}/{name}"
        return [m for _, _, _, m in reader.iter_decoded_messages([topic], log_time_order=False)]


def test_log_contains_every_tick(tmp_path: Path) -> None:
    boat = Rig(tmp_path)
    before = len(boat.sent)
    boat.arm()
    boat.tick(500, depth_m=2.0)
    (path,) = boat.end()
    flown = boat.sent[before:]
    sensed = messages(path, "HIL_SENSOR", "1/25")
    assert [m.time_usec for m in sensed] == [n.decode().time_usec for n in flown]
    assert [m.abs_pressure for m in sensed] == [n.decode().abs_pressure for n in flown]
    for name in ("ATTITUDE", "LOCAL_POSITION_NED", "ACTUATOR_OUTPUT_STATUS", "DEBUG_FLOAT_ARRAY"):
        assert len(messages(path, name)) == 500, name
    assert messages(path, "LOCAL_POSITION_NED")[-1].z == pytest.approx(
        boat.vehicle.state.estimate.depth_m, abs=1e-6
    )
    trace = messages(path, "DEBUG_FLOAT_ARRAY")[-1]
    snapshot = boat.vehicle.snapshot()
    assert list(trace.data[: len(snapshot.trace)]) == pytest.approx(list(snapshot.trace), abs=1e-6)
    assert set(trace.data[len(snapshot.trace) :]) == {0.0}
    outputs = messages(path, "ACTUATOR_OUTPUT_STATUS")[-1]
    assert list(outputs.actuator[:3]) == pytest.approx(
        list(snapshot.actuators.controls[:3]), abs=1e-6
    )
    report = mcap.info(path)
    assert (report["lost_frames"], report["attachments"]) == (0, ["params.json"])
    assert report["metadata"]["vehicle"] == {"system": "1", "autopilot": "caribou 1.2.3"}
    assert list(report["metadata"]["trace"].values()) == list(snapshot.trace._fields)


def test_log_messages_are_decoded_by_mcap_library(tmp_path: Path) -> None:
    boat = Rig(tmp_path)
    boat.arm()
    boat.tick(200, depth_m=2.0)
    (path,) = boat.end()
    profile, count, decoded = decoding.decode(path)
    assert profile == ""
    assert decoded.total() == count > 1000
    assert set(decoded) == {"ros1", "json"}


def test_log_is_readable_by_sysid(tmp_path: Path) -> None:
    boat = Rig(tmp_path, HDG_P=0.5)
    boat.arm()
    boat.tick(200, depth_m=2.0)
    (path,) = boat.end()
    read = identification.read(path)
    assert read.parameters == {
        name: boat.vehicle.params.get(name) for name in boat.vehicle.params.names()
    }
    assert read.parameters["HDG_P"] == 0.5
    assert read.attitude.time_s == pytest.approx([0.06 + 0.02 * n for n in range(200)])
    assert read.depth.depth_m[-1] == pytest.approx(boat.vehicle.state.estimate.depth_m, abs=1e-6)
    assert [event.value for event in read.events] == [ModeChanged(VehicleMode.HOLD), Armed()]


def test_log_contains_commands_and_their_results(tmp_path: Path) -> None:
    boat = Rig(tmp_path)
    items = tuple(MissionItem(n, 2, 93, p1=5.0 + n) for n in range(3))
    boat.vehicle.handle_request(requests.LoadMission(items))
    boat.arm()
    boat.tick(10)
    boat.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 0.75, 9))
    boat.ask(mavlink.MAVLink_ping_message(5, 1, 0, 0))
    boat.tick(10)
    (path,) = boat.end()
    assert [m.command for m in messages(path, "COMMAND_LONG", "255/190")] == [400]
    assert [m.param_value for m in messages(path, "PARAM_SET", "255/190")] == [0.75]
    assert [m.param_value for m in messages(path, "PARAM_VALUE")] == [0.75]
    assert [(m.command, m.result) for m in messages(path, "COMMAND_ACK")] == [(400, 0)]
    assert [m.param1 for m in messages(path, "MISSION_ITEM_INT")] == [5.0, 6.0, 7.0]
    assert not messages(path, "PING", "255/190")


def test_log_contains_fence_and_rally(tmp_path: Path) -> None:
    """It held the mission only; the fence of a dive that ended by a breach was unknown."""
    boat = Rig(tmp_path)
    circle = MissionItem(0, 3, MavCmd.NAV_FENCE_CIRCLE_INCLUSION, p1=900.0, mission_type=FENCE_TYPE)
    rally = MissionItem(0, 3, MavCmd.NAV_RALLY_POINT, mission_type=RALLY_TYPE)
    for request in (requests.LoadFence((circle,)), requests.LoadRally((rally,))):
        assert boat.vehicle.handle_request(request).result == 0
    boat.arm()
    boat.tick(10)
    (path,) = boat.end()
    items = messages(path, "MISSION_ITEM_INT")
    assert [(m.command, m.mission_type) for m in items] == [(5003, FENCE_TYPE), (5100, RALLY_TYPE)]


def test_log_excludes_simulated_truth() -> None:
    from autopilot.comms import hil

    assert dialect.by_name("HIL_STATE_QUATERNION").message_id not in hil._LOGGED_MESSAGES


def test_log_lasts_from_arming_until_after_disarming(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(recorder, "AFTER_DISARM_WALL_S", 60.0)
    boat = Rig(tmp_path)
    boat.arm()
    boat.tick(50)
    boat.arm(False)
    boat.tick(500)
    (path,) = boat.end()
    assert len(messages(path, "ATTITUDE")) == 50 + recorder.AFTER_DISARM_US // TICK_US - 1


def test_log_ends_when_vehicle_time_stops_after_disarming(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(recorder, "AFTER_DISARM_WALL_S", 0.0)
    boat = Rig(tmp_path)
    boat.arm()
    boat.tick(5)
    boat.arm(False)
    boat.until(lambda: boat.onboard_log._session is None)
    assert mcap.info(boat.end()[0])["attachments"] == ["params.json"]


def test_logs_have_increasing_numbers(tmp_path: Path) -> None:
    boat = Rig(tmp_path)
    for _ in range(3):
        boat.arm()
        boat.tick(5)
        boat.arm(False)
        boat.tick(5)
    paths = boat.end()
    boat = Rig(tmp_path)
    boat.arm()
    boat.tick(5)
    assert [path.name[:6] for path in paths] == ["00001-", "00002-", "00003-"]
    assert [path.name[:6] for path in boat.end()] == ["00001-", "00002-", "00003-", "00004-"]


def test_finished_log_leaves_memory_without_cycle_collector(tmp_path: Path) -> None:
    # its index takes 1 MB for a dive of 20 minutes, and the collector rarely looks at old objects
    boat = Rig(tmp_path)
    gc.collect()
    gc.disable()
    try:
        boat.arm()
        boat.tick(100)
        assert boat.onboard_log._session
        log = weakref.ref(boat.onboard_log._session._log)
        writer = weakref.ref(boat.onboard_log._session._log._writer)
        boat.arm(False)
        boat.tick(200)
        boat.end()
        assert (log(), writer()) == (None, None)
    finally:
        gc.enable()


def test_vehicle_time_restart_begins_new_log(tmp_path: Path) -> None:
    boat = Rig(tmp_path, LOG_DISARMED=1)
    boat.tick(20)
    boat.vehicle.restart("vehicle time fell back")
    boat.time_us = -TICK_US
    boat.tick(30)
    first, second = boat.end()
    assert [len(messages(path, "ATTITUDE")) for path in (first, second)] == [23, 30]


@pytest.mark.parametrize(
    ("parameters", "armed", "logged"),
    [({}, False, 0), ({"LOG_DISARMED": 1}, False, 1), ({"LOG_ENABLE": 0}, True, 0), ({}, True, 1)],
)
def test_log_parameters_select_when_to_log(
    tmp_path: Path, parameters: dict[str, float], armed: bool, logged: int
) -> None:
    boat = Rig(tmp_path, **parameters)
    if armed:
        boat.arm()
    boat.tick(10)
    assert len(boat.end()) == logged


def test_no_folder_disables_log() -> None:
    boat = Rig(None)
    boat.arm()
    boat.tick(10)
    assert (boat.end(), boat.received_texts()[-1:]) == ([], ["Armed: HOLD"])


def test_unwritable_folder_is_reported_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    boat = Rig(tmp_path / "file")
    boat.arm()
    boat.tick(10)
    boat.until(lambda: boat.onboard_log._retry_s > 0.0)
    boat.tick(10)
    assert [text for text in boat.received_texts() if text.startswith("Log")] == [
        f"Log stopped: File exists: {tmp_path}/file"[:50]
    ]
    assert boat.vehicle.state.armed
    assert boat.received_texts() == []


def test_full_disk_is_reported_and_log_is_readable(tmp_path: Path, monkeypatch: Any) -> None:
    boat = Rig(tmp_path)
    assert boat.onboard_log.store
    boat.arm()
    boat.tick(2000)
    monkeypatch.setattr("autopilot.onboard_log.writer.FREE_SPACE_CHECK_BYTES", 1000)
    monkeypatch.setattr("shutil.disk_usage", lambda folder: type("Usage", (), {"free": 0}))
    boat.tick(500)
    boat.until(lambda: boat.onboard_log._retry_s > 0.0)
    boat.tick(100)
    assert [text for text in boat.received_texts() if "no room" in text] == [
        f"Log stopped: no room left for logs in {tmp_path}"[:50]
    ]
    (path,) = boat.end()
    assert mcap.recover(path, tmp_path / "saved.mcap").messages > 1000


@pytest.mark.parametrize(
    ("owner", "method", "number", "text"),
    [
        (BackgroundFile, "write", errno.ENOSPC, "{}/00001-"),
        (LogStore, "create", errno.EROFS, "Log stopped: Read-only file system; make the folder"),
    ],
)
def test_disk_error_is_named_and_a_new_log_begins_later(
    tmp_path: Path, monkeypatch: Any, owner: type, method: str, number: int, text: str
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    boat = Rig(tmp_path)
    with monkeypatch.context() as disk:
        disk.setattr(owner, method, refuse)
        boat.arm()
        boat.tick(100, depth_m=2.0)
        boat.until(lambda: boat.onboard_log._retry_s > 0.0)
        boat.tick(10, depth_m=2.0)
        said = "".join(boat.received_texts())
        assert text.format(tmp_path) in said
        assert os.strerror(number) in said
        assert "the dive goes on" in said
    assert boat.vehicle.state.armed
    boat.onboard_log._retry_s = 0.0
    boat.tick(100, depth_m=2.0)
    newest = boat.end()[-1]
    assert len(messages(newest, "ATTITUDE")) >= 100


def test_slow_disk_is_reported_without_delaying_ticks(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("autopilot.onboard_log.session.MAX_UNWRITTEN_CHUNKS", 3)
    boat = Rig(tmp_path)
    boat.arm()
    slow = time.sleep
    monkeypatch.setattr("os.fsync", lambda file: slow(1.0))
    boat.until(lambda: boat.onboard_log._session is not None)
    began = time.monotonic()
    for _ in range(20):
        boat.tick(150)
        assert boat.onboard_log._session
        boat.onboard_log._session.flush()
    assert time.monotonic() - began < 5.0
    boat.until(lambda: any("too slow" in text for text in boat.received_texts()))


def test_equal_dives_give_equal_logs(tmp_path: Path) -> None:
    digests = []
    for name in ("one", "other"):
        boat = Rig(tmp_path / name)
        boat.arm()
        boat.tick(300, depth_m=1.0)
        (path,) = boat.end()
        digests.append(identification.read(path).sha256)
    assert digests[0] == digests[1]
