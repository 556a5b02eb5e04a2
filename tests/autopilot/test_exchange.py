"""Samples that compiled code answers: the same answers and telemetry as those of Python."""

import itertools
import socket
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

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
from mavlink_io.transport import Handle, Transport, UdpTransport
from mavlink_io.transport.base import readable
from sitl import scenario
from sitl.backends.hil import HilClient
from sitl.core import plant, truth
from sitl.vehicle import config
from tests.helpers.missions import excitation_item, leg

TICKS, DEPARTURE = 800, 50
"""Number of ticks, and the one after which the mission begins."""
HEARTBEAT = dialect.by_name("HEARTBEAT").message_id
FLIGHT = (
    *leg(depth_m=3.0, heading_deg=40.0, duration_s=6.0),
    excitation_item(4, axis=12, magnitude_deg=4.0, duration_s=5, wave=0)._replace(p3=0.1, p4=0.5),
    *leg(depth_m=2.0, heading_deg=0.0, duration_s=30.0, first=5),
)


class Pipe:
    """One end of a link in memory."""

    def __init__(self, address: str, incoming: deque[bytes], outgoing: deque[bytes]) -> None:
        self.address, self.incoming, self.outgoing = address, incoming, outgoing

    def handles(self) -> Sequence[Handle]:
        return ()

    def send(self, data: bytes) -> None:
        self.outgoing.append(data)

    def receive(self) -> bytes:
        return self.incoming.popleft() if self.incoming else b""

    def close(self) -> None:
        pass


class Counting(UdpTransport):
    """A transport that counts the datagrams of Python."""

    sends = 0

    def send(self, data: bytes) -> None:
        self.sends += 1
        super().send(data)


class Rig:
    """An autopilot with a HIL link and a ground link that keeps what it is given."""

    def __init__(self, hil_end: Transport, *, compiled: bool) -> None:
        self._told = deque[bytes]()
        ground_end = Pipe("tcpin:127.0.0.1:9", deque(), self._told)
        self.vehicle = Vehicle(ParamTable({}), compiled=compiled)
        onboard_log = OnboardLog(self.vehicle, None)
        self._ground = GroundServer(
            self.vehicle, [ground_end], AutopilotId.GENERIC, onboard_log=onboard_log
        )
        self._app = App(self.vehicle, HilLink(hil_end, 1), self._ground, onboard_log)

    def serve(self) -> None:
        """Answer a simulator that has just sent."""
        self._app._received_s = wall_s()
        self._app._serve_lockstep()
        self._ground.flush()

    def telemetry(self) -> list[bytes]:
        """Return the payloads of all messages but heartbeats."""
        frames = Framer().feed(b"".join(self._told))
        return [frame.payload for frame in frames if frame.message_id != HEARTBEAT]


class Flown(NamedTuple):
    """What an autopilot has received and sent."""

    samples: list[bytes]
    answers: list[bytes]
    telemetry: list[bytes]


def _fly() -> Flown:
    """Fly a dive in the disturbed sea without compiled code."""
    to_autopilot, to_sea = deque[bytes](), deque[bytes]()
    rig = Rig(Pipe("udpin:127.0.0.1:9", to_autopilot, to_sea), compiled=False)
    sea = HilClient(Pipe("udpout:127.0.0.1:9", to_sea, to_autopilot))
    simulated = plant.build(config.load("caribou_truth"), scenario.load("disturbed"))
    rng = plant.random_streams(1)
    state, sensors = plant.initial_state(simulated, rng)
    samples: list[bytes] = []
    answers: list[bytes] = []
    for count in range(TICKS):
        frame = truth.to_frame(state.truth, 42.0, -71.0) if state.time_us % 100_000 == 0 else None
        samples.append(sea.datagram(sensors, frame, state.faults.changes))
        sea.send(samples[-1])
        while not to_sea:
            rig.serve()
        answers.append(to_sea[-1])
        actuators = sea.newest()
        assert actuators is not None
        assert actuators.time_us == state.time_us
        state, sensors = plant.step(simulated, state, actuators, rng)
        if count == DEPARTURE:
            _begin(rig.vehicle, FLIGHT)
    return Flown(samples, answers, rig.telemetry())


def _replay(samples: Sequence[bytes], *, stranger_at: int | None = None) -> tuple[Flown, int]:
    """Send the samples of a dive to an autopilot with compiled code, many at a time.

    Return the number of answers of Python too. A stranger sends to the HIL port once.
    """
    hil_end = Counting("udpin", "127.0.0.1", 0)
    rig = Rig(hil_end, compiled=True)
    answers: list[bytes] = []
    sizes = itertools.cycle((1, 9, 4, 60, 2))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sea:
        sea.settimeout(10.0)
        sea.connect(hil_end.handles()[0].getsockname())
        while len(answers) < len(samples):
            first = len(answers)
            stop = first + next(sizes) if first > DEPARTURE else first + 1
            if stranger_at is not None and first <= stranger_at < stop:
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                    stranger.sendto(b"no MAVLink", sea.getpeername())
            for sample in samples[first:stop]:
                sea.send(sample)
            for _ in samples[first:stop]:
                while not readable(sea):
                    rig.serve()
                answers.append(sea.recv(65_535))
            if first == DEPARTURE:
                _begin(rig.vehicle, FLIGHT)
    hil_end.close()
    return Flown(list(samples), answers, rig.telemetry()), hil_end.sends


def _begin(vehicle: Vehicle, items: tuple[MissionItem, ...]) -> None:
    mode = requests.SetMode(modes.MISSION.number)
    for request in (requests.LoadMission(items), mode, requests.Arm()):
        assert vehicle.handle_request(request).result == 0


@pytest.fixture(scope="module")
def plain() -> Flown:
    """Return a dive without compiled code."""
    return _fly()


@pytest.mark.slow
@pytest.mark.skipif(not jit.COMPILED, reason="there is nothing to compare without numba")
def test_answers_and_telemetry_equal_those_of_python(plain: Flown) -> None:
    flown, python_answers = _replay(plain.samples)
    assert flown.answers == plain.answers
    assert flown.telemetry == plain.telemetry
    assert len(flown.telemetry) > TICKS
    assert python_answers < 0.4 * TICKS


@pytest.mark.slow
@pytest.mark.skipif(not jit.COMPILED, reason="there is nothing to compare without numba")
def test_stranger_on_the_hil_port_changes_no_answer(plain: Flown) -> None:
    flown, python_answers = _replay(plain.samples, stranger_at=300)
    assert flown.answers == plain.answers
    assert flown.telemetry == plain.telemetry
    assert python_answers > 0.4 * TICKS, "with two peers Python answers"
