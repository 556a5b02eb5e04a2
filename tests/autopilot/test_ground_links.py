"""Several ground links seen by pymavlink: profiles, routing and signing."""

import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.ground_server import GroundServer
from autopilot.comms.signing_keys import SigningKeys
from autopilot.comms.stream_rates import MINIMAL, fast_profile, half_profile, profile_for
from autopilot.control.params import PARAMETERS, ParamTable
from autopilot.control.types import Inputs
from autopilot.onboard_log import channels
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.telemetry.streams import STREAMS
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.signing import (
    EPOCH_UNIX_S,
    UNITS_PER_S,
    KeyFileError,
    Timestamp,
    key_from_passphrase,
    load_key,
)
from tests.helpers.fake_hil import TICK_US, Harness, Station, sensors, texts

KEY, NEW_KEY = key_from_passphrase("old"), key_from_passphrase("new")
NOW_S = 1_700_000_000.0
NOW = round((NOW_S - EPOCH_UNIX_S) * UNITS_PER_S)
SECOND_TICKS = 50


def serial_station(baud: int, system: int = 255) -> Station:
    station = Station(system)
    station.address = f"serial:/dev/radio:{baud}"
    return station


FAST, HALF = fast_profile(), half_profile()


def rates_hz(profile: Any) -> dict[str, float]:
    return {dialect.by_id(number).name: hz for number, hz in profile.rates_hz.items()}  # type: ignore[union-attr]


def test_baud_rate_selects_profile() -> None:
    assert [profile_for(baud) for baud in (None, 921_600, 115_200)] == [FAST] * 3
    assert [profile_for(baud) for baud in (57_600, 38_400)] == [HALF] * 2
    assert [profile_for(baud) for baud in (19_200, 9600, 1200)] == [MINIMAL] * 3
    assert rates_hz(FAST) == {stream.message.name: stream.rate_hz for stream in STREAMS}
    assert rates_hz(MINIMAL) == {
        "ATTITUDE": 1,
        "GLOBAL_POSITION_INT": 1,
        "VFR_HUD": 1,
        "SYS_STATUS": 0.2,
    }
    absent = {"ODOMETRY", "HIGHRES_IMU", "ACTUATOR_OUTPUT_STATUS"}
    assert rates_hz(HALF) == {
        name: hz / 2 for name, hz in rates_hz(FAST).items() if name not in absent
    }


def test_profile_uses_less_than_line_rate() -> None:
    for profile, baud in ((FAST, 115_200), (HALF, 57_600), (MINIMAL, 9600)):
        sizes = {number: dialect.by_id(number).struct.size + 12 for number in profile.rates_hz}  # type: ignore[union-attr]
        wanted = sum(hz * sizes[number] for number, hz in profile.rates_hz.items())
        assert wanted < 0.7 * baud / 10, profile.name


def receive_for(harness: Harness, seconds: int) -> list[Any]:
    """Return what the first station receives while vehicle time and wall clock advance."""
    link = harness.server.links[0]
    first = harness.time_us < 0  # the first tick only sets the phase
    for _ in range(seconds * SECOND_TICKS + first):
        harness.time_us += TICK_US
        harness.vehicle.tick(Inputs(sensors(harness.time_us), None, None, None))
        harness.server.publish_telemetry()
        link.flush(harness.time_us * 1e-6)
    return harness.station.pop_received()


def test_slow_link_sends_profile_and_requested_messages() -> None:
    harness = Harness(serial_station(9600))
    kinds = [m.get_type() for m in receive_for(harness, 10)]
    assert {
        kind: kinds.count(kind) for kind in ("ATTITUDE", "VFR_HUD", "SYS_STATUS", "ODOMETRY")
    } == {
        "ATTITUDE": 10,
        "VFR_HUD": 10,
        "SYS_STATUS": 2,
        "ODOMETRY": 0,
    }
    harness.server.links[0].schedule.set_interval(mavlink.MAVLINK_MSG_ID_ALTITUDE, 500_000)
    kinds = [m.get_type() for m in receive_for(harness, 10)]
    assert kinds.count("ALTITUDE") == 20
    harness.server.links[0].schedule.set_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE, TICK_US)
    flooded = receive_for(harness, 10)
    assert sum(len(m.get_msgbuf()) for m in flooded) < 672 * 10 + 280
    assert {m.get_type() for m in flooded} >= {
        "ATTITUDE",
        "GLOBAL_POSITION_INT",
        "VFR_HUD",
        "ALTITUDE",
    }
    times = [m.time_boot_ms for m in flooded if m.get_type() == "ATTITUDE"]
    assert 50 < len(times) < 300
    assert times == sorted(times)


def test_request_data_stream_does_not_change_rates() -> None:
    harness = Harness()
    before = [m.get_type() for m in receive_for(harness, 2)]
    harness.ask(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 50, 1))
    after = [m.get_type() for m in receive_for(harness, 2)]
    assert after.count("ATTITUDE") == before.count("ATTITUDE") == 20


def test_reply_is_sent_during_parameter_list(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 0.0
    monkeypatch.setattr("autopilot.comms.ground_server.wall_s", lambda: now_s)
    harness, received = Harness(serial_station(9600)), list[str]()
    harness.station.transmit(mavlink.MAVLink_param_request_list_message(1, 1))

    def pass_time(duration_s: float) -> None:
        nonlocal now_s
        until_s = now_s + duration_s
        while now_s < until_s:
            now_s += 0.02
            harness.server.receive(harness.server.links[0])
            harness.server.poll()
            received.extend(kinds(harness.station.pop_received()))

    pass_time(1.0)
    harness.station.transmit(
        mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 131_072, 0, 0, 0, 0, 0)
    )
    pass_time(0.8)
    assert "COMMAND_ACK" in received
    listed = received.count("PARAM_VALUE")
    assert 10 < listed < len(PARAMETERS)
    pass_time(30.0)
    assert received.count("PARAM_VALUE") == len(PARAMETERS)


def two_stations() -> Harness:
    """Return a vehicle with a ground station on each of two links."""
    harness = Harness(Station(255, 190), Station(250, 190))
    for station in harness.stations:
        harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), station)
    for station in harness.stations:
        station.pop_received()
    return harness


def test_frames_are_forwarded_between_stations() -> None:
    harness = two_stations()
    first, second = harness.stations
    echo = harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 7, 0, 3), first)
    assert [m.custom_mode for m in second.pop_received() if m.get_srcSystem() == 255] == [7]
    assert [m for m in echo if m.get_srcSystem() == 255] == []
    harness.ask(mavlink.MAVLink_command_long_message(250, 190, 400, 0, 1, 0, 0, 0, 0, 0, 0), first)
    assert [m.get_type() for m in second.pop_received() if m.get_srcSystem() == 255] == [
        "COMMAND_LONG"
    ]
    harness.ask(
        mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 131_072, 0, 0, 0, 0, 0), first
    )
    harness.ask(mavlink.MAVLink_command_long_message(77, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0), first)
    assert [m for m in second.pop_received() if m.get_srcSystem() == 255] == []
    assert harness.vehicle.state.mode == 131_072
    assert not harness.vehicle.state.armed


def test_component_behind_link_is_reachable() -> None:
    harness = Harness(Station(255, 190), Station(1, 100))
    camera = harness.stations[1]
    harness.ask(mavlink.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3), camera)
    camera.pop_received()
    harness.ask(mavlink.MAVLink_command_long_message(1, 100, 2000, 0, 1, 0, 0, 0, 0, 0, 0))
    assert [m.command for m in camera.pop_received() if m.get_type() == "COMMAND_LONG"] == [2000]
    received = harness.command(400, 1, component=0)
    assert [m.get_srcComponent() for m in received if m.get_type() == "COMMAND_ACK"] == [1], (
        "the vehicle executes the command"
    )
    assert [m.command for m in camera.pop_received() if m.get_type() == "COMMAND_LONG"] == [400], (
        "the other stations receive it"
    )


def test_unknown_messages_are_forwarded_unchanged(monkeypatch: pytest.MonkeyPatch) -> None:
    harness = two_stations()
    first, second = harness.stations
    body = (
        struct.pack("<BBBBBBBHB", 4, 0, 0, 9, 255, 190, 0x34, 0xABCD, 0)[:9] + b"\x01\x02\x03\x04"
    )
    crc = mavlink.x25crc(body + bytes((77,))).crc
    raw = b"\xfd" + body + struct.pack("<H", crc)
    stranger = b"\xfd" + body.replace(b"\xff\xbe", b"\xfe\xbe") + struct.pack("<H", crc)
    first._outgoing += [raw, stranger, raw[:-1] + bytes((raw[-1] ^ 0x10,))]
    sent: list[bytes] = []
    monkeypatch.setattr(second, "send", sent.append)
    harness.serve()
    assert raw in b"".join(sent)
    assert b"".join(sent).count(body[-4:]) == 1, (
        "only from a known sender, with a CRC that one seed matches"
    )


def test_routing_can_be_disabled() -> None:
    harness = two_stations()
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"MAV_FORWARD", 0.0, 9))
    harness.stations[1].pop_received()
    harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 7, 0, 3))
    assert [m for m in harness.stations[1].pop_received() if m.get_srcSystem() == 255] == []


def sign(station: Station, key: bytes = KEY, timestamp: int = NOW) -> None:
    """Let a station sign its messages and accept only signed ones."""
    for end in (station._mavlink, station._reader):
        end.signing.secret_key = key
        end.signing.timestamp = timestamp
        end.signing.sign_outgoing = True
    station._reader.robust_parsing = True


class SignedHarness(Harness):
    """A vehicle whose first link is signed with a key file."""

    def __init__(self, folder: Path, *stations: Station) -> None:
        super().__init__(*stations)
        self.file = folder / "key"
        self.file.touch(0o600)
        self.file.write_text("old")
        keys = SigningKeys({self.station.address: self.file}, Timestamp(unix_s=lambda: NOW_S))
        self.vehicle = Vehicle(ParamTable())
        self.server = GroundServer(self.vehicle, self.stations, AutopilotId.GENERIC, keys)
        self.tick(3)
        self.serve()
        for station in self.stations:
            station.pop_received()


def kinds(messages: list[Any]) -> list[str]:
    return [m.get_type() for m in messages]


def test_signed_link_accepts_only_valid_signatures(tmp_path: Path) -> None:
    harness = SignedHarness(tmp_path)
    assert harness.command(400, 1) == [], "without a key"
    sign(harness.station, NEW_KEY)
    assert set(kinds(harness.command(400, 1))) <= {"BAD_DATA"}, "with another key"
    assert not harness.vehicle.state.armed
    sign(harness.station)
    assert "COMMAND_ACK" in kinds(harness.command(400, 1))
    assert harness.vehicle.state.armed


def setup(key: bytes, system: int = 1) -> Any:
    return mavlink.MAVLink_setup_signing_message(system, 1, list(key), NOW + 500)


def test_key_change_over_signed_link_is_stored(tmp_path: Path) -> None:
    harness = SignedHarness(tmp_path)
    sign(harness.station)
    harness.station.transmit(setup(NEW_KEY))
    sign(harness.station, NEW_KEY, NOW + 600)
    harness.serve()
    assert "Signing key changed on 1 link" in texts(harness.station.pop_received())
    assert load_key(harness.file) == NEW_KEY
    assert "COMMAND_ACK" in kinds(harness.command(400, 1))


def test_key_change_over_serial_line_applies_to_radio(tmp_path: Path) -> None:
    wire = serial_station(115_200, 250)
    harness = SignedHarness(tmp_path, Station(255, 190), wire)
    assert "Signing key changed on 1 link" in texts(harness.ask(setup(NEW_KEY), wire))
    assert load_key(harness.file) == NEW_KEY
    sign(harness.station, NEW_KEY, NOW + 600)
    assert "COMMAND_ACK" in kinds(harness.command(400, 1))


def test_key_change_over_untrusted_link_or_armed_is_refused(tmp_path: Path) -> None:
    open_link, wire = Station(251, 190), serial_station(115_200, 250)
    harness = SignedHarness(tmp_path, Station(255, 190), open_link, wire)
    refused = texts(harness.ask(setup(NEW_KEY), open_link))
    assert refused == ["Signing key refused: the link is neither signed nor serial"]
    zero = texts(harness.ask(setup(bytes(32)), wire))
    assert zero == ["Signing unchanged: it is configured at the start, by --sign"]
    sign(harness.station)
    harness.command(400, 1)
    wire.pop_received()
    assert texts(harness.ask(setup(NEW_KEY), wire)) == ["Signing key refused: armed"]
    harness.command(400, 0)
    wire.pop_received()
    harness.file.unlink()
    tmp_path.chmod(0o500)
    lost = texts(harness.ask(setup(NEW_KEY), wire))
    tmp_path.chmod(0o700)
    if lost != ["Signing key changed on 1 link"]:  # root can write everywhere
        assert lost == ["Signing key refused: it cannot be stored: Permission denied"]
        assert "COMMAND_ACK" in kinds(harness.command(400, 1)), "the old key is still valid"
    assert texts(Harness(wire).ask(setup(NEW_KEY), wire)) == [
        "Signing key refused: no link is signed; start with --sign"
    ]


def test_key_change_is_not_forwarded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other, wire = Station(251, 190), serial_station(115_200, 250)
    harness = SignedHarness(tmp_path, Station(255, 190), other, wire)
    harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), other)
    other.pop_received()
    sent: list[bytes] = []
    for station in (harness.station, other):
        monkeypatch.setattr(station, "send", sent.append)
    harness.ask(setup(NEW_KEY), wire)
    harness.ask(setup(NEW_KEY, system=0), wire)
    harness.ask(setup(NEW_KEY, system=251), wire)
    assert sent
    assert NEW_KEY[:8] not in b"".join(sent)
    assert mavlink.MAVLINK_MSG_ID_SETUP_SIGNING not in channels.LOGGED_FROM_GROUND, (
        "the key is not logged"
    )


@pytest.mark.parametrize("word", ["key", "udp:1", "udpout:1=", "udpout:2=key", "=key"])
def test_sign_option_requires_known_link_and_file(word: str) -> None:
    with pytest.raises(
        KeyFileError,
        match=r"expected ADDRESS=KEYFILE, where ADDRESS is one of udpout:1, serial:x:9",
    ):
        SigningKeys.from_options([word], ["udpout:1", "serial:x:9"])
