"""The vehicle client with a scripted fake vehicle."""

import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from threading import Timer

import pytest

from ground.client import vehicle as client
from ground.client.recorder import Recorder
from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.simulation.processes import free_port
from mavlink_io.clock import wall_s
from mavlink_io.codec import encode
from mavlink_io.dialect import by_name
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import MissionItem
from mavlink_io.transport import open_transport
from tests.ground.fake import ACCEPTED, DENIED, REJECTED, FakeVehicle, step_while_waiting
from tests.helpers.px4_params import Px4Params

ARM, SET_MODE, SET_INTERVAL = 400, 176, 511
BOOT, STANDBY, ACTIVE, CRITICAL = 1, 3, 4, 5
MANUAL_NUMBER = 65_536


Meet = Callable[..., FakeVehicle]


@pytest.fixture
def meet(monkeypatch: pytest.MonkeyPatch) -> Iterator[Meet]:
    """Makes a fake vehicle that acts whenever ground waits, and has said that it is there."""
    with ExitStack() as stack:

        def make(answers: dict[int, list[int]] | None = None) -> FakeVehicle:
            fake = FakeVehicle(answers)
            stack.callback(fake.close)
            monkeypatch.setattr(client, "wait", step_while_waiting(fake))
            fake.heartbeat()
            return fake

        yield make


@pytest.fixture
def fake(meet: Meet) -> FakeVehicle:
    return meet()


def connected(fake: FakeVehicle, recorder: Recorder | None = None) -> VehicleClient:
    vehicle = VehicleClient(fake.ground_end, recorder)
    vehicle.connect()
    return vehicle


def test_a_ground_station_is_not_taken_for_a_vehicle(meet: Meet) -> None:
    fake = meet()
    fake.ground_end.receive()
    fake.heartbeat(kind=6, autopilot=8)
    with pytest.raises(VehicleClientError, match="no vehicle on memory"):
        VehicleClient(fake.ground_end).connect(timeout_s=0.05)


def test_parameters_are_listed_set_and_read_back(fake: FakeVehicle) -> None:
    vehicle = connected(fake)
    assert vehicle.parameters() == pytest.approx({"DPT_P": 0.13, "HDG_P": 0.65}, rel=1e-6)
    assert vehicle.set_parameter("HDG_P", 0.5) == 0.5
    assert vehicle.parameter("HDG_P") == fake.table.values["HDG_P"] == 0.5


def test_an_unknown_parameter_is_named(fake: FakeVehicle) -> None:
    with pytest.raises(VehicleClientError, match="NO_SUCH"):
        connected(fake).set_parameter("NO_SUCH", 1.0)


def test_a_mission_goes_up_and_comes_back(fake: FakeVehicle) -> None:
    items = tuple(MissionItem(n, 2, 93, int(n == 0), 1, 5.0 + n) for n in range(7))
    vehicle = connected(fake)
    vehicle.upload(items)
    assert vehicle.download() == items == tuple(fake.store.items)


def test_modes_are_learned_from_the_vehicle(fake: FakeVehicle) -> None:
    vehicle = connected(fake)
    assert vehicle.modes() == {"MISSION": 67371008, "MANUAL": 65536}
    vehicle.set_mode("MISSION")
    (sent,) = (c for c in fake.commands if c.command == SET_MODE)
    assert (sent.param1, sent.param2) == (1.0, 67371008.0)
    with pytest.raises(VehicleClientError, match="offers MANUAL, MISSION"):
        vehicle.set_mode("LOITER")


def test_a_rate_is_asked_for_as_an_interval(fake: FakeVehicle) -> None:
    connected(fake).set_interval("ATTITUDE", 50.0)
    (sent,) = (c for c in fake.commands if c.command == SET_INTERVAL)
    assert (sent.param1, sent.param2) == (30.0, 20_000.0)


def test_arming_waits_for_a_vehicle_that_is_still_starting(meet: Meet) -> None:
    fake = meet()
    vehicle = connected(fake)
    fake.heartbeat(status=BOOT)
    vehicle.pump(0.0)
    later = Timer(0.2, lambda: fake.heartbeat(status=STANDBY))
    later.start()
    vehicle.arm()
    later.join()
    assert sum(c.command == ARM for c in fake.commands) == 1, "asked once, when it was ready"


def test_arm_never_ready_vehicle_reports_its_reason(
    meet: Meet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "ARM_RETRY_S", 0.1)
    fake = meet({ARM: [REJECTED]})
    vehicle = connected(fake)
    fake.heartbeat(status=BOOT)
    vehicle.pump(0.0)
    with pytest.raises(VehicleClientError, match=r"temporarily rejected \(Not armed: no sensors"):
        vehicle.arm(timeout_s=0.1)


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Attempts to arm follow each other faster than a person could bear to watch in a test."""
    monkeypatch.setattr(client, "ARM_RETRY_PERIOD_S", 0.02)


def asked_to_arm(fake: FakeVehicle) -> int:
    return sum(c.command == ARM for c in fake.commands)


@pytest.mark.usefixtures("hasty")
def test_arm_temporary_refusal_is_asked_again(meet: Meet) -> None:
    fake = meet({ARM: [REJECTED, REJECTED, ACCEPTED]})
    connected(fake).arm()
    assert asked_to_arm(fake) == 3


@pytest.mark.usefixtures("hasty")
def test_arm_waits_until_prearm_check_passes(meet: Meet) -> None:
    """The second attempt is made when SYS_STATUS says that the checks pass, and not before."""
    fake = meet({ARM: [REJECTED, ACCEPTED]})
    fake.prearm = False
    vehicle = connected(fake)
    later = Timer(0.3, lambda: setattr(fake, "prearm", True))
    later.start()
    vehicle.arm()
    later.join()
    assert fake.prearm
    assert asked_to_arm(fake) == 2


def test_arm_refusal_of_ready_vehicle_is_final(meet: Meet) -> None:
    """The pre-arm checks pass: the reason, such as a missing mission, does not go away by
    itself.
    """
    fake = meet({ARM: [REJECTED, REJECTED, ACCEPTED]})
    fake.prearm = True
    with pytest.raises(client.CommandRefusedError, match="temporarily rejected"):
        connected(fake).arm()
    assert asked_to_arm(fake) == 2, (
        "once more, as the checks may have passed since the first refusal"
    )


@pytest.mark.usefixtures("hasty")
def test_arm_lasting_refusal_ends_with_its_reason(
    meet: Meet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "ARM_RETRY_S", 0.1)
    fake = meet({ARM: [REJECTED]})
    with pytest.raises(VehicleClientError, match="no sensors"):
        connected(fake).arm()
    assert asked_to_arm(fake) > 1


def test_arm_simulated_vehicle_may_start_for_longer(
    meet: Meet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The watchdog, which looks after the processes, is what tells a simulated vehicle."""
    monkeypatch.setattr(client, "READY_TIMEOUT_S", 0.05)
    fake = meet()
    vehicle = VehicleClient(fake.ground_end, watchdog=lambda: None)
    vehicle.connect()
    fake.heartbeat(status=BOOT)
    vehicle.pump(0.0)
    later = Timer(0.4, lambda: fake.heartbeat(status=STANDBY))
    later.start()
    vehicle.arm()
    later.join()
    assert asked_to_arm(fake) == 1


def test_long_waits_are_reported_once(meet: Meet, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "WAIT_NOTICE_S", 0.05)
    fake, reports = meet(), list[str]()
    fake.ground_end.receive()
    vehicle = VehicleClient(fake.ground_end)
    vehicle.on_remark = reports.append
    with pytest.raises(VehicleClientError, match="no vehicle"):
        vehicle.connect(0.2)
    fake.heartbeat(status=BOOT)
    vehicle.connect(0.2)
    vehicle.arm(timeout_s=0.2)
    assert reports == [
        f"waiting up to 0.2 s for a vehicle on {fake.ground_end.address}",
        "waiting up to 0.2 s for the vehicle to read its sensors",
    ]


def test_a_denial_is_final(meet: Meet) -> None:
    fake = meet({ARM: [DENIED, ACCEPTED]})
    with pytest.raises(VehicleClientError, match="denied"):
        connected(fake).arm()


def test_refusal_names_the_last_texts_once(meet: Meet) -> None:
    fake = meet({ARM: [DENIED]})
    vehicle = connected(fake)
    for n in range(40):
        fake.send_text(f"reason {n // 2}")
        fake.send_text("")
    with pytest.raises(VehicleClientError) as refusal:
        vehicle.command(ARM, 1.0)
    reasons = "; ".join(f"reason {n}" for n in range(15, 20))
    assert str(refusal.value) == f"component arm disarm: denied ({reasons})"


def test_a_long_text_is_one_text(fake: FakeVehicle) -> None:
    vehicle = connected(fake)
    fake.send_text("SystemID Starting: axis=12 wave=doublet magnitude=", id=3, chunk_seq=0)
    fake.send_text("4.00", id=3, chunk_seq=1)
    fake.send_text("SystemID Finished")
    vehicle.pump(0.0)
    vehicle.pump(0.0)
    vehicle.pump(0.0)
    received = [text.text for text in vehicle.texts]
    assert received == [
        "SystemID Starting: axis=12 wave=doublet magnitude=4.00",
        "SystemID Finished",
    ]


def test_arming_and_disarming_in_one_read_is_counted(fake: FakeVehicle) -> None:
    vehicle = connected(fake)
    fake.heartbeat(armed=True)
    fake.heartbeat(armed=False)
    vehicle.pump(0.0)
    vehicle.pump(0.0)
    assert (vehicle.armed, vehicle.disarmings) == (False, 1)


def test_critical_mode_ends_with_the_fault(fake: FakeVehicle) -> None:
    vehicle = connected(fake)
    vehicle.modes()
    for status, mode in ((CRITICAL, "MANUAL"), (ACTIVE, "")):
        fake.custom_mode = MANUAL_NUMBER
        fake.heartbeat(armed=True, status=status)
        vehicle.pump(0.0)
        assert vehicle.critical_mode == mode
    fake.heartbeat(armed=True, status=CRITICAL)
    fake.heartbeat(armed=False, status=STANDBY)
    vehicle.pump(0.0)
    assert vehicle.critical_mode == "MANUAL", "the failsafe was in force until it disarmed"


def test_a_silent_vehicle_is_lost(fake: FakeVehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = connected(fake)
    steps = clock(monkeypatch, 0.5)
    with pytest.raises(VehicleClientError, match="no heartbeat"):
        pump(vehicle, 11, steps)


def test_a_vehicle_on_a_modem_is_named_when_it_is_lost(
    meet: Meet, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = meet()
    fake.ground_end.receive()
    fake.send_high_latency()
    vehicle = connected(fake)
    steps = clock(monkeypatch, 0.5)
    with pytest.raises(VehicleClientError, match=r"for 5 s \(HIGH_LATENCY2 .* --modem SECONDS"):
        pump(vehicle, 11, steps)


def test_a_simulated_vehicle_on_a_busy_machine_is_waited_for(
    fake: FakeVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its watchdog reports a process that has ended; silence is no such report."""
    checked: list[None] = []
    vehicle = VehicleClient(fake.ground_end, watchdog=lambda: checked.append(None))
    vehicle.connect()
    steps = clock(monkeypatch, 0.5)
    pump(vehicle, 100, steps)
    assert checked
    with pytest.raises(VehicleClientError, match=r"no heartbeat on .* for 60 s"):
        pump(vehicle, 30, steps)


def test_pump_after_a_pause_waits_for_the_vehicle(
    fake: FakeVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A machine that slept for an hour: the vehicle speaks within its timeout after that."""
    vehicle = connected(fake)
    vehicle.pump(0.0)
    clock(monkeypatch, 3600.0)()
    vehicle.pump(0.0)
    fake.heartbeat()
    steps = clock(monkeypatch, 0.5, ahead_s=3600.0)
    pump(vehicle, 10, steps)
    with pytest.raises(VehicleClientError, match="no heartbeat"):
        pump(vehicle, 2, steps)


def clock(
    monkeypatch: pytest.MonkeyPatch, step_s: float, ahead_s: float = 0.0
) -> Callable[[], None]:
    """Stop the client's clock, ahead of real time; return the function that advances it."""
    now_s = wall_s() + ahead_s

    def advance() -> None:
        nonlocal now_s
        now_s += step_s

    monkeypatch.setattr(client, "wall_s", lambda: now_s)
    return advance


def test_parameters_of_px4_are_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """The HEARTBEAT of PX4 selects the reading of integers as bytes."""
    fake = FakeVehicle()
    fake._params = Px4Params()  # type: ignore[assignment]
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    fake.heartbeat(autopilot=12)
    with closing(fake):
        vehicle = VehicleClient(fake.ground_end)
        vehicle.connect()
        assert vehicle.parameters() == {"BAT_N": -1.0, "MPC_XY_P": 0.5, "SYS_AUTOSTART": 4001.0}
        assert vehicle.set_parameter("SYS_AUTOSTART", 60500.0) == 60500.0


class Backlog:
    """A vehicle whose datagrams lie unread in a UDP socket while ground is not scheduled."""

    def __init__(self) -> None:
        port = free_port()
        self.ground_end = open_transport(f"udpin:127.0.0.1:{port}")
        self._end = open_transport(f"udpout:127.0.0.1:{port}")
        self.vehicle, self.other = Endpoint(self._end, 1, 1), Endpoint(self._end, 9, 1)

    def heartbeat(self) -> None:
        self._heartbeat(self.vehicle, kind=12, autopilot=0)

    def chatter(self, datagrams: int) -> None:
        """Ground stations speak: what says nothing about the vehicle."""
        for _ in range(datagrams):
            self._heartbeat(self.other, kind=6, autopilot=8)

    def close(self) -> None:
        self._end.close()
        self.ground_end.close()

    @staticmethod
    def _heartbeat(sender: Endpoint, kind: int, autopilot: int) -> None:
        fields = {"base_mode": 1, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
        sender.send("HEARTBEAT", type=kind, autopilot=autopilot, **fields)


def pump(vehicle: VehicleClient, times: int, advance: Callable[[], None] = lambda: None) -> None:
    for _ in range(times):
        advance()
        vehicle.pump(0.02)


@pytest.fixture
def backlog() -> Iterator[Backlog]:
    with closing(Backlog()) as backlog:
        yield backlog


def test_pump_late_reader_finds_vehicle_alive(
    backlog: Backlog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock has passed the limit of silence; the heartbeat waits behind 200 other datagrams."""
    vehicle = VehicleClient(backlog.ground_end)
    backlog.heartbeat()
    vehicle.connect()
    backlog.chatter(200)
    backlog.heartbeat()
    late_s = wall_s() + client.HEARTBEAT_TIMEOUT_S + 1.0
    monkeypatch.setattr(client, "wall_s", lambda: late_s)
    pump(vehicle, 10)
    assert vehicle.vehicle_id == (1, 1)


def test_pump_waits_longer_for_a_simulated_vehicle(
    backlog: Backlog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A busy machine runs the autopilot late; a watchdog reports processes that ended."""
    checks = []
    vehicle = VehicleClient(backlog.ground_end, watchdog=lambda: checks.append(1))
    backlog.heartbeat()
    vehicle.connect()
    start_s = wall_s()
    # one call of `pump` each second: a longer gap would be a pause of this program
    for second in range(int(client.SIMULATED_HEARTBEAT_TIMEOUT_S)):
        monkeypatch.setattr(client, "wall_s", lambda now_s=start_s + second: now_s)
        vehicle.pump(0.0)
    assert checks
    late_s = start_s + client.SIMULATED_HEARTBEAT_TIMEOUT_S + 1.0
    monkeypatch.setattr(client, "wall_s", lambda: late_s)
    with pytest.raises(client.VehicleClientError, match="for 60 s"):
        pump(vehicle, 10)


def test_pump_late_reader_finds_silent_vehicle_gone(
    backlog: Backlog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others chatter, the vehicle does not: with everything read it is declared gone."""
    vehicle = VehicleClient(backlog.ground_end)
    backlog.heartbeat()
    vehicle.connect()
    backlog.chatter(200)
    steps = clock(monkeypatch, 0.9)
    with pytest.raises(VehicleClientError, match="no heartbeat"):
        pump(vehicle, 10, steps)


def test_connect_late_reader_finds_vehicle(backlog: Backlog) -> None:
    """No time is left, and the heartbeat waits behind 200 other datagrams."""
    vehicle = VehicleClient(backlog.ground_end)
    backlog.chatter(200)
    backlog.heartbeat()
    vehicle.connect(timeout_s=0.0)
    assert vehicle.vehicle_id == (1, 1)


def test_last_words_before_a_broken_link_are_received() -> None:
    """Bytes that arrived before the other end closed are read; then the link is lost."""
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        ground_end = open_transport(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        connection, _ = server.accept()
    with closing(ground_end), closing(connection):
        text, heartbeat = by_name("STATUSTEXT"), by_name("HEARTBEAT")
        connection.sendall(encode(heartbeat, (0, 12, 0, 1, 4, 3), 0, 1, 1))
        connection.sendall(encode(text, (2, b"Leak", 0, 0), 1, 1, 1))
        connection.close()
        vehicle = VehicleClient(ground_end)
        with pytest.raises(VehicleClientError, match="gone"):
            pump(vehicle, 10)
    assert [said.text for said in vehicle.texts] == ["Leak"]


def test_all_frames_are_recorded_during_a_request(fake: FakeVehicle, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "log.mcap")
    vehicle = connected(fake, recorder)
    fake.send_text("meanwhile")
    vehicle.parameters()
    recorder.finish()
    from ground.log_tools import mcap

    topics = mcap.info(tmp_path / "log.mcap")["topics"]
    assert topics["/mavlink/1/1/STATUSTEXT"] == 1
    assert topics["/mavlink/1/1/PARAM_VALUE"] == 2
