"""Samples that compiled code answers: the same answers and telemetry as those of Python."""

from collections import deque
from collections.abc import Sequence

import pytest

from autopilot.app import App
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink
from autopilot.control import modes, requests
from autopilot.control.params import ParamTable
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.vehicle import Vehicle
from mavlink_io import dialect, jit
from mavlink_io.clock import wall_s
from mavlink_io.codec import Framer
from mavlink_io.mission_items import MissionItem
from mavlink_io.transport import Handle, Piece
from sitl import scenario
from sitl.backends.hil import HilClient
from sitl.core import plant, truth
from sitl.vehicle import config
from tests.helpers.missions import excitation_item, leg

TICKS = 800
HEARTBEAT = dialect.by_name("HEARTBEAT").message_id
FLIGHT = (
    *leg(depth_m=3.0, heading_deg=40.0, duration_s=6.0),
    excitation_item(4, axis=12, magnitude_deg=4.0, duration_s=5, wave=0)._replace(p3=0.1, p4=0.5),
    *leg(depth_m=2.0, heading_deg=0.0, duration_s=30.0, first=5),
)


class HilEnd:
    """The autopilot's end of the HIL link: a socket with one peer."""

    def __init__(self) -> None:
        self.address, self.eager = "udpin:127.0.0.1:9", False
        self.incoming: deque[bytes] = deque()
        self.outgoing: deque[bytes] = deque()
        self.read_in_place = 0

    def handles(self) -> Sequence[Handle]:
        return ()

    def send(self, data: bytes) -> None:
        self.outgoing.append(data)

    def receive(self) -> bytes:
        return self.incoming.popleft() if self.incoming else b""

    def receive_from(self) -> Sequence[Piece]:
        data = self.receive()
        return (("sea", data),) if data else ()

    def receive_into(self, memory: memoryview) -> int:
        datagram = self.receive()
        memory[: len(datagram)] = datagram
        self.read_in_place += bool(datagram)
        return len(datagram)

    def close(self) -> None:
        pass


class SeaEnd(HilEnd):
    """The simulator's end of the same link."""

    def __init__(self, other: HilEnd) -> None:
        super().__init__()
        self.incoming, self.outgoing = other.outgoing, other.incoming


class Sink(HilEnd):
    """A ground link that keeps what it is given."""

    address = "tcpin:127.0.0.1:9"

    def __init__(self) -> None:
        super().__init__()
        self.address = "tcpin:127.0.0.1:9"


def _fly(*, compiled: bool) -> tuple[list[bytes], list[bytes], HilEnd]:
    """Return the answers and the telemetry without heartbeats of a dive in the disturbed sea."""
    hil_end, ground_end = HilEnd(), Sink()
    vehicle = Vehicle(ParamTable({}), compiled=compiled)
    hil = HilLink(hil_end, 1)
    onboard_log = OnboardLog(vehicle, None)
    ground = GroundServer(vehicle, [ground_end], AutopilotId.GENERIC, onboard_log=onboard_log)
    app = App(vehicle, hil, ground, onboard_log)
    sea = HilClient(SeaEnd(hil_end))
    simulated = plant.build(config.load("caribou_truth"), scenario.load("disturbed"))
    rng = plant.random_streams(1)
    state, sensors = plant.initial_state(simulated, rng)
    answers: list[bytes] = []
    for count in range(TICKS):
        frame = truth.to_frame(state.truth, 42.0, -71.0) if state.time_us % 100_000 == 0 else None
        sea.send(sea.datagram(sensors, frame, state.faults.changes))
        while not hil_end.outgoing:
            app._received_s = wall_s()  # the simulator has just sent
            app._serve_lockstep()
        answers.append(hil_end.outgoing[-1])
        actuators = sea.newest()
        assert actuators is not None
        assert actuators.time_us == state.time_us
        state, sensors = plant.step(simulated, state, actuators, rng)
        if count == 50:
            _begin(vehicle, FLIGHT)
        if count % 7 == 0:
            ground.flush()
    ground.flush()
    frames = Framer().feed(b"".join(ground_end.outgoing))
    return answers, [f.payload for f in frames if f.message_id != HEARTBEAT], hil_end


def _begin(vehicle: Vehicle, items: tuple[MissionItem, ...]) -> None:
    mode = requests.SetMode(modes.MISSION.number)
    for request in (requests.LoadMission(items), mode, requests.Arm()):
        assert vehicle.handle_request(request).result == 0


@pytest.mark.slow
@pytest.mark.skipif(not jit.COMPILED, reason="there is nothing to compare without numba")
def test_answers_and_telemetry_equal_those_of_python() -> None:
    plain_answers, plain_telemetry, plain_end = _fly(compiled=False)
    answers, telemetry, hil_end = _fly(compiled=True)
    assert answers == plain_answers
    assert telemetry == plain_telemetry
    assert len(telemetry) > TICKS
    assert plain_end.read_in_place == 0
    assert hil_end.read_in_place > 0.5 * TICKS
