"""One dive: set up the vehicle, upload, arm, and record until it has disarmed itself at the
surface."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

from ground.client.recorder import Recorder
from ground.client.signing import open_signing
from ground.client.stopping import left_behind
from ground.client.vehicle import StatusText, VehicleClient, VehicleClientError
from ground.errors import Interrupted
from ground.missions import plans
from ground.simulation.processes import SimulatedVehicle
from mavlink_io.clock import Every, wall_s
from mavlink_io.codec import Frame
from mavlink_io.mission_items import MissionItem
from mavlink_io.transport import open_transport, wait

RATES_HZ = {
    "ATTITUDE": 50.0,
    "ACTUATOR_OUTPUT_STATUS": 50.0,
    "LOCAL_POSITION_NED": 10.0,
    "ATTITUDE_TARGET": 10.0,
    "POSITION_TARGET_LOCAL_NED": 10.0,
    "NAV_CONTROLLER_OUTPUT": 2.0,
}
"""What identification and reports need, a second of vehicle time; the rest comes at the vehicle's
own rate."""
PROGRESS_PERIOD_S = 0.1


class FlightProgress(NamedTuple):
    """Where a dive stands."""

    item: int
    items: int
    vehicle_s: float
    wall_s: float
    depth_m: float
    heading_deg: float


@dataclass(frozen=True)
class Dive:
    """What to fly: a mission and the parameters to set before, whoever flies it."""

    mission: str
    items: tuple[MissionItem, ...]
    log: Path
    parameters: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    tlog: Path | None = None
    labels: tuple[str, ...] = ()
    """Where each item stands in the mission's file, for errors; () for items without a file."""

    @classmethod
    def load(cls, mission: str, log: Path, **details: object) -> "Dive":
        """A dive of a mission script or file. Raises ScriptError."""
        plan = plans.load(mission)
        return cls(mission, plan.items, log, labels=plan.labels, **details)  # type: ignore[arg-type]

    @property
    def plan(self) -> plans.Plan:
        """The items with where they come from."""
        return plans.Plan(
            self.items, self.labels or tuple(f"item {n}" for n in range(len(self.items)))
        )


class FlightResult(NamedTuple):
    """What came of a dive."""

    log: Path
    vehicle_s: float
    wall_s: float
    messages: int
    lost_frames: int
    texts: tuple[str, ...]

    @property
    def failsafes(self) -> tuple[str, ...]:
        return tuple(text for text in self.texts if text.startswith("Failsafe"))


WatchCallback = Callable[[FlightProgress], None]
TextCallback = Callable[[StatusText], None]


class TelemetryListener(Protocol):
    """Whoever makes something of what the vehicle tells while she flies."""

    def begin(self, parameters: Mapping[str, float]) -> None:
        """The vehicle is about to be armed."""

    def hear(self, frame: Frame) -> None:
        """Each frame of the autopilot's."""

    def say(self, text: StatusText) -> None:
        """Each text."""

    def look(self, *, last: bool = False) -> None:
        """Often, and once at the end."""


def fly(
    dive: Dive,
    address: str,
    watch: WatchCallback | None = None,
    hear: TextCallback | None = None,
    key_file: Path | None = None,
    follower: TelemetryListener | None = None,
) -> FlightResult:
    """Fly a vehicle that is already there. Raises AddressError, BadInputError, VehicleError."""
    with open_recorded_vehicle(address, dive.log, dive.tlog, key_file) as (vehicle, recorder):
        try:
            return _fly(dive, vehicle, recorder, watch, hear, follower)
        except Interrupted as interruption:
            if state := left_behind(vehicle, address, key_file):
                interruption.add_note(state)
            raise


def fly_simulated(
    dive: Dive,
    simulated: SimulatedVehicle,
    watch: WatchCallback | None = None,
    hear: TextCallback | None = None,
    follower: TelemetryListener | None = None,
) -> FlightResult:
    """Fly a simulated vehicle and stop it. Raises BadInputError, VehicleError: with what its
    processes said."""
    with open_recorded_vehicle(simulated, dive.log, dive.tlog) as (vehicle, recorder):
        return _fly(dive, vehicle, recorder, watch, hear, follower)


@contextmanager
def open_recorded_vehicle(
    where: str | SimulatedVehicle, log: Path, tlog: Path | None = None, key_file: Path | None = None
) -> Iterator[tuple[VehicleClient, Recorder]]:
    """A vehicle at an address, or a simulated one that is stopped at the end, with all it says kept
    in ``log``.

    Raises:
        AddressError, BadInputError, VehicleError: there is no such vehicle, or it went away.
    """
    with ExitStack() as stack:
        simulated = None if isinstance(where, str) else stack.enter_context(where)
        transport = simulated.connect() if simulated else open_transport(str(where))
        stack.callback(transport.close)
        signature = stack.enter_context(open_signing(key_file))
        recorder = Recorder(log, tlog)
        stack.callback(recorder.finish)
        try:
            yield (
                VehicleClient(
                    transport, recorder, simulated.check if simulated else None, signature
                ),
                recorder,
            )
        except VehicleClientError:
            if simulated:
                raise_process_error(simulated)
            raise


def raise_process_error(simulated: SimulatedVehicle, patience_s: float = 1.0) -> None:
    """Raise what a dying process says in place of the lost link that it caused, if it dies in
    time."""
    deadline_s = wall_s() + patience_s
    while wall_s() < deadline_s:
        wait([], 0.05)
        simulated.check()


def prepare(vehicle: VehicleClient, dive: Dive) -> dict[str, float]:
    """Do everything before arming: parameters, message rates, mission, mode.

    Returns the parameters that are in force.

    Raises:
        BadInputError: the mission leaves the vehicle's limits; nothing was uploaded.
        VehicleError: the vehicle refused.
    """
    for name, value in dive.parameters.items():
        vehicle.set_parameter(name, value)
    aboard = vehicle.parameters()
    plans.check_limits(dive.mission, dive.plan, plans.Limits.from_parameters(aboard))
    for name, rate_hz in RATES_HZ.items():
        vehicle.set_interval(name, rate_hz)
    vehicle.upload(dive.items)
    vehicle.set_mode("MISSION")
    return aboard


def _fly(
    dive: Dive,
    vehicle: VehicleClient,
    recorder: Recorder,
    watch: WatchCallback | None,
    hear: TextCallback | None,
    follower: TelemetryListener | None,
) -> FlightResult:
    recorder.annotate("dive", {"mission": dive.mission, **dive.notes})
    recorder.attach("mission.plan", plans.write_plan(dive.items).encode(), "application/json")
    vehicle.connect()
    aboard = prepare(vehicle, dive)
    recorder.attach_parameters(aboard)
    if follower is not None:
        follower.begin(aboard)
        vehicle.on_frame = follower.hear
    began_s, vehicle_began_s = wall_s(), recorder.vehicle_s
    vehicle.arm()
    vehicle.on_text = _call_both(hear, follower.say if follower else None)
    _until_disarmed(vehicle, recorder, len(dive.items), began_s, watch, follower)
    return FlightResult(
        log=dive.log,
        vehicle_s=recorder.vehicle_s - vehicle_began_s,
        wall_s=wall_s() - began_s,
        messages=recorder.message_count,
        lost_frames=vehicle.lost_frames,
        texts=tuple(text.text for text in vehicle.texts),
    )


def _call_both(first: TextCallback | None, second: TextCallback | None) -> TextCallback:
    def hear(text: StatusText) -> None:
        for listener in (first, second):
            if listener is not None:
                listener(text)

    return hear


def _until_disarmed(
    vehicle: VehicleClient,
    recorder: Recorder,
    items: int,
    began_s: float,
    watch: WatchCallback | None,
    follower: TelemetryListener | None,
) -> None:
    report = Every(PROGRESS_PERIOD_S)
    while not vehicle.disarmings:
        vehicle.pump(0.05)
        if watch is not None and report.due():
            watch(_progress(vehicle, recorder, items, wall_s() - began_s))
        if follower is not None:
            follower.look()
    if follower is not None:
        follower.look(last=True)


def _progress(
    vehicle: VehicleClient, recorder: Recorder, items: int, wall: float
) -> FlightProgress:
    current = vehicle.latest("MISSION_CURRENT")
    position = vehicle.latest("LOCAL_POSITION_NED")
    attitude = vehicle.latest("ATTITUDE")
    return FlightProgress(
        item=current.seq if current else 0,
        items=items,
        vehicle_s=recorder.vehicle_s,
        wall_s=wall,
        depth_m=position.z if position else 0.0,
        heading_deg=math.degrees(attitude.yaw) % 360.0 if attitude else 0.0,
    )
