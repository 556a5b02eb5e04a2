"""Client of one MAVLink vehicle: connection, parameters, missions, modes, commands and recording.

There is one receive loop, `VehicleClient.pump`. Every request calls it while it waits for its
answer, so that all frames are recorded at all times.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ground.client import commands, connection_diagnosis
from ground.client.commands import CommandExchange, ModeList
from ground.client.recorder import Recorder
from ground.client.signing import open_signing
from ground.live.watch import mode_names
from mavlink_io import dialect
from mavlink_io.clock import Interval, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.errors import ErrorCode, OperationError
from mavlink_io.logging.statustext import TextJoiner
from mavlink_io.mission_items import MISSION_TYPE, MavCmd, MissionItem
from mavlink_io.param_bytes import PX4
from mavlink_io.records import ARMED_FLAG, CUSTOM_MODE_FLAG
from mavlink_io.request import Exchange, ExchangeError, MavlinkId
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient, ParamRequest
from mavlink_io.signing import Signing
from mavlink_io.suggestions import did_you_mean
from mavlink_io.transport import LinkLostError, Transport, open_transport, wait
from mavlink_io.vehicle_modes import from_high_latency
from sysid.data.events import VehicleEvent, parse_text

T = TypeVar("T")
C = TypeVar("C")

GROUND = MavlinkId(250, constant("MAV_COMP_ID_MISSIONPLANNER"))
"""System and component of the ground software. Not 255/190: MAVSDK ignores frames of that id."""
HEARTBEAT_PERIOD_S = 1.0
"""Wall time between our heartbeats."""
WATCHDOG_PERIOD_S = 0.2
"""Wall time between calls of the watchdog."""
READY_TIMEOUT_S = 60.0
"""Maximum wall time (s) in which a vehicle may reach MAV_STATE_STANDBY before it is armed."""
SIMULATED_READY_TIMEOUT_S = 300.0
"""The same limit for a simulated vehicle, whose processes are monitored: on a new or busy machine
the simulator may compile its numeric code for minutes before the first sensor sample."""
WAIT_NOTICE_S = 2.0
"""Wall time (s) after which the client reports what it waits for."""
ARM_RETRY_S, ARM_RETRY_PERIOD_S = 15.0, 1.0
"""Wall time in which arming is retried after a temporary refusal, and the time between retries."""
MODEM_ATTEMPTS = 10
"""Number of times that a request is sent over a modem, and number of its retry times without a
message after which a vehicle counts as lost."""
HEARTBEAT_TIMEOUT_S = 5.0
"""Wall time without a heartbeat after which a vehicle counts as lost."""
SIMULATED_HEARTBEAT_TIMEOUT_S = 60.0
"""The same limit for a simulated vehicle: the watchdog reports a process that has ended at once, so
silence means that the machine is overloaded."""
SIMULATED_ATTEMPTS = 60
"""Number of times that a request is sent to a simulated vehicle, about one a second: as for its
heartbeats, silence means that the machine is overloaded."""
MAX_PUMP_S = 1.0
"""Longest time between two calls of `pump` that counts as listening. A longer one is a pause of
this program or of the whole machine, which may have paused the vehicle's link too."""
MAX_UNASSIGNED = 5000
"""Largest number of frames that are kept until a vehicle is selected: ten seconds of one at full
rate."""
MAX_REASONS = 5
"""Maximum number of texts of the vehicle in an error: the last ones during the request."""
_STANDBY = constant("MAV_STATE_STANDBY")
_CRITICAL = constant("MAV_STATE_CRITICAL"), constant("MAV_STATE_EMERGENCY")
_PREARM = constant("MAV_SYS_STATUS_PREARM_CHECK")
_HEARTBEAT = constant("MAVLINK_MSG_ID_HEARTBEAT")
_STATUSTEXT = constant("MAVLINK_MSG_ID_STATUSTEXT")
_SYS_STATUS = constant("MAVLINK_MSG_ID_SYS_STATUS")
_HIGH_LATENCY = dialect.by_name("HIGH_LATENCY2")


class VehicleClientError(OperationError):
    """The vehicle was not found, was lost or refused a request; the message gives the reason."""

    code = ErrorCode.VEHICLE


class CommandRefusedError(VehicleClientError):
    """The vehicle refused a command; `result` is its MAV_RESULT."""

    code = ErrorCode.COMMAND_REFUSED

    def __init__(self, reason: str, result: int) -> None:
        super().__init__(reason)
        self.result = result


class StatusText(NamedTuple):
    """A complete text of the vehicle, assembled from its STATUSTEXT chunks."""

    severity: int
    """MAV_SEVERITY: 0 emergency to 7 debug."""
    text: str

    @property
    def event(self) -> VehicleEvent:
        """The text as a typed value."""
        return parse_text(self.severity, self.text)


class VehicleClient:
    """Connection to one vehicle. Methods raise VehicleClientError if it is lost or refuses."""

    def __init__(
        self,
        transport: Transport,
        recorder: Recorder | None = None,
        watchdog: Callable[[], None] | None = None,
        signing: Signing | None = None,
        system: int | None = None,
        modem_s: float | None = None,
    ) -> None:
        """Take over a transport; `connect` finds the vehicle on it.

        Parameters
        ----------
        transport : Transport
            Link to the vehicle; `close` closes it.
        recorder : Recorder, optional
            Records every received frame.
        watchdog : Callable, optional
            Called every `WATCHDOG_PERIOD_S` of wall time; raises if a process of a simulated
            vehicle has failed.
        signing : Signing, optional
            Signs every sent frame.
        system : int, optional
            System id of the vehicle, where several are on the link; default: the first one.
        modem_s : float, optional
            Time after which requests over a modem are repeated (s); None for a link that is none.
        """
        self._system, self._modem_s = system, modem_s
        self._others: set[int] = set()
        """Other systems that were received before the vehicle was found."""
        self._unassigned: deque[Frame] = deque(maxlen=MAX_UNASSIGNED)
        """Last frames that were received before a vehicle was selected, of all systems."""
        self._endpoint = Endpoint(transport, *GROUND, signing)
        self._recorder = recorder
        self._watchdog = watchdog
        self._heartbeat = Interval(max(HEARTBEAT_PERIOD_S, modem_s or 0.0))
        self._check = Interval(WATCHDOG_PERIOD_S)
        self._heartbeat_received_s = self._pumped_s = wall_s()
        self._latest: dict[int, Frame] = {}
        self._modes: dict[str, int] = {}
        self._listener: Callable[[Frame], None] | None = None
        self.on_text: Callable[[StatusText], None] | None = None
        self.on_frame: Callable[[Frame], None] | None = None
        """Called with each frame that the autopilot itself sends."""
        self.on_remark: Callable[[str], None] | None = None
        """Called with what is awaited, when it has not come within `WAIT_NOTICE_S`, and with what
        the user should know before a dive."""
        self.vehicle_id: MavlinkId | None = None
        """System and component of the autopilot; None until it is found."""
        self._status = 0
        self._own_status: Frame | None = None
        """Newest SYS_STATUS of the autopilot itself; other components send that message too."""
        self.kind = 0
        """MAV_TYPE of the last HEARTBEAT."""
        self.armed = False
        self.arm_requested = False
        """True after a request to arm that was not refused: the vehicle may already be armed."""
        self.heartbeats = 0
        """Number of HEARTBEATs received from the vehicle."""
        self._last_heartbeat: Any = None
        self.disarmings = 0
        """Number of changes from armed to disarmed."""
        self.critical_mode = ""
        """Mode other than MISSION in which the armed vehicle reports MAV_STATE_CRITICAL or
        MAV_STATE_EMERGENCY; empty if its last HEARTBEAT was another one. A failsafe stays in force
        until the vehicle is disarmed; a fault of a sensor may end before that."""
        self.texts: list[StatusText] = []
        self._joiner = TextJoiner()

    @property
    def is_simulated(self) -> bool:
        """Whether this program has started the vehicle."""
        return self._watchdog is not None

    @property
    def lost_frames(self) -> int:
        """Number of frames that were lost, counted by gaps in the sequence numbers."""
        return self._endpoint.lost_frames

    @property
    def custom_mode(self) -> int:
        """`custom_mode` of the last HEARTBEAT; 0 before the first one."""
        return 0 if self._last_heartbeat is None else int(self._last_heartbeat.custom_mode)

    @property
    def mode(self) -> str:
        """Name of the mode in the last HEARTBEAT, as the vehicle lists it if `modes` was called."""
        if self._last_heartbeat is None:
            return "unknown"
        return mode_names.name(
            self._last_heartbeat, {number: name for name, number in self._modes.items()}
        )

    def events(self) -> Iterator[VehicleEvent]:
        """Yield the texts of the vehicle as typed values."""
        return (text.event for text in self.texts)

    def connect(self, timeout_s: float = 30.0) -> None:
        """Wait for the HEARTBEAT of an autopilot, for at most `timeout_s` of wall time.

        Over a modem HIGH_LATENCY2 is awaited, at least for `link_timeout_s`.
        """
        timeout_s = self.link_timeout_s(timeout_s)
        deadline_s = wall_s() + timeout_s
        notice_s = wall_s() + WAIT_NOTICE_S
        while True:
            self._heartbeat_received_s = wall_s()
            is_all = self.pump(0.05)
            if self.vehicle_id is not None:
                return
            if is_all and wall_s() > deadline_s:
                raise VehicleClientError(self._not_found(timeout_s))
            if wall_s() > notice_s:
                notice_s = math.inf
                address = self._endpoint.transport.address
                self._report_wait(f"a vehicle on {address}", timeout_s)

    def pump(self, timeout_s: float) -> bool:
        """Receive and record the frames that have arrived; send our heartbeat if it is due.

        Parameters
        ----------
        timeout_s : float
            Maximum wall time to wait for the first frame.

        Returns
        -------
        bool
            True if nothing is left unread. The heartbeat timeout is checked only then: after a
            pause of this process, frames that arrived in time may still wait in the socket. The
            pause itself counts as `MAX_PUMP_S` of silence.

        Raises
        ------
        VehicleClientError
            The link is closed, or no HEARTBEAT came within `HEARTBEAT_TIMEOUT_S`, or the longer
            time of `link_timeout_s`.
        """
        transport = self._endpoint.transport
        try:
            if self._heartbeat.due():
                self._send_heartbeat()
            wait([transport], timeout_s)
            frames, is_all = connection_diagnosis.receive_all(self._endpoint)
        except LinkLostError as error:
            raise VehicleClientError(f"the vehicle is gone: {error}") from None
        self._leave_out_pause()
        self._process(frames)
        if self._watchdog is not None and self._check.due():
            self._watchdog()
        if self._recorder is not None:
            self._recorder.flush_when_due()
        timeout_s = self.link_timeout_s(HEARTBEAT_TIMEOUT_S)
        if is_all and wall_s() - self._heartbeat_received_s > timeout_s:
            raise VehicleClientError(
                f"the vehicle is gone: no heartbeat on {transport.address} for {timeout_s:g} s"
                + self._modem_advice()
            )
        return is_all

    def _modem_advice(self) -> str:
        """Return what to do if the vehicle sends over a modem and this program does not wait."""
        sends_rarely = _HIGH_LATENCY.message_id in self._latest and _HEARTBEAT not in self._latest
        if self._modem_s is None and sends_rarely:
            return " (HIGH_LATENCY2 was received: a modem needs --modem SECONDS)"
        return ""

    def link_timeout_s(self, default_s: float) -> float:
        """Return a time limit: at least the default.

        Over a modem it is at least ten times its retry time, for a simulated vehicle at least
        `SIMULATED_HEARTBEAT_TIMEOUT_S`.
        """
        simulated_s = 0.0 if self._watchdog is None else SIMULATED_HEARTBEAT_TIMEOUT_S
        return max(default_s, simulated_s, MODEM_ATTEMPTS * (self._modem_s or 0.0))

    def _leave_out_pause(self) -> None:
        """Count a pause since the last call of `pump` as `MAX_PUMP_S` of silence."""
        now_s = wall_s()
        pause_s = max(0.0, now_s - self._pumped_s - MAX_PUMP_S)
        self._heartbeat_received_s = min(now_s, self._heartbeat_received_s + pause_s)
        self._pumped_s = now_s

    def latest(self, name: str) -> Any | None:
        """Return the newest message of a name, decoded; None before the first one."""
        frame = self._latest.get(dialect.by_name(name).message_id)
        return None if frame is None else frame.decode()

    def parameters(self) -> dict[str, float]:
        """Return all parameters of the vehicle by name."""
        return self._run(self._params.list())

    def parameter(self, name: str) -> float:
        """Return the value of one parameter."""
        return self._request_param(self._params.get(name), name)

    def set_parameter(self, name: str, value: float) -> float:
        """Set a parameter; return the value that the vehicle reports back."""
        return self._request_param(self._params.set(name, value), name)

    def upload(self, items: Sequence[MissionItem], mission_type: int = MISSION_TYPE) -> None:
        """Replace the mission, the geofence or the rally points on the vehicle."""
        self._run(self._client(MissionClient).upload(items, mission_type))

    def download(self) -> tuple[MissionItem, ...]:
        """Return the mission on the vehicle."""
        return self._run(self._client(MissionClient).download())

    def modes(self) -> dict[str, int]:
        """Return the `custom_mode` of each mode that the vehicle lists, by name."""
        if not self._modes:
            self._modes = self._run(ModeList(self._endpoint.send, GROUND, self._peer))
        return self._modes

    def offered_modes(self) -> dict[str, int]:
        """Return `modes`, or the known modes of its type if the vehicle does not list them."""
        try:
            return self.modes()
        except VehicleClientError:
            self._modes = (
                {} if self._last_heartbeat is None else mode_names.known(self._last_heartbeat)
            )
            if not self._modes:
                raise
            return self._modes

    def set_mode(self, name: str) -> None:
        """Set a mode by the name that the vehicle lists."""
        modes = self.offered_modes()
        if name not in modes:
            raise VehicleClientError(
                f"mode {name}: the vehicle offers {', '.join(sorted(modes))}"
                f"{did_you_mean(name, modes)}"
            )
        self.command(MavCmd.DO_SET_MODE, 1.0, float(modes[name]))

    def set_interval(self, name: str, rate_hz: float) -> None:
        """Request a message at `rate_hz` (vehicle time)."""
        self.command(MavCmd.SET_MESSAGE_INTERVAL, dialect.by_name(name).message_id, 1e6 / rate_hz)

    def wait_until_started(self, timeout_s: float | None = None) -> None:
        """Wait until the vehicle has reached MAV_STATE_STANDBY: its sensors are read.

        Parameters
        ----------
        timeout_s : float, optional
            Maximum wall time (s). The default is `READY_TIMEOUT_S`, for a simulated vehicle
            `SIMULATED_READY_TIMEOUT_S`. When it has passed, the vehicle gives the reason itself:
            it refuses to arm.
        """
        if timeout_s is None:
            timeout_s = READY_TIMEOUT_S if self._watchdog is None else SIMULATED_READY_TIMEOUT_S

        def has_started() -> bool:
            """Return whether the vehicle reads its sensors."""
            return self._status >= _STANDBY

        if timeout_s <= WAIT_NOTICE_S:
            self.pump_until(has_started, timeout_s)
        elif not self.pump_until(has_started, WAIT_NOTICE_S):
            self._report_wait("the vehicle to read its sensors", timeout_s)
            self.pump_until(has_started, timeout_s - WAIT_NOTICE_S)

    def arm(self, timeout_s: float | None = None) -> None:
        """Arm as soon as the vehicle is ready.

        Parameters
        ----------
        timeout_s : float, optional
            Maximum wall time (s) of `wait_until_started`.

        Raises
        ------
        CommandRefusedError
            The refusal is permanent; or the vehicle refused twice while it reported that its
            pre-arm checks pass; or a temporary refusal lasted for `ARM_RETRY_S`.
        """
        self.wait_until_started(timeout_s)
        deadline_s, passed = wall_s() + ARM_RETRY_S, False
        while True:
            self.arm_requested = True
            try:
                self.command(MavCmd.COMPONENT_ARM_DISARM, 1.0)
                return
            except CommandRefusedError as refusal:
                self.arm_requested = False
                if refusal.result != commands.TEMPORARILY_REJECTED or wall_s() > deadline_s:
                    raise
                # The checks may have passed since the refusal, so try once more.
                passed_before, passed = passed, bool(self._passes_prearm())
                if passed and passed_before:
                    raise
                if not passed:
                    self._wait_for_prearm(deadline_s)

    def disarm(self, *, force: bool = False) -> None:
        """Disarm; with `force` also under way (param2 of MAV_CMD_COMPONENT_ARM_DISARM)."""
        self.command(MavCmd.COMPONENT_ARM_DISARM, 0.0, 21196.0 if force else 0.0)

    def command(self, command: int, *parameters: float) -> None:
        """Send a command and wait until it is done.

        Raises CommandRefusedError, VehicleClientError.
        """
        exchange = CommandExchange(self._endpoint.send, GROUND, self._peer, command, *parameters)
        try:
            self._run(exchange)
        except VehicleClientError as error:
            if exchange.refusal is None:
                raise
            raise CommandRefusedError(str(error), exchange.refusal) from None

    def use(self, kind: Callable[..., C], ask: Callable[[C], Exchange[T]]) -> T:
        """Run a request of a service: `use(FileClient, lambda files: files.list("/logs"))`."""
        return self._run(ask(self._client(kind)))

    def _request_param(self, request: ParamRequest, name: str) -> float:
        """Run a request for one parameter; the error of an unknown name suggests a similar one."""
        try:
            return self._run(request)
        except VehicleClientError as error:
            if not request.does_not_exist:
                raise
            suggestion = did_you_mean(name, self.parameters())
            raise VehicleClientError(f"{error}{suggestion}") from None

    def _report_wait(self, subject: str, timeout_s: float) -> None:
        """Report what is awaited, and for how long at most."""
        if self.on_remark is not None:
            self.on_remark(f"waiting up to {timeout_s:g} s for {subject}")

    def _wait_for_prearm(self, deadline_s: float) -> None:
        """Wait until the pre-arm checks pass; one period if the vehicle does not report them."""
        while wall_s() < deadline_s:
            self.pump_until(lambda: False, ARM_RETRY_PERIOD_S)
            if self._passes_prearm() is not False:
                return

    def _passes_prearm(self) -> bool | None:
        """Request and return whether the pre-arm checks pass; None if the vehicle reports none."""
        self._own_status = None
        CommandExchange(
            self._endpoint.send, GROUND, self._peer, MavCmd.REQUEST_MESSAGE, _SYS_STATUS
        ).poll(wall_s())
        self.pump_until(lambda: self._own_status is not None, ARM_RETRY_PERIOD_S)
        status = None if self._own_status is None else self._own_status.decode()
        if status is None or not status.onboard_control_sensors_present & _PREARM:
            return None
        return bool(status.onboard_control_sensors_health & _PREARM)

    def pump_until(self, is_done: Callable[[], bool], timeout_s: float) -> bool:
        """Receive until a condition holds or the wall time is over; return the condition."""
        deadline_s = wall_s() + timeout_s
        while not is_done() and wall_s() < deadline_s:
            self.pump(0.05)
        return is_done()

    def close(self) -> None:
        """Close the link."""
        self._endpoint.transport.close()

    @property
    def _peer(self) -> MavlinkId:
        """The autopilot. Raises VehicleClientError before it is found."""
        if self.vehicle_id is None:
            raise VehicleClientError("not connected to a vehicle yet")
        return self.vehicle_id

    @cached_property
    def _params(self) -> ParamClient:
        """The client of parameters: one, because it recognises late values of earlier requests."""
        peer = self._peer
        is_px4 = self._last_heartbeat.autopilot == PX4
        return ParamClient(self._endpoint.send, GROUND, peer, bytewise=is_px4)

    def _client(self, kind: Callable[..., T]) -> T:
        """Return a client of one MAVLink service."""
        return kind(self._endpoint.send, GROUND, self._peer)

    def _run(self, exchange: Exchange[T]) -> T:
        """Receive until a request is done; return its result."""
        first_text = len(self.texts)
        if self._modem_s is not None:
            exchange.repeat_every(self._modem_s, MODEM_ATTEMPTS)
        elif self._watchdog is not None:
            exchange.repeat_every(0.0, SIMULATED_ATTEMPTS)
        self._listener = exchange.feed
        try:
            while not exchange.done:
                exchange.poll(wall_s())
                self.pump(0.02)
            return exchange.result()
        except ExchangeError as error:
            raise VehicleClientError(self._with_reason(exchange, error, first_text)) from None
        except LinkLostError as error:
            raise VehicleClientError(f"the vehicle is gone: {error}") from None
        finally:
            self._listener = None

    def _with_reason(self, exchange: Exchange[T], error: ExchangeError, first_text: int) -> str:
        """Return the error with its likely reason: texts of the vehicle, or a missing key."""
        received = (text.text for text in self.texts[first_text:] if text.text)
        texts = list(dict.fromkeys(received))[-MAX_REASONS:]
        if exchange.timed_out and self._is_signed_by_vehicle():
            texts.append("the vehicle signs its messages: give the key of the link by --sign")
        return f"{error}" + (f" ({'; '.join(texts)})" if texts else "")

    def _is_signed_by_vehicle(self) -> bool:
        """Return whether the vehicle signs its messages and this program does not."""
        newest = self._latest.get(_HEARTBEAT)
        return self._endpoint.signing is None and newest is not None and bool(newest.signature)

    def _process(self, frames: Sequence[Frame]) -> None:
        """Record the frames, update the state and call the listeners."""
        if self._system is None:
            frames = self._select_vehicle(frames)
        recorder, latest, listener = self._recorder, self._latest, self._listener
        for frame in frames:
            if self._is_other_vehicle(frame):
                continue
            if recorder is not None:
                recorder.record(frame)
            latest[frame.message_id] = frame
            if frame.message_id == _HEARTBEAT:
                self._on_heartbeat(frame, frame.decode())
            elif frame.message_id == _HIGH_LATENCY.message_id:
                self._on_heartbeat(frame, _heartbeat_of(frame.decode()))
            elif frame.message_id == _STATUSTEXT:
                self._on_statustext(frame)
            elif (
                frame.message_id == _SYS_STATUS
                and (frame.system, frame.component) == self.vehicle_id
            ):
                self._own_status = frame
            if listener is not None:
                listener(frame)
            if self.on_frame is not None and (frame.system, frame.component) == self.vehicle_id:
                self.on_frame(frame)

    def _select_vehicle(self, frames: Sequence[Frame]) -> Sequence[Frame]:
        """Select the vehicle whose HEARTBEAT is the first; return all frames received so far.

        Returns nothing before that: the frames may be those of another vehicle.
        """
        self._unassigned += frames
        self._system = next((frame.system for frame in frames if _is_vehicle(frame)), None)
        if self._system is None:
            return ()
        selected = list(self._unassigned)
        self._unassigned.clear()
        return selected

    def _is_other_vehicle(self, frame: Frame) -> bool:
        """Return whether a frame is from another vehicle than the selected one."""
        if frame.system == self._system:
            return False
        if self.vehicle_id is None:
            self._others.add(frame.system)
        return True

    def _on_heartbeat(self, frame: Frame, message: Any) -> None:
        """Update the state from a HEARTBEAT; the first one of an autopilot selects the vehicle."""
        sender = MavlinkId(frame.system, frame.component)
        if self.vehicle_id is None and connection_diagnosis.is_vehicle(message):
            self.vehicle_id = sender
        if sender == self.vehicle_id:
            self._heartbeat_received_s = wall_s()
            self.kind = message.type
            self.heartbeats += 1
            self._last_heartbeat = message
            armed = bool(message.base_mode & ARMED_FLAG)
            self._status = message.system_status
            if self.armed and not armed:
                self.disarmings += 1
                self.arm_requested = False
            self.armed = armed
            if armed:
                is_critical = message.system_status in _CRITICAL and self.mode != "MISSION"
                self.critical_mode = self.mode if is_critical else ""

    def _on_statustext(self, frame: Frame) -> None:
        """Assemble a text, store it and call the listener."""
        message = frame.decode()
        complete = self._joiner.add((frame.system, frame.component), message)
        if complete is None:
            return
        text = StatusText(message.severity, complete)
        self.texts.append(text)
        if self.on_text is not None:
            self.on_text(text)

    def _not_found(self, timeout_s: float) -> str:
        """Return why no vehicle was found."""
        address = self._endpoint.transport.address
        received = (*self._latest.values(), *self._unassigned)
        senders = {MavlinkId(frame.system, frame.component) for frame in received}
        if self._system is not None and not senders:
            others = ", ".join(map(str, sorted(self._others))) or "none"
            return (
                f"no vehicle {self._system} on {address} within {timeout_s:g} s: received systems:"
                f" {others}"
            )
        reason = connection_diagnosis.explain(self._endpoint, senders)
        return f"no vehicle on {address} within {timeout_s:g} s: {reason}"

    def _send_heartbeat(self) -> None:
        """Send the HEARTBEAT of a ground station."""
        self._endpoint.send(
            "HEARTBEAT",
            type=connection_diagnosis.GROUND_STATION,
            autopilot=connection_diagnosis.NO_AUTOPILOT,
            base_mode=0,
            custom_mode=0,
            system_status=0,
            mavlink_version=3,
        )


def _is_vehicle(frame: Frame) -> bool:
    """Return whether a frame is the HEARTBEAT or HIGH_LATENCY2 of a vehicle."""
    is_heartbeat = frame.message_id in (_HEARTBEAT, _HIGH_LATENCY.message_id)
    return is_heartbeat and connection_diagnosis.is_vehicle(frame.decode())


def _heartbeat_of(message: Any) -> Any:
    """Return the HEARTBEAT fields of a HIGH_LATENCY2.

    custom0 is base_mode as ArduPilot sends it, custom1 the system status that Caribou sends.
    """
    return dialect.by_name("HEARTBEAT").record(
        custom_mode=from_high_latency(message.autopilot, message.custom_mode),
        type=message.type,
        autopilot=message.autopilot,
        base_mode=message.custom0 & 0xFF | CUSTOM_MODE_FLAG,
        system_status=message.custom1 & 0xFF,
        mavlink_version=3,
    )


@contextmanager
def connected(
    address: str,
    key_file: Path | None = None,
    system: int | None = None,
    modem_s: float | None = None,
    on_remark: Callable[[str], None] | None = None,
) -> Iterator[VehicleClient]:
    """Connect to the vehicle at an address, and close the link at the end.

    Parameters
    ----------
    address : str
        Link address, such as `udpin:127.0.0.1:14550`.
    key_file : Path, optional
        Passphrase or key with which the link is signed.
    system : int, optional
        System id of the vehicle, where several are on the link.
    modem_s : float, optional
        Time after which requests are repeated (s), for a link over a modem.
    on_remark : Callable, optional
        Receives what is awaited, when it has not come within `WAIT_NOTICE_S`.

    Raises
    ------
    AddressError, InputError, VehicleClientError
        The address or key cannot be used, or no vehicle was found.
    """
    with open_signing(key_file) as signature:
        vehicle = VehicleClient(
            open_transport(address), signing=signature, system=system, modem_s=modem_s
        )
        vehicle.on_remark = on_remark
        try:
            vehicle.connect()
            yield vehicle
        finally:
            vehicle.close()
