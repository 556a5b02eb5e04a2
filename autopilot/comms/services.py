"""What the vehicle does for ground stations, by message: one table."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from autopilot.commands.commander import Commander
from autopilot.commands.failure_injection import FailureRelay
from autopilot.commands.flight import move_home
from autopilot.commands.types import (
    LOWEST_CUSTOM_MODE,
    Desk,
    JobProgress,
    command_from_message,
    foreign_mode,
)
from autopilot.comms import offboard_messages
from autopilot.comms.ftp_root import file_tree
from autopilot.comms.ground_links import GroundLink
from autopilot.comms.offboard_messages import SetpointStreams
from autopilot.comms.signing_keys import Keys
from autopilot.comms.statustext import Announcer, Publish
from autopilot.control.manual_control import Helm
from autopilot.control.requests import SetMode
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.telemetry.request_message import Library
from autopilot.vehicle import Vehicle, VehicleMission
from mavlink_io import dialect
from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd
from mavlink_io.request import MavlinkId, Send
from mavlink_io.services.ftp.server import FileServer
from mavlink_io.services.log_transfer.server import LogServer
from mavlink_io.services.mission_server import MissionServer
from mavlink_io.services.params import ParamServer

_GROUND_STATION = constant("MAV_TYPE_GCS")
_ACKNOWLEDGEMENT, _ORIGIN = dialect.by_name("COMMAND_ACK"), dialect.by_name("GPS_GLOBAL_ORIGIN")
_TIME, _PING = dialect.by_name("TIMESYNC"), dialect.by_name("PING")


class Arrival(NamedTuple):
    """A message for this vehicle."""

    link: GroundLink
    frame: Frame
    message: Any
    send: Send
    """Answers on the link by which it came."""

    @property
    def sender(self) -> MavlinkId:
        return MavlinkId(self.frame.system, self.frame.component)


class Services:
    """Each is fed the messages it hears, and polled by the wall clock."""

    def __init__(
        self,
        vehicle: Vehicle,
        announcer: Announcer,
        library: Library,
        broadcast: Publish,
        keys: Keys,
        logbook: OnboardLog,
    ) -> None:
        self._vehicle, self._announcer, self._library = vehicle, announcer, library
        self._keys, self._logbook = keys, logbook
        self.helm = Helm()
        self.setpoints = SetpointStreams(vehicle)
        self.ground_heard_s: float | None = None
        """When a ground station's heartbeat was last heard, by the wall clock."""
        self.failures = FailureRelay(vehicle.say)
        self._missions = MissionServer(VehicleMission(vehicle))
        self._params = ParamServer(vehicle.params, by_name(broadcast), vehicle.say)
        self._files = FileServer(file_tree(vehicle.params, logbook))
        self._logs = LogServer(logbook, vehicle.say, lambda: vehicle.state.armed)
        self._desk = Desk(vehicle, self.helm, library.build, self._params.announce)
        self._commander = Commander(self._desk)
        self._table = self._handlers()

    def _handlers(self) -> dict[int, Callable[[Arrival], None]]:
        now_s = wall_s
        handlers: dict[str, Callable[[Arrival], None]] = {
            "HEARTBEAT": self._hear_heartbeat,
            "COMMAND_LONG": self._obey,
            "COMMAND_INT": self._obey,
            "COMMAND_CANCEL": lambda a: self._commander.cancel(a.message.command, now_s()),
            "SET_MODE": self._set_mode,
            "SET_HOME_POSITION": self._set_home,
            "SET_GPS_GLOBAL_ORIGIN": self._set_home,
            "MANUAL_CONTROL": self._take_stick,
            **{name: partial(self._take_setpoint, name) for name in offboard_messages.MESSAGE_IDS},
            "TIMESYNC": _answer_timesync,
            "PING": _answer_ping,
            "SETUP_SIGNING": self._change_key,
        }
        for names, serve in (
            (MissionServer.message_names, lambda a: self._missions.feed(a.frame, a.send, now_s())),
            (
                ParamServer.message_names,
                lambda a: self._params.feed(a.frame, a.send, a.link.room_bytes),
            ),
            (
                FileServer.message_names,
                lambda a: self._files.feed(a.frame, a.send, a.link.room_bytes, now_s()),
            ),
            (
                LogServer.message_names,
                lambda a: self._logs.feed(a.frame, a.send, a.link.room_bytes),
            ),
        ):
            handlers |= dict.fromkeys(names, serve)
        return {dialect.by_name(name).message_id: handler for name, handler in handlers.items()}

    def hears(self, message_id: int) -> bool:
        return message_id in self._table

    def feed(self, arrival: Arrival) -> None:
        """Serve a message that is addressed to this vehicle."""
        self._table[arrival.frame.message_id](arrival)

    def poll(self, now_s: float) -> None:
        """Go on with what takes longer than one message: protocol timers, long jobs, lists,
        keys."""
        self._missions.poll(now_s)
        self._params.poll()
        self._commander.poll(now_s)
        self.failures.poll(now_s)
        if complaint := self._keys.save_when_due():
            self._vehicle.say(complaint)

    def poll_bulk(self, now_s: float) -> None:
        """Go on with what is as long as its links have room: files and logs."""
        self._files.poll(now_s)
        self._logs.poll()

    def _hear_heartbeat(self, arrival: Arrival) -> None:
        if arrival.message.type == _GROUND_STATION:
            self.ground_heard_s = wall_s()

    def _obey(self, arrival: Arrival) -> None:
        message, link, asker = arrival.message, arrival.link, arrival.sender

        def acknowledge(progress: JobProgress) -> None:
            self._announcer.announce()
            answer = message.command, progress.result, progress.percent, 0, *asker
            self._logbook.note(_ACKNOWLEDGEMENT, answer)
            link.write(_ACKNOWLEDGEMENT, answer)
            link.hasten()

        command, now_s = command_from_message(message), wall_s()
        if command.number == MavCmd.INJECT_FAILURE:
            enabled = bool(self._vehicle.params.config.failure_enabled)
            self.failures.ask(
                command, asker, lambda result: acknowledge(JobProgress(result)), enabled, now_s
            )
            return
        for answer, values in self._commander.execute(
            command, asker, link.schedule, acknowledge, now_s
        ).messages:
            link.write(answer, values)

    def _set_mode(self, arrival: Arrival) -> None:
        """Set a mode the old way: never acknowledged, so the heartbeat reports the result."""
        number = arrival.message.custom_mode
        if number < LOWEST_CUSTOM_MODE:
            self._vehicle.say(foreign_mode(number))
        else:
            self._vehicle.request(SetMode(number))
        self._announcer.remind()

    def _set_home(self, arrival: Arrival) -> None:
        """Messages without an acknowledgement: where home is now tells what became of them."""
        m = arrival.message
        move_home(self._desk, m.latitude * 1e-7, m.longitude * 1e-7, m.altitude * 1e-3)
        for values in self._library.build(_ORIGIN):
            arrival.link.write(_ORIGIN, values)

    def _take_stick(self, arrival: Arrival) -> None:
        if arrival.message.target in (0, self._vehicle.system):
            self.helm.take(arrival.message, wall_s())

    def _take_setpoint(self, name: str, arrival: Arrival) -> None:
        self.setpoints.take(name, arrival.message)

    def _change_key(self, arrival: Arrival) -> None:
        link, armed = arrival.link, self._vehicle.state.armed
        self._vehicle.say(
            self._keys.change(arrival.message, link.endpoint.signing, link.trusted, armed)
        )


def by_name(tell: Publish) -> Send:
    """A teller that takes a message's name and fields, as the protocols of ``link`` want it."""

    def send(name: str, **fields: Any) -> None:
        message = dialect.by_name(name)
        tell(message, message.values(**fields))

    return send


def _answer_timesync(arrival: Arrival) -> None:
    if arrival.message.tc1 == 0:
        arrival.link.write(_TIME, (round(wall_s() * 1e9), arrival.message.ts1))


def _answer_ping(arrival: Arrival) -> None:
    ping = arrival.message
    if ping.target_system == 0:
        arrival.link.write(_PING, (ping.time_usec, ping.seq, *arrival.sender))
