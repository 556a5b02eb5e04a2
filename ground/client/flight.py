"""Fly one dive: set parameters, upload the mission, arm, record until the vehicle has disarmed."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

from ground.client import declination
from ground.client.depth_progress import DepthProgress
from ground.client.dive_clock import STALL_TIMEOUT_S, DiveClock
from ground.client.recorder import Recorder
from ground.client.signing import open_signing
from ground.client.stopping import describe_remaining_state
from ground.client.vehicle import StatusText, VehicleClient, VehicleClientError
from ground.errors import Interrupted
from ground.missions import plans
from ground.simulation import affinity
from ground.simulation.processes import SimulatedVehicle
from mavlink_io.clock import Interval, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.errors import InputError, OperationError
from mavlink_io.mission_items import FENCE_TYPE, RALLY_TYPE, MavCmd, MissionItem
from mavlink_io.transport import open_transport, wait
from sysid.data.events import Failsafe, TrimLearned

HOME_FIRST = "MIS_SEQ0_HOME"
"""Parameter of a vehicle that takes item 0 of a mission for home."""
RATES_HZ = {
    "ATTITUDE": 50.0,
    "ACTUATOR_OUTPUT_STATUS": 50.0,
    "LOCAL_POSITION_NED": 10.0,
    "ATTITUDE_TARGET": 10.0,
    "POSITION_TARGET_LOCAL_NED": 10.0,
    "NAV_CONTROLLER_OUTPUT": 2.0,
}
"""Message rates (vehicle time) that identification and reports need; other messages keep the rate
of the vehicle."""
_FIX_3D = constant("GPS_FIX_TYPE_3D_FIX")
_MISSION_COMPLETE = constant("MISSION_STATE_COMPLETE")
_LEAVING_MISSION = MavCmd.NAV_LAND, MavCmd.NAV_RETURN_TO_LAUNCH
"""Steps at which the vehicle leaves mode MISSION, for SURFACE and for RTL."""
PROGRESS_PERIOD_S = 0.1
"""Wall time between reports of progress."""
PROCESS_END_S = 1.0
"""Wall time after the loss of a link in which a simulation process may end."""


class FlightProgress(NamedTuple):
    """Progress of a dive."""

    item: int
    """Index of the current mission item."""
    items: int
    """Number of mission items."""
    vehicle_s: float
    """Vehicle time since the start of the dive."""
    wall_s: float
    """Wall time since the start of the dive."""
    depth_m: float
    heading_deg: float
    warning: str = ""
    """What the user should look at; empty without any trouble."""
    place: str = ""
    """Place of the item in the mission file, such as `step 2 of 3`; empty without such a file."""


@dataclass(frozen=True)
class Dive:
    """A mission with the parameters to set before it, for a real or a simulated vehicle."""

    mission: str
    items: tuple[MissionItem, ...]
    log: Path
    parameters: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    tlog: Path | None = None
    labels: tuple[str, ...] = ()
    """Place of each item in the mission file, for error messages; empty without a file."""
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    """Geofence and rally points of the mission file."""
    system: int | None = None
    """System id of the vehicle, where several are on the link; None for the first one."""

    @classmethod
    def load(cls, mission: str, log: Path, **details: object) -> "Dive":
        """Return a dive of a shipped mission or a mission file.

        Parameters
        ----------
        mission : str
            Name of a shipped mission, or path of a mission file.
        log : Path
            File for the log of the dive.
        **details : object
            Further fields of the record, by name.

        Returns
        -------
        Dive
            Dive with the items and labels of the mission, its geofence and its rally points.

        Raises
        ------
        ScriptError
            There is no such mission, or it is invalid.
        """
        plan = plans.load(mission)
        return cls(
            mission,
            plan.items,
            log,
            labels=plan.labels,
            fence=plan.fence,
            rally=plan.rally,
            **details,  # type: ignore[arg-type]
        )

    @property
    def plan(self) -> plans.Plan:
        """The items with their places in the mission file."""
        labels = self.labels or tuple(f"item {n}" for n in range(len(self.items)))
        return plans.Plan(self.items, labels, self.fence, self.rally)


class FlightResult(NamedTuple):
    """Result of a dive."""

    log: Path
    vehicle_s: float
    wall_s: float
    messages: int
    lost_frames: int
    texts: tuple[str, ...]
    failsafes: tuple[str, ...]
    """Failsafes of the dive."""
    trims_learned: str
    """Trims that the vehicle learned during the dive; empty without any."""


WatchCallback = Callable[[FlightProgress], None]
TextCallback = Callable[[StatusText], None]


class TelemetryListener(Protocol):
    """Receiver of the telemetry during a dive."""

    def begin(self, parameters: Mapping[str, float]) -> None:
        """Receive the vehicle's parameters, just before it is armed."""

    def on_frame(self, frame: Frame) -> None:
        """Receive a frame of the autopilot; the first ones come before `begin`."""

    def on_text(self, text: StatusText) -> None:
        """Receive a text of the vehicle."""

    def poll(self, *, last: bool = False) -> None:
        """Update; called about 20 times a second, and with `last` once at the end."""


def fly(
    dive: Dive,
    address: str,
    on_progress: WatchCallback | None = None,
    on_text: TextCallback | None = None,
    key_file: Path | None = None,
    listener: TelemetryListener | None = None,
    on_remark: Callable[[str], None] | None = None,
) -> FlightResult:
    """Fly the vehicle at an address and record the dive.

    If the dive ends otherwise than at the surface, because the user interrupts, the link is lost or
    the log cannot be written, the state of the vehicle is added to the exception as a note.

    Parameters
    ----------
    dive : Dive
        Mission, parameters and log files of the dive.
    address : str
        Address of the vehicle.
    on_progress : WatchCallback, optional
        Receives the progress of the mission.
    on_text : TextCallback, optional
        Receives the texts of the vehicle.
    key_file : Path, optional
        Key with which the link is signed.
    listener : TelemetryListener, optional
        Receives the telemetry.
    on_remark : Callable, optional
        Receives what is awaited before the dive, the vehicle or its sensors, and a declination of
        another place.

    Returns
    -------
    FlightResult
        Outcome of the mission.

    Raises
    ------
    AddressError, InputError, VehicleClientError
        The address, key or mission cannot be used; or the vehicle was not found, refused or was
        lost.
    """
    with open_recorded_vehicle(
        address,
        dive.log,
        tlog=dive.tlog,
        key_file=key_file,
        system=dive.system,
        on_remark=on_remark,
    ) as (vehicle, recorder):
        try:
            return _fly(dive, vehicle, recorder, on_progress, on_text, listener)
        except (Interrupted, OperationError, OSError) as end:
            if state := describe_remaining_state(vehicle, address, key_file):
                end.add_note(state)
            if isinstance(end, Interrupted):
                end.under_way = vehicle.armed or vehicle.arm_requested
            raise


def fly_simulated(
    dive: Dive,
    simulated: SimulatedVehicle,
    on_progress: WatchCallback | None = None,
    on_text: TextCallback | None = None,
    listener: TelemetryListener | None = None,
) -> FlightResult:
    """Fly a simulated vehicle, record the dive and stop the simulation.

    Parameters
    ----------
    dive : Dive
        Mission, parameters and log files of the dive.
    simulated : SimulatedVehicle
        Simulator and autopilot that are to be started.
    on_progress : WatchCallback, optional
        Receives the progress of the mission.
    on_text : TextCallback, optional
        Receives the texts of the vehicle.
    listener : TelemetryListener, optional
        Receives the telemetry.

    Returns
    -------
    FlightResult
        Outcome of the mission.

    Raises
    ------
    InputError, VehicleClientError
        With the error message of the simulator or the autopilot, if one of them failed.
    OperationError
        The vehicle waits for a depth that it does not reach.
    """
    with open_recorded_vehicle(simulated, dive.log, dive.tlog) as (vehicle, recorder):
        return _fly(dive, vehicle, recorder, on_progress, on_text, listener)


@contextmanager
def open_recorded_vehicle(
    target: str | SimulatedVehicle,
    log: Path,
    tlog: Path | None = None,
    key_file: Path | None = None,
    system: int | None = None,
    on_remark: Callable[[str], None] | None = None,
) -> Iterator[tuple[VehicleClient, Recorder]]:
    """Open a link to a vehicle and record all its frames; close both at the end.

    Log files of a vehicle that this program has not armed are removed: no dive was recorded. The
    repeated or corrected command then finds their names free.

    Parameters
    ----------
    target : str or SimulatedVehicle
        Address of a vehicle, or a simulated vehicle, which is stopped at the end.
    log, tlog : Path
        MCAP log, and optionally a telemetry log, to write.
    key_file : Path, optional
        Key with which the link is signed.
    system : int, optional
        System id of the vehicle, where several are on the link.
    on_remark : Callable, optional
        Receives what is awaited before the dive, the vehicle or its sensors, and a declination of
        another place.

    Raises
    ------
    AddressError, InputError, VehicleClientError
        The address or key cannot be used, or the vehicle was not found or lost.
    """
    with ExitStack() as stack:
        simulated = None if isinstance(target, str) else stack.enter_context(target)
        transport = simulated.connect() if simulated else open_transport(str(target))
        stack.callback(transport.close)
        if simulated:
            stack.enter_context(affinity.restrict_to_free_cores())
        signature = stack.enter_context(open_signing(key_file))
        recorder = Recorder(log, tlog)
        vehicle = VehicleClient(
            transport, recorder, simulated.check if simulated else None, signature, system
        )
        stack.callback(_remove_without_dive, vehicle, recorder, simulated)
        stack.callback(recorder.finish)
        vehicle.on_remark = on_remark
        try:
            yield vehicle, recorder
        except VehicleClientError:
            if simulated:
                _raise_process_error(simulated)
            raise


def _remove_without_dive(
    vehicle: VehicleClient, recorder: Recorder, simulated: SimulatedVehicle | None
) -> None:
    """Remove the files of a finished recorder if this program has not armed the vehicle."""
    if not (vehicle.arm_requested or vehicle.disarmings):
        recorder.remove()
        if simulated:
            simulated.remove_truth()


def _raise_process_error(simulated: SimulatedVehicle) -> None:
    """Raise the error of a simulation process that ends within `PROCESS_END_S`.

    It replaces the less useful error of the link that was lost because the process ended.
    """
    deadline_s = wall_s() + PROCESS_END_S
    while wall_s() < deadline_s:
        wait([], 0.05)
        simulated.check()


def prepare(vehicle: VehicleClient, dive: Dive) -> dict[str, float]:
    """Set parameters, message rates, plans and mode; return the parameters of the vehicle.

    Nothing is set if the vehicle is armed or the mission exceeds a limit. A geofence and rally
    points of the file come first: the vehicle checks the mission with them. Without any in the file
    those of the vehicle stay.

    Raises
    ------
    InputError
        The mission exceeds limits of the vehicle, or the vehicle would not fly its first step.
    VehicleClientError
        The vehicle is armed, or refused.
    """
    if vehicle.armed:
        with suppress(VehicleClientError):  # the error then shows the number of the mode
            vehicle.offered_modes()
        raise VehicleClientError(f"the vehicle is already armed, in mode {vehicle.mode}")
    parameters = {**vehicle.parameters(), **dive.parameters}
    if parameters.get(HOME_FIRST):
        raise InputError(
            f"{HOME_FIRST} = 1 on the vehicle: it takes the first step for home and skips it;"
            f" for missions of ground: ground params set {HOME_FIRST} 0"
        )
    plans.check_limits(dive.mission, dive.plan, plans.MissionLimits.from_parameters(parameters))
    for name, value in dive.parameters.items():
        parameters[name] = vehicle.set_parameter(name, value)
    for name, rate_hz in RATES_HZ.items():
        vehicle.set_interval(name, rate_hz)
    for items, kind in ((dive.plan.fence, FENCE_TYPE), (dive.plan.rally, RALLY_TYPE)):
        if items:
            vehicle.upload(items, kind)
    vehicle.upload(dive.items)
    vehicle.set_mode("MISSION")
    return parameters


def _fly(
    dive: Dive,
    vehicle: VehicleClient,
    recorder: Recorder,
    on_progress: WatchCallback | None,
    on_text: TextCallback | None,
    listener: TelemetryListener | None,
) -> FlightResult:
    """Fly a dive with an open link."""
    recorder.annotate("dive", {"mission": dive.mission, **dive.notes})
    plan = plans.write_plan(dive.items, dive.plan.fence, dive.plan.rally)
    recorder.attach("mission.plan", plan.encode(), "application/json")
    vehicle.connect()
    if listener is not None:
        vehicle.on_frame = listener.on_frame
    vehicle.wait_until_started()
    parameters = prepare(vehicle, dive)
    _remark_declination(vehicle, parameters)
    recorder.attach_parameters(parameters)
    if listener is not None:
        listener.begin(parameters)
    assert vehicle.vehicle_id is not None, "connect has found the vehicle"
    clock = DiveClock(
        recorder, vehicle.vehicle_id.system, timeout_s=vehicle.link_timeout_s(STALL_TIMEOUT_S)
    )
    vehicle.arm(timeout_s=0.0)  # it has been waited for above
    vehicle.on_text = _call_both(on_text, listener.on_text if listener else None)
    _until_disarmed(vehicle, clock, dive, on_progress, listener)
    return FlightResult(
        log=dive.log,
        vehicle_s=clock.vehicle_s,
        wall_s=clock.wall_s,
        messages=recorder.message_count,
        lost_frames=vehicle.lost_frames,
        texts=tuple(text.text for text in vehicle.texts),
        failsafes=_failsafes(vehicle, dive.items),
        trims_learned=next(
            (event.text for event in vehicle.events() if isinstance(event, TrimLearned)), ""
        ),
    )


def _remark_declination(vehicle: VehicleClient, parameters: Mapping[str, float]) -> None:
    """Remark a declination of another place, if the vehicle has a position."""
    fix = vehicle.latest("GPS_RAW_INT")
    if vehicle.on_remark is None or fix is None or fix.fix_type < _FIX_3D:
        return
    if text := declination.remark(parameters, 1e-7 * fix.lat, 1e-7 * fix.lon):
        vehicle.on_remark(text)


def _failsafes(vehicle: VehicleClient, items: Sequence[MissionItem]) -> tuple[str, ...]:
    """Return the texts of the failsafes.

    If the text was lost: a vehicle in a critical state that left the mission before its end. A
    vehicle with a faulty sensor reports that state too, and leaves mode MISSION at the last step.
    """
    texts = tuple(event.text for event in vehicle.events() if isinstance(event, Failsafe))
    progress = vehicle.latest("MISSION_CURRENT")
    ended = progress is not None and (
        progress.mission_state == _MISSION_COMPLETE
        or any(item.command in _LEAVING_MISSION for item in items if item.sequence == progress.seq)
    )
    if texts or ended or not vehicle.critical_mode:
        return texts
    return (f"mission left for mode {vehicle.critical_mode} in a critical state",)


def _call_both(first: TextCallback | None, second: TextCallback | None) -> TextCallback:
    """Return a callback that passes each text to both callbacks."""

    def call(text: StatusText) -> None:
        for listener in (first, second):
            if listener is not None:
                listener(text)

    return call


def _until_disarmed(
    vehicle: VehicleClient,
    clock: DiveClock,
    dive: Dive,
    on_progress: WatchCallback | None,
    listener: TelemetryListener | None,
) -> None:
    """Receive until the vehicle has disarmed.

    Raises VehicleClientError if vehicle time stalls, and OperationError if a simulated vehicle
    waits for a depth that it does not reach. A real one is recorded until it is recovered.
    """
    places = dive.plan.places
    report, depth = Interval(PROGRESS_PERIOD_S), DepthProgress(dive.plan, dive.log)
    while not vehicle.disarmings:
        vehicle.pump(0.05)
        clock.update()
        if report.due():
            if vehicle.is_simulated:
                depth.update(vehicle, clock.vehicle_s)
            if on_progress is not None:
                on_progress(_progress(vehicle, clock, places))
        if listener is not None:
            listener.poll()
    if listener is not None:
        listener.poll(last=True)


def _progress(vehicle: VehicleClient, clock: DiveClock, places: Sequence[str]) -> FlightProgress:
    """Return the progress according to the last messages; `places` are those of the items."""
    current = vehicle.latest("MISSION_CURRENT")
    item = min(current.seq, len(places) - 1) if current else 0
    position = vehicle.latest("LOCAL_POSITION_NED")
    attitude = vehicle.latest("ATTITUDE")
    return FlightProgress(
        item=item,
        items=len(places),
        place=places[item],
        vehicle_s=clock.vehicle_s,
        wall_s=clock.wall_s,
        depth_m=position.z if position else 0.0,
        heading_deg=math.degrees(attitude.yaw) % 360.0 if attitude else 0.0,
        warning=clock.warning,
    )
