"""The client of one MAVLink vehicle: finds it, asks it, and hears everything it says.

There is one receive loop, ``pump``. Whatever else is going on - an upload, a wait - turns that
loop, so that every frame is recorded whatever anybody is waiting for."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ground.client import commands, connection_diagnosis
from ground.client.commands import CommandExchange, ModeList
from ground.client.recorder import Recorder
from ground.client.signing import open_signing
from ground.errors import OperationError
from ground.live.watch import mode_names
from mavlink_io import dialect
from mavlink_io.clock import Every, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.logging.statustext import TextJoiner
from mavlink_io.mission_items import MavCmd, MissionItem
from mavlink_io.records import ARMED_FLAG
from mavlink_io.request import Exchange, ExchangeError, MavlinkId
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient
from mavlink_io.signing import Signing
from mavlink_io.transport import LinkLostError, Transport, open_transport, wait

T = TypeVar("T")
C = TypeVar("C")

GROUND = MavlinkId(250, constant("MAV_COMP_ID_MISSIONPLANNER"))
"""Ground's own address: not 255/190, whose frames MAVSDK drops as QGroundControl's."""
HEARTBEAT_PERIOD_S = 1.0
WATCHDOG_PERIOD_S = 0.2
READY_TIMEOUT_S = 60.0
"""Maximum wall time (s) in which a vehicle may reach MAV_STATE_STANDBY before it is armed."""
SIMULATED_READY_WITHIN_S = 300.0
"""The same of a simulated vehicle, whose processes are watched: on a new or busy machine the
simulator may take minutes to compile its kernels before the first sensor sample."""
ARM_RETRY_S, ARM_RETRY_PERIOD_S = 15.0, 1.0
"""Wall time (s) in which a temporary refusal to arm is asked again, and the time between
attempts."""
HEARTBEAT_TIMEOUT_S = 5.0
"""Wall seconds without a heartbeat after which a vehicle counts as lost."""
_STANDBY = constant("MAV_STATE_STANDBY")
_PREARM = constant("MAV_SYS_STATUS_PREARM_CHECK")
_HEARTBEAT, _STATUSTEXT = (
    constant("MAVLINK_MSG_ID_HEARTBEAT"),
    constant("MAVLINK_MSG_ID_STATUSTEXT"),
)
_SYS_STATUS = constant("MAVLINK_MSG_ID_SYS_STATUS")


class VehicleClientError(OperationError):
    """The vehicle is not there, went away, or refused; the message says which and why."""


class RefusedError(VehicleClientError):
    """The vehicle refused a command; `result` is its MAV_RESULT."""

    def __init__(self, reason: str, result: int) -> None:
        super().__init__(reason)
        self.result = result


class StatusText(NamedTuple):
    severity: int
    text: str


class VehicleClient:
    """A connected vehicle. Raises VehicleError wherever it is lost or refuses."""

    def __init__(
        self,
        transport: Transport,
        recorder: Recorder | None = None,
        watchdog: Callable[[], None] | None = None,
        signing: Signing | None = None,
    ) -> None:
        """``watchdog`` is called several times a second, to raise when what carries the vehicle has
        failed."""
        self._endpoint = Endpoint(transport, *GROUND, signing)
        self._recorder = recorder
        self._watchdog = watchdog
        self._heartbeat, self._check = Every(HEARTBEAT_PERIOD_S), Every(WATCHDOG_PERIOD_S)
        self._heard_s = wall_s()
        self._latest: dict[int, Frame] = {}
        self._modes: dict[str, int] = {}
        self._listener: Callable[[Frame], None] | None = None
        self.on_text: Callable[[StatusText], None] | None = None
        self.on_frame: Callable[[Frame], None] | None = None
        """Called with every frame of the autopilot's own."""
        self.party: MavlinkId | None = None
        self._status = 0
        self._own_status: Frame | None = None
        """The autopilot's newest SYS_STATUS; its devices send that message too."""
        self.kind = 0
        """MAV_TYPE."""
        self.armed = False
        self.arm_requested = False
        """Whether it was asked to arm and has not refused: it may be armed before a HEARTBEAT says
        so."""
        self.heartbeats = 0
        """How many were received of the vehicle."""
        self._last_heartbeat: Any = None
        self.disarmings = 0
        """How often the vehicle was seen to disarm."""
        self.texts: list[StatusText] = []
        self._joiner = TextJoiner()

    @property
    def lost_frames(self) -> int:
        """Frames that were sent and never arrived, by their sequence numbers."""
        return self._endpoint.lost_frames

    @property
    def custom_mode(self) -> int:
        """HEARTBEAT.custom_mode as last received."""
        return 0 if self._last_heartbeat is None else int(self._last_heartbeat.custom_mode)

    @property
    def mode(self) -> str:
        """The mode of the last HEARTBEAT, by the vehicle's own name as far as `modes` has been
        asked."""
        if self._last_heartbeat is None:
            return "unknown"
        return mode_names.name(
            self._last_heartbeat, {number: name for name, number in self._modes.items()}
        )

    @property
    def recorder(self) -> Recorder | None:
        return self._recorder

    def connect(self, timeout_s: float = 30.0) -> None:
        """Wait for the heartbeat of an autopilot."""
        deadline_s = wall_s() + timeout_s
        while True:
            self._heard_s = wall_s()
            is_all = self.pump(0.05)
            if self.party is not None:
                return
            if is_all and wall_s() > deadline_s:
                raise VehicleClientError(self._not_found(timeout_s))

    def pump(self, timeout_s: float) -> bool:
        """Receive what has come, waiting for it for at most ``timeout_s``: record it, take note of
        it.

        Returns whether nothing is left unread. Silence is judged only then: after a pause of this
        process the wall clock is ahead of the messages that wait in the socket."""
        transport = self._endpoint.transport
        try:
            if self._heartbeat.due():
                self._send_heartbeat()
            wait([transport], timeout_s)
            frames, is_all = connection_diagnosis.receive_all(self._endpoint)
        except LinkLostError as error:
            raise VehicleClientError(f"the vehicle is gone: {error}") from None
        self._take(frames)
        if self._watchdog is not None and self._check.due():
            self._watchdog()
        if self._recorder is not None:
            self._recorder.flush_when_due()
        if is_all and wall_s() - self._heard_s > HEARTBEAT_TIMEOUT_S:
            raise VehicleClientError(
                f"the vehicle is gone: no heartbeat on {transport.address} "
                f"for {HEARTBEAT_TIMEOUT_S:g} s"
            )
        return is_all

    def latest(self, name: str) -> Any | None:
        """The newest message of a name, decoded; None when none has come."""
        frame = self._latest.get(dialect.by_name(name).message_id)
        return None if frame is None else frame.decode()

    def parameters(self) -> dict[str, float]:
        """Every parameter by name."""
        return self._run(self._client(ParamClient).list())

    def parameter(self, name: str) -> float:
        return self._run(self._client(ParamClient).get(name))

    def set_parameter(self, name: str, value: float) -> float:
        """Set a parameter; returns what the vehicle reads back."""
        return self._run(self._client(ParamClient).set(name, value))

    def upload(self, items: Sequence[MissionItem]) -> None:
        """Replace the mission."""
        self._run(self._client(MissionClient).upload(items))

    def download(self) -> tuple[MissionItem, ...]:
        """Fetch the mission."""
        return self._run(self._client(MissionClient).download())

    def modes(self) -> dict[str, int]:
        """The modes the vehicle offers: custom_mode by name."""
        if not self._modes:
            self._modes = self._run(ModeList(self._endpoint.send, GROUND, self._peer))
        return self._modes

    def offered_modes(self) -> dict[str, int]:
        """Return `modes`; of a vehicle that does not list them, those that are known for its
        type."""
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
        """Change mode by name, as the vehicle calls it."""
        modes = self.offered_modes()
        if name not in modes:
            raise VehicleClientError(f"mode {name}: the vehicle offers {', '.join(sorted(modes))}")
        self.command(MavCmd.DO_SET_MODE, 1.0, float(modes[name]))

    def set_interval(self, name: str, rate_hz: float) -> None:
        """Have a message sent ``rate_hz`` times a second of vehicle time."""
        self.command(MavCmd.SET_MESSAGE_INTERVAL, dialect.by_name(name).message_id, 1e6 / rate_hz)

    def arm(self, patience_s: float | None = None) -> None:
        """Arm as soon as the vehicle is ready.

        Parameters
        ----------
        patience_s : float, optional
            Wall time (s) in which a vehicle that starts may reach MAV_STATE_STANDBY. The default is
            `READY_TIMEOUT_S`, for a simulated vehicle `SIMULATED_READY_WITHIN_S`.

        Raises
        ------
        RefusedError
            The refusal is final; the vehicle reports that its pre-arm checks pass and refuses twice
            all the same; or a temporary refusal has lasted for `ARM_RETRY_S`.
        """
        if patience_s is None:
            patience_s = READY_TIMEOUT_S if self._watchdog is None else SIMULATED_READY_WITHIN_S
        self.pump_until(lambda: self._status >= _STANDBY, patience_s)
        deadline_s, passed = wall_s() + ARM_RETRY_S, False
        while True:
            self.arm_requested = True
            try:
                self.command(MavCmd.COMPONENT_ARM_DISARM, 1.0)
                return
            except RefusedError as refusal:
                self.arm_requested = False
                if refusal.result != commands.TEMPORARILY_REJECTED or wall_s() > deadline_s:
                    raise
                # The checks may have passed since the refusal: one more attempt decides.
                passed_before, passed = passed, bool(self._passes_prearm())
                if passed and passed_before:
                    raise
                if not passed:
                    self._wait_for_prearm(deadline_s)

    def disarm(self, *, force: bool = False) -> None:
        self.command(MavCmd.COMPONENT_ARM_DISARM, 0.0, 21196.0 if force else 0.0)

    def command(self, command: int, *parameters: float) -> None:
        """Send one command and wait until it is done. Raises RefusedError, VehicleError."""
        exchange = CommandExchange(self._endpoint.send, GROUND, self._peer, command, *parameters)
        try:
            self._run(exchange)
        except VehicleClientError as error:
            if exchange.refusal is None:
                raise
            raise RefusedError(str(error), exchange.refusal) from None

    def use(self, kind: Callable[..., C], ask: Callable[[C], Exchange[T]]) -> T:
        """Carry out what a service's client begins: ``use(FileClient, lambda files:
        files.list("/logs"))``."""
        return self._run(ask(self._client(kind)))

    def _wait_for_prearm(self, deadline_s: float) -> None:
        """Wait until the vehicle reports that its checks pass; one period where it reports
        nothing."""
        while wall_s() < deadline_s:
            self.pump_until(lambda: False, ARM_RETRY_PERIOD_S)
            if self._passes_prearm() is not False:
                return

    def _passes_prearm(self) -> bool | None:
        """Ask for the vehicle's own verdict on its pre-arm checks; None where it does not report
        one."""
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
        """Receive until something is so, for at most a wall time (s). Returns whether it is so."""
        deadline_s = wall_s() + timeout_s
        while not is_done() and wall_s() < deadline_s:
            self.pump(0.05)
        return is_done()

    def close(self) -> None:
        self._endpoint.transport.close()

    @property
    def _peer(self) -> MavlinkId:
        if self.party is None:
            raise VehicleClientError("not connected to a vehicle yet")
        return self.party

    def _client(self, kind: Callable[..., T]) -> T:
        return kind(self._endpoint.send, GROUND, self._peer)

    def _run(self, exchange: Exchange[T]) -> T:
        told = len(self.texts)
        self._listener = exchange.feed
        try:
            while not exchange.done:
                exchange.poll(wall_s())
                self.pump(0.02)
            return exchange.result()
        except ExchangeError as error:
            raise VehicleClientError(self._with_reason(error, told)) from None
        except LinkLostError as error:
            raise VehicleClientError(f"the vehicle is gone: {error}") from None
        finally:
            self._listener = None

    def _with_reason(self, error: ExchangeError, told: int) -> str:
        """The refusal, with what the vehicle said of it meanwhile."""
        said = [text.text for text in self.texts[told:]]
        return f"{error}" + (f" ({'; '.join(said)})" if said else "")

    def _take(self, frames: Sequence[Frame]) -> None:
        recorder, latest, listener = self._recorder, self._latest, self._listener
        for frame in frames:
            if recorder is not None:
                recorder.record(frame)
            latest[frame.message_id] = frame
            if frame.message_id == _HEARTBEAT:
                self._hear_heartbeat(frame)
            elif frame.message_id == _STATUSTEXT:
                self._hear_text(frame)
            elif frame.message_id == _SYS_STATUS and (frame.system, frame.component) == self.party:
                self._own_status = frame
            if listener is not None:
                listener(frame)
            if self.on_frame is not None and (frame.system, frame.component) == self.party:
                self.on_frame(frame)

    def _hear_heartbeat(self, frame: Frame) -> None:
        message = frame.decode()
        sender = MavlinkId(frame.system, frame.component)
        if self.party is None and connection_diagnosis.is_vehicle(message):
            self.party = sender
        if sender == self.party:
            self._heard_s = wall_s()
            self.kind = message.type
            self.heartbeats += 1
            self._last_heartbeat = message
            armed = bool(message.base_mode & ARMED_FLAG)
            self._status = message.system_status
            if self.armed and not armed:
                self.disarmings += 1
                self.arm_requested = False
            self.armed = armed

    def _hear_text(self, frame: Frame) -> None:
        message = frame.decode()
        whole = self._joiner.add(frame.system, message)
        if whole is None:
            return
        text = StatusText(message.severity, whole)
        self.texts.append(text)
        if self.on_text is not None:
            self.on_text(text)

    def _not_found(self, timeout_s: float) -> str:
        address = self._endpoint.transport.address
        senders = {MavlinkId(frame.system, frame.component) for frame in self._latest.values()}
        heard = connection_diagnosis.explain(address, senders, self._endpoint.skipped_bytes)
        return f"no vehicle on {address} within {timeout_s:g} s: {heard}"

    def _send_heartbeat(self) -> None:
        self._endpoint.send(
            "HEARTBEAT",
            type=connection_diagnosis.GROUND_STATION,
            autopilot=connection_diagnosis.NO_AUTOPILOT,
            base_mode=0,
            custom_mode=0,
            system_status=0,
            mavlink_version=3,
        )


@contextmanager
def connected(address: str, key_file: Path | None = None) -> Iterator[VehicleClient]:
    """The vehicle at an address, let go of afterwards; with a key file, over a link that is signed.

    Raises:
        AddressError, BadInputError, VehicleError: there is no such address, key or vehicle.
    """
    with open_signing(key_file) as signature:
        vehicle = VehicleClient(open_transport(address), signing=signature)
        try:
            vehicle.connect()
            yield vehicle
        finally:
            vehicle.close()
