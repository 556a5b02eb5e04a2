"""Receive telemetry of one vehicle: the latest messages, their age and the data rate of the link.

The receiver sends heartbeats of type MAV_TYPE_LOG instead of MAV_TYPE_GCS, so that a vehicle still
detects the loss of its ground station.
"""

from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

from ground.client import commands, connection_diagnosis
from ground.client.flight import TelemetryListener
from ground.client.vehicle import StatusText
from ground.live import plausible
from mavlink_io import dialect
from mavlink_io.clock import Interval, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.logging.statustext import TextJoiner
from mavlink_io.mission_items import MavCmd
from mavlink_io.request import ExchangeError, MavlinkId
from mavlink_io.signing import Signing
from mavlink_io.transport import LinkLostError, Transport, wait

OWN_ID = MavlinkId(250, constant("MAV_COMP_ID_LOG"))
MAX_TEXTS = 8
RATE_WINDOW_S = 5.0
"""Averaging time of the data rates (s)."""
SMOOTHING = 0.2
"""Weight of the newest interval in the mean message period."""
_OBSERVER = constant("MAV_TYPE_LOG")
_ARDUPILOT = constant("MAV_AUTOPILOT_ARDUPILOTMEGA")
_VERSION = float(constant("MAVLINK_MSG_ID_AUTOPILOT_VERSION"))


LISTENER_RATES_HZ = {
    "ATTITUDE": 20.0,
    "ACTUATOR_OUTPUT_STATUS": 20.0,
    "LOCAL_POSITION_NED": 20.0,
    "ATTITUDE_TARGET": 2.0,
    "POSITION_TARGET_LOCAL_NED": 2.0,
}
"""Message rates that listeners need (Hz); most vehicles send less without a request."""


class LatestMessage(NamedTuple):
    """Latest message of one type, with its time of reception."""

    message: Any
    at_s: float
    period_s: float
    """Mean time between two messages (s); 0 after the first."""


def after(before: LatestMessage | None, message: Any, now_s: float) -> LatestMessage:
    """Return a new message as the latest one, with the smoothed period of its type (s)."""
    period_s = 0.0
    if before is not None:
        gap_s = now_s - before.at_s
        period_s = (
            before.period_s + SMOOTHING * (gap_s - before.period_s) if before.period_s else gap_s
        )
    return LatestMessage(message, now_s, period_s)


class ReceivedText(NamedTuple):
    """STATUSTEXT of the vehicle, with its time of reception."""

    at_s: float
    severity: int
    text: str


class Receiver:
    """Latest telemetry of the first vehicle that is received."""

    def __init__(self, transport: Transport, signing: Signing | None = None) -> None:
        self.address = transport.address
        self._endpoint = Endpoint(transport, *OWN_ID, signing)
        self._heartbeat, self._requests = Interval(1.0), Interval(3.0)
        self._mode_list: commands.ModeList | None = None
        self._joiner = TextJoiner()
        self._arrivals: deque[tuple[float, int]] = deque()
        self._senders: set[MavlinkId] = set()
        self.began_s = wall_s()
        self.vehicle_id: MavlinkId | None = None
        self.latest: dict[str, LatestMessage] = {}
        self.texts: deque[ReceivedText] = deque(maxlen=MAX_TEXTS)
        self.modes: dict[int, str] = {}
        self.frames = 0
        self.received_bytes = 0
        self.rates_hz: Mapping[str, float] = LISTENER_RATES_HZ
        """Message rates that the listener needs (Hz)."""
        self.listener: TelemetryListener | None = None
        """Listener that receives the frames and texts of the vehicle, if any."""
        self.trouble = ""
        """Reason of a link failure; empty without a failure."""

    @property
    def lost_frames(self) -> int:
        """Number of frames that are missing in the sequence numbers."""
        return self._endpoint.lost_frames

    @property
    def rejected_frames(self) -> int:
        """Number of received frames that were rejected."""
        return self._endpoint.rejected_frames

    def send(self, name: str, **fields: Any) -> None:
        """Send a message, for a request of a service."""
        self._endpoint.send(name, **fields)

    def rates(self, now_s: float) -> tuple[float, float]:
        """Return the recent data rate in bytes/s and messages/s."""
        self._drop_old_arrivals(now_s)
        span_s = max(1.0, min(RATE_WINDOW_S, now_s - self.began_s))
        return sum(size for _, size in self._arrivals) / span_s, len(self._arrivals) / span_s

    def _drop_old_arrivals(self, now_s: float) -> None:
        """Drop the arrivals that the data rates no longer count."""
        while self._arrivals and now_s - self._arrivals[0][0] > RATE_WINDOW_S:
            self._arrivals.popleft()

    def diagnosis(self) -> str:
        """Return the likely reason why no vehicle was found."""
        return connection_diagnosis.explain(self._endpoint, self._senders)

    def listen(self, timeout_s: float) -> None:
        """Process frames that arrive within a time, and send requests."""
        try:
            self._send_due()
            wait([self._endpoint.transport], timeout_s)
            for frame in connection_diagnosis.receive_all(self._endpoint).frames:
                self._process(frame, wall_s())
        except LinkLostError as error:
            self.trouble = str(error)
            wait([], timeout_s)

    def _send_due(self) -> None:
        """Send the heartbeat and, until they are answered, the requests that are due."""
        if self._heartbeat.due():
            self._endpoint.send(
                "HEARTBEAT",
                type=_OBSERVER,
                autopilot=connection_diagnosis.NO_AUTOPILOT,
                base_mode=0,
                custom_mode=0,
                system_status=0,
                mavlink_version=3,
            )
        if self.vehicle_id is None:
            return
        if self._mode_list is None:
            self._mode_list = commands.ModeList(self._endpoint.send, OWN_ID, self.vehicle_id)
        self._mode_list.poll(wall_s())
        if self._requests.due():
            self._request(self.vehicle_id)

    def _request(self, vehicle_id: MavlinkId) -> None:
        """Request the version, and telemetry that the autopilot does not send unrequested."""
        if "AUTOPILOT_VERSION" not in self.latest:
            self._command(vehicle_id, MavCmd.REQUEST_MESSAGE, _VERSION)
        for name, rate_hz in self.rates_hz.items() if self.listener else ():
            if name not in self.latest or self.latest[name].period_s > 1.5 / rate_hz:
                self._command(
                    vehicle_id,
                    MavCmd.SET_MESSAGE_INTERVAL,
                    dialect.by_name(name).message_id,
                    1e6 / rate_hz,
                )
        if (
            self.latest["HEARTBEAT"].message.autopilot == _ARDUPILOT
            and "ATTITUDE" not in self.latest
        ):
            self._endpoint.send(
                "REQUEST_DATA_STREAM",
                target_system=vehicle_id.system,
                target_component=vehicle_id.component,
                req_stream_id=0,
                req_message_rate=2,
                start_stop=1,
            )

    def _command(self, vehicle_id: MavlinkId, command: int, *parameters: float) -> None:
        """Send a COMMAND_LONG; missing parameters are 0."""
        numbers = {f"param{n + 1}": (*parameters, *[0.0] * 7)[n] for n in range(7)}
        self._endpoint.send(
            "COMMAND_LONG",
            target_system=vehicle_id.system,
            target_component=vehicle_id.component,
            command=command,
            confirmation=0,
            **numbers,
        )

    def _process(self, frame: Frame, now_s: float) -> None:
        """Store a frame of the vehicle; the first heartbeat of a vehicle selects it."""
        sender = MavlinkId(frame.system, frame.component)
        self._senders.add(sender)
        self._drop_old_arrivals(now_s)  # `ground live` does not ask for the rates
        self._arrivals.append((now_s, len(frame.raw)))
        self.frames += 1
        self.received_bytes += len(frame.raw)
        message = plausible.decode(frame) if not frame.name.startswith("UNKNOWN") else None
        if (
            self.vehicle_id is None
            and frame.name == "HEARTBEAT"
            and connection_diagnosis.is_vehicle(message)
        ):
            self.vehicle_id = sender
        if message is None or sender != self.vehicle_id:
            return
        self.latest[frame.name] = after(self.latest.get(frame.name), message, now_s)
        if self.listener is not None:
            self.listener.on_frame(frame)
        if frame.name == "STATUSTEXT" and (text := self._joiner.add(sender, message)) is not None:
            self.texts.append(ReceivedText(now_s, message.severity, text))
            if self.listener is not None:
                self.listener.on_text(StatusText(message.severity, text))
        if self._mode_list is not None and not self.modes:
            self._update_modes(self._mode_list, frame)

    def _update_modes(self, modes: commands.ModeList, frame: Frame) -> None:
        """Take over the mode list of the vehicle when it is complete."""
        modes.feed(frame)
        if modes.done:
            try:
                self.modes = {number: name for name, number in modes.result().items()}
            except ExchangeError:  # the vehicle has no mode list: published tables are used
                return
