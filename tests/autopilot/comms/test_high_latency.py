"""HIGH_LATENCY2 and answers over a modem with seconds of delay, losses and half duplex."""

import itertools
from typing import Any, TypeVar

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms import ground_links, ground_server, services, statustext
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.modems import modem_intervals
from autopilot.control import modes
from autopilot.telemetry.autopilot_id import AutopilotId
from ground.client.commands import CommandExchange
from ground.client.vehicle import VehicleClient
from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.mission_items import MavCmd, MissionItem
from mavlink_io.records import GpsFix
from mavlink_io.request import Exchange, MavlinkId
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient
from mavlink_io.transport import AddressError, open_transport
from tests.helpers.fake_hil import Harness, Station, only
from tests.helpers.modem import ModemChannel, frames

T = TypeVar("T")

GROUND, VEHICLE = MavlinkId(250, 190), MavlinkId(1, 1)
FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
STEP_S = 0.25
RETRY_S = 20.0
"""More than the way there and back, the packets in between and a HIGH_LATENCY2."""
ATTEMPTS = 30
"""Number of attempts that a person would make: losses are random."""
CONTROL_HIGH_LATENCY, REQUEST_MESSAGE = 2600, 512


class Dive:
    """A vehicle whose only ground link is a modem, and its ground station, in virtual time."""

    def __init__(
        self, channel: ModemChannel, monkeypatch: pytest.MonkeyPatch, period_s: float = 10.0
    ) -> None:
        self.channel = channel
        for module in (ground_links, ground_server, services, statustext):
            monkeypatch.setattr(module, "wall_s", lambda: channel.now_s)
        self.harness = Harness()
        self.harness.tick(100, fix=FIX)
        self.vehicle = self.harness.vehicle
        self.server = GroundServer(
            self.vehicle, [channel.vehicle], AutopilotId.GENERIC, modems={"modem": period_s}
        )
        self._framer, self._sequence = Framer(), 0

    def send(self, name: str, **fields: Any) -> None:
        """Send a message of the ground station."""
        message = dialect.by_name(name)
        self._sequence = (self._sequence + 1) % 256
        self.channel.ground.send(encode(message, message.values(**fields), self._sequence, *GROUND))

    def step(self) -> list[Any]:
        """Advance the time; return the frames that reach the ground station."""
        self.channel.now_s += STEP_S
        (link,) = self.server.links
        self.server.receive(link)
        self.server.publish_telemetry()
        self.server.poll()
        self.server.flush()
        return list(self._framer.feed(self.channel.ground.receive()))

    def run(self, exchange: Exchange[T]) -> T:
        """Run an exchange with the retry time of a modem."""
        exchange.repeat_every(RETRY_S, ATTEMPTS)
        while not exchange.done:
            exchange.poll(self.channel.now_s)
            for frame in self.step():
                exchange.feed(frame)
        return exchange.result()


@pytest.mark.parametrize("period_s", [10.0, 45.0])
def test_idle_modem_carries_high_latency2_only(
    monkeypatch: pytest.MonkeyPatch, period_s: float
) -> None:
    dive = Dive(ModemChannel(0, loss=0.0), monkeypatch, period_s)
    dive.vehicle.send_statustext("not for the modem")
    while dive.channel.now_s < 600.0:
        dive.harness.time_us += 250_000
        dive.step()
    sent = frames(dive.channel.vehicle.sent)
    assert {frame.name for _, frame in sent} == {"HIGH_LATENCY2"}
    times_s = [time_s for time_s, _ in sent]
    gaps_s = [b - a for a, b in itertools.pairwise(times_s)]
    assert min(gaps_s) >= period_s
    assert max(gaps_s) <= period_s + STEP_S
    assert len(dive.channel.vehicle.sent[0][1]) <= 54  # 42 bytes of payload in a MAVLink 2 frame


@pytest.mark.parametrize("seed", range(4))
def test_requests_succeed_over_a_lossy_half_duplex_modem(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """30 % of the packets are lost, 3 s each way, and packets that cross are lost as well."""
    dive = Dive(ModemChannel(seed), monkeypatch)
    participants = dive.send, GROUND, VEHICLE
    began = len(dive.channel.vehicle.sent)
    assert dive.run(ParamClient(*participants).set("STN_RADIUS_M", 25.0)) == 25.0
    items = tuple(MissionItem(n, 2, 93, p1=float(n), p2=-1, p3=-1, p4=-1) for n in range(4))
    dive.run(MissionClient(*participants).upload(items))
    assert [item.p1 for item in dive.vehicle.state.mission.items] == [0.0, 1.0, 2.0, 3.0]
    dive.run(CommandExchange(*participants, MavCmd.NAV_LAND))
    assert dive.vehicle.state.mode == modes.SURFACE.number
    names = {frame.name for _, frame in frames(dive.channel.vehicle.sent[began:])}
    assert names <= {
        *("HIGH_LATENCY2", "COMMAND_ACK", "PARAM_VALUE"),
        *("MISSION_REQUEST_INT", "MISSION_ACK"),
    }


def test_crossing_packets_collide() -> None:
    channel = ModemChannel(0, loss=0.0)
    channel.ground.send(b"up" * 300)
    channel.now_s = 3.5
    channel.vehicle.send(b"down" * 300)
    channel.now_s = 30.0
    assert (channel.vehicle.receive(), channel.vehicle.collisions) == (b"", 1)
    assert channel.ground.receive() == b"down" * 300, "it was silent by then"


def test_command_switches_a_link_to_high_latency_and_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ground_server, "wall_s", lambda: 1000.0)  # no second one becomes due
    harness = Harness(Station(), Station(250))
    harness.tick(100, fix=FIX)
    for enabled, streams in ((1, False), (0, True)):
        received = harness.command(CONTROL_HIGH_LATENCY, enabled)
        assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
        assert any(m.get_type() == "HIGH_LATENCY2" for m in received) == (not streams)
        harness.vehicle.send_statustext("a text")
        harness.server._heartbeat.hasten()
        harness.tick(100, fix=FIX)
        harness.serve()
        names = {m.get_type() for m in harness.station.pop_received()}
        assert ({"ATTITUDE", "HEARTBEAT", "STATUSTEXT"} <= names) == streams
        assert bool(names) == streams
        assert "ATTITUDE" in {m.get_type() for m in harness.stations[1].pop_received()}
    received = harness.command(CONTROL_HIGH_LATENCY, 2)
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_DENIED


def test_modem_is_silent_but_answers_after_high_latency_is_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    dive = Dive(ModemChannel(0, loss=0.0), monkeypatch)
    dive.run(CommandExchange(dive.send, GROUND, VEHICLE, MavCmd.CONTROL_HIGH_LATENCY, 0.0))
    before = len(dive.channel.vehicle.sent)
    for _ in range(200):
        dive.step()
    assert len(dive.channel.vehicle.sent) == before
    dive.run(CommandExchange(dive.send, GROUND, VEHICLE, MavCmd.CONTROL_HIGH_LATENCY, 1.0))
    for _ in range(200):
        dive.step()
    assert len(dive.channel.vehicle.sent) >= before + 5


def _last(messages: list[Any], name: str) -> Any:
    """Return the last message of a name: a periodic HEARTBEAT may come as well."""
    return [m for m in messages if m.get_type() == name][-1]


@pytest.mark.parametrize(
    ("identity", "custom_mode"),
    [(AutopilotId.GENERIC, 4 | 6 << 8), (AutopilotId.ARDUPILOT, 9)],
)
def test_high_latency2_agrees_with_telemetry(identity: AutopilotId, custom_mode: int) -> None:
    harness = Harness(autopilot=identity)
    harness.tick(100, fix=FIX)
    harness.command(400, 1)
    harness.command(MavCmd.NAV_LAND)
    harness.tick(400, depth_m=5.0)
    names = "HIGH_LATENCY2", "GLOBAL_POSITION_INT", "HEARTBEAT"
    report, position, beat = (
        _last(harness.command(REQUEST_MESSAGE, dialect.by_name(name).message_id), name)
        for name in names
    )
    assert (report.latitude, report.longitude) == (position.lat, position.lon)
    assert report.altitude == -5
    assert report.heading == pytest.approx(position.hdg / 200, abs=1)
    assert report.custom_mode == custom_mode
    assert (report.type, report.autopilot) == (beat.type, beat.autopilot)
    assert (report.custom0 & 0xFF, report.custom1) == (beat.base_mode, beat.system_status)
    assert report.battery == -1, "there is no gauge"


def test_modem_option_names_a_link_and_a_time() -> None:
    links = ["serial:/dev/ttyS1:1200", "udpout:127.0.0.1:14550"]
    assert modem_intervals(["serial:/dev/ttyS1:1200=60"], links) == {links[0]: 60.0}
    assert modem_intervals([links[1]], links) == {links[1]: 10.0}
    for word, reason in (
        ("udpin:127.0.0.1:1", "is one of serial:/dev/ttyS1:1200"),
        (f"{links[0]}=5", "'5' must be a number of seconds from 10"),
        (f"{links[0]}=soon", "'soon' must be a number"),
        (f"{links[0]}=nan", "'nan' must be a number"),
    ):
        with pytest.raises(AddressError, match=reason):
            modem_intervals([word], links)


def test_ground_finds_and_commands_a_vehicle_by_high_latency2() -> None:
    """``ground --modem``: no HEARTBEAT is ever sent, and every request is answered."""
    name = "memory:modem-ground"
    with_vehicle, with_ground = open_transport(name), open_transport(name)
    harness = Harness()
    harness.tick(100, fix=FIX)
    server = GroundServer(harness.vehicle, [with_vehicle], AutopilotId.GENERIC, modems={name: 10.0})

    def serve() -> None:
        """Run the vehicle; the client calls this while it waits."""
        (link,) = server.links
        server.receive(link)
        server.poll()
        server.flush()

    serve()
    client = VehicleClient(with_ground, watchdog=serve, modem_s=5.0)
    client.connect()
    assert (client.vehicle_id, client.armed) == (VEHICLE, False)
    assert client.custom_mode == modes.HOLD.number
    assert client.set_parameter("STN_RADIUS_M", 30.0) == 30.0
    client.command(MavCmd.COMPONENT_ARM_DISARM, 1.0)
    server.links[0].schedule.control_high_latency(True)  # the next one is due now
    assert client.pump_until(lambda: client.armed, 30.0)
    client.close()
    with_vehicle.close()
