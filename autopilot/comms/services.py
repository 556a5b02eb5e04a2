"""Services for ground stations: one table from received message to handler."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from autopilot.commands.commander import Commander
from autopilot.commands.failure_injection import FailureRelay
from autopilot.commands.flight import move_home
from autopilot.commands.types import (
    CommandContext,
    JobProgress,
    command_from_message,
    unknown_mode_text,
)
from autopilot.comms import offboard_messages
from autopilot.comms.ground_links import GroundLink
from autopilot.comms.offboard_messages import SetpointReceiver
from autopilot.comms.signing_keys import SigningKeys
from autopilot.comms.statustext import EventPublisher, Publish
from autopilot.control import modes
from autopilot.control.manual_control import Helm
from autopilot.control.params import PARAMETERS, ParamTable
from autopilot.control.requests import SetMode, go_to_target
from autopilot.control.types import IN_PROGRESS
from autopilot.identities import Identity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_file import to_text
from autopilot.telemetry import component_metadata
from autopilot.telemetry.identity import BYTEWISE
from autopilot.telemetry.request_message import MessageBuilder
from autopilot.vehicle import Vehicle, VehicleMission, VehiclePlan
from mavlink_io import dialect
from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.mission_items import FENCE_TYPE, RALLY_TYPE, MavCmd
from mavlink_io.request import MavlinkId, Send
from mavlink_io.services import param_file_ftp
from mavlink_io.services.ftp.server import FileServer
from mavlink_io.services.ftp.tree import FileTree
from mavlink_io.services.log_transfer.server import LogServer
from mavlink_io.services.mission_server import RE_REQUEST_S, MissionServer
from mavlink_io.services.params import ParamServer

_GROUND_STATION = constant("MAV_TYPE_GCS")
_COMMAND_ACK, _ORIGIN = dialect.by_name("COMMAND_ACK"), dialect.by_name("GPS_GLOBAL_ORIGIN")
MODEM_RE_REQUEST_S = 30.0
"""Wall time after which a missing mission item is requested again over a modem."""
MAX_STREAM_HZ = 50
"""Highest rate of REQUEST_DATA_STREAM: that of the ticks."""
_TIME, _PING = dialect.by_name("TIMESYNC"), dialect.by_name("PING")


class ReceivedMessage(NamedTuple):
    """A message that is addressed to this vehicle."""

    link: GroundLink
    frame: Frame
    message: Any
    send: Send
    """Function that replies on the link of the message."""

    @property
    def sender(self) -> MavlinkId:
        """System and component of the sender."""
        return MavlinkId(self.frame.system, self.frame.component)


class Services:
    """All services: each receives its messages and is polled on the wall clock."""

    def __init__(
        self,
        vehicle: Vehicle,
        event_publisher: EventPublisher,
        message_builder: MessageBuilder,
        broadcast: Publish,
        keys: SigningKeys,
        onboard_log: OnboardLog,
        identity: Identity,
    ) -> None:
        self._vehicle, self._event_publisher, self._message_builder = (
            vehicle,
            event_publisher,
            message_builder,
        )
        self._keys, self._onboard_log, self._identity = keys, onboard_log, identity
        self.helm = Helm()
        self.setpoints = SetpointReceiver(vehicle)
        self.ground_received_s: float | None = None
        """Wall time of the last heartbeat of a ground station."""
        self.failures = FailureRelay(vehicle.send_statustext)
        self._broadcast = broadcast
        self.restart()
        self._table = self._handlers()

    def restart(self) -> None:
        """Begin with new protocol servers; after an exception their state may be inconsistent.

        Transfers in progress end, and their clients ask again. Manual control, set-points and the
        time of the last ground station are kept.
        """
        vehicle, onboard_log = self._vehicle, self._onboard_log
        plans = {kind: VehiclePlan(vehicle, kind) for kind in (FENCE_TYPE, RALLY_TYPE)}
        self._missions = MissionServer(
            VehicleMission(vehicle), plans=plans, item_request=self._identity.mission_request
        )
        self._params = ParamServer(
            vehicle.params,
            send_by_name(self._broadcast),
            vehicle.send_statustext,
            bytewise=self._identity.param_encoding == BYTEWISE,
        )
        self._files = FileServer(_file_tree(vehicle.params, onboard_log))
        self._logs = LogServer(onboard_log, vehicle.send_statustext, lambda: vehicle.state.armed)
        self._context = CommandContext(
            vehicle=vehicle,
            helm=self.helm,
            build=self._message_builder.build,
            publish_parameter=self._params.announce,
            mode_table=self._identity.modes,
        )
        self._commander = Commander(self._context)

    def _handlers(self) -> dict[int, Callable[[ReceivedMessage], None]]:
        """Return the handler of each message id."""
        now_s = wall_s
        handlers: dict[str, Callable[[ReceivedMessage], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "COMMAND_LONG": self._execute_command,
            "COMMAND_INT": self._execute_command,
            "COMMAND_CANCEL": lambda a: self._commander.cancel(a.message.command, now_s()),
            "SET_MODE": self._set_mode,
            "SET_HOME_POSITION": self._set_home,
            "SET_GPS_GLOBAL_ORIGIN": self._set_home,
            "REQUEST_DATA_STREAM": self._on_stream_request,
            **{
                name: partial(self._on_pilot_message, take)
                for name, take in self._identity.pilot_messages.items()
            },
            **{name: partial(self._on_setpoint, name) for name in offboard_messages.MESSAGE_IDS},
            "TIMESYNC": _answer_timesync,
            "PING": _answer_ping,
            "SETUP_SIGNING": self._on_setup_signing,
        }
        for names, serve in (
            (MissionServer.message_names, self._on_mission_message),
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

    def handles(self, message_id: int) -> bool:
        """Return whether a service needs this message."""
        return message_id in self._table

    def feed(self, received: ReceivedMessage) -> None:
        """Pass a message to its service."""
        self._table[received.frame.message_id](received)

    def poll(self, now_s: float) -> None:
        """Continue protocol timers, long commands, lists and the storage of signing time."""
        self._missions.poll(now_s)
        self._params.poll()
        self._commander.poll(now_s)
        self.failures.poll(now_s)
        if error := self._keys.save_when_due():
            self._vehicle.send_statustext(error)

    def poll_bulk(self, now_s: float) -> None:
        """Continue transfers of files and logs while their links have room."""
        self._files.poll(now_s)
        self._logs.poll()

    def _on_heartbeat(self, received: ReceivedMessage) -> None:
        """Record the time of a ground station's heartbeat."""
        if received.message.type == _GROUND_STATION:
            self.ground_received_s = wall_s()

    def _execute_command(self, received: ReceivedMessage) -> None:
        """Execute COMMAND_LONG or COMMAND_INT and acknowledge it."""
        message, link, requester = received.message, received.link, received.sender

        def acknowledge(progress: JobProgress) -> None:
            """Send COMMAND_ACK, after pending events, and log it; on a modem less progress."""
            self._event_publisher.publish()
            if progress.result == IN_PROGRESS and not link.schedule.allows_progress(wall_s()):
                return
            values = message.command, progress.result, progress.percent, 0, *requester
            self._onboard_log.log_sent(_COMMAND_ACK, values)
            link.write(_COMMAND_ACK, values)
            link.flush_soon()

        command, now_s = command_from_message(message), wall_s()
        if command.number == MavCmd.INJECT_FAILURE:
            enabled = bool(self._vehicle.params.config.failure_enabled)
            self.failures.submit(
                command, requester, lambda result: acknowledge(JobProgress(result)), enabled, now_s
            )
            return
        for reply, values in self._commander.execute(
            command, requester, link.schedule, acknowledge, now_s
        ).messages:
            link.write(reply, values)

    def _set_mode(self, received: ReceivedMessage) -> None:
        """Handle the deprecated SET_MODE: it has no acknowledgement, so CURRENT_MODE is sent."""
        number = received.message.custom_mode
        mode = self._identity.modes.selected(number)
        if mode is None:
            self._vehicle.send_statustext(unknown_mode_text(number))
        else:
            self._vehicle.handle_request(SetMode(mode.number))
        self._event_publisher.resend_mode()

    def _set_home(self, received: ReceivedMessage) -> None:
        """Handle messages without an acknowledgement: reply with the present home position."""
        m = received.message
        move_home(self._context, m.latitude * 1e-7, m.longitude * 1e-7, m.altitude * 1e-3)
        for values in self._message_builder.build(_ORIGIN):
            received.link.write(_ORIGIN, values)

    def _on_pilot_message(
        self, take: Callable[[Helm, Any, float], None], received: ReceivedMessage
    ) -> None:
        """Use a message of manual control; MANUAL_CONTROL has a target of its own."""
        if getattr(received.message, "target", 0) in (0, self._vehicle.system):
            take(self.helm, received.message, wall_s())

    def _on_stream_request(self, received: ReceivedMessage) -> None:
        """Set the rate of a group of streams on the link of a REQUEST_DATA_STREAM."""
        request = received.message
        group = self._identity.stream_groups.get(request.req_stream_id, ())
        rate_hz = min(request.req_message_rate, MAX_STREAM_HZ) if request.start_stop else 0
        received.link.schedule.set_group_rate(group, rate_hz)

    def _on_mission_message(self, received: ReceivedMessage) -> None:
        """Pass a message to the mission server, which waits longer for items over a modem."""
        re_request_s = MODEM_RE_REQUEST_S if received.link.schedule.answers_only else RE_REQUEST_S
        self._missions.feed(received.frame, received.send, wall_s(), re_request_s)

    def _on_setpoint(self, name: str, received: ReceivedMessage) -> None:
        """Apply an offboard set-point, and switch to mode OFFBOARD where the identity does so.

        A set-point that is only a depth becomes that of HOLD: some tools send it once.
        """
        accepted, state = self.setpoints.handle(name, received.message), self._vehicle.state
        waiting = state.armed and state.mode == modes.HOLD.number and not state.failsafe
        if not (accepted and waiting and self._identity.setpoints_start_offboard):
            return
        motion = None if name == offboard_messages.ATTITUDE else state.targets.motion
        depth = motion is not None and motion.position_m is None and go_to_target(motion)
        self._vehicle.handle_request(depth or SetMode(modes.OFFBOARD.number))

    def _on_setup_signing(self, received: ReceivedMessage) -> None:
        """Change the signing key and send the result as a text."""
        link, armed = received.link, self._vehicle.state.armed
        self._vehicle.send_statustext(
            self._keys.change(received.message, link.endpoint.signing, link.trusted, armed)
        )


def send_by_name(publish: Publish) -> Send:
    """Return a send function that takes message name and fields, as ``mavlink_io`` expects."""

    def send(name: str, **fields: Any) -> None:
        """Publish a message by name and fields."""
        message = dialect.by_name(name)
        publish(message, message.values(**fields))

    return send


def _answer_timesync(received: ReceivedMessage) -> None:
    """Reply to a TIMESYNC request with the wall clock in ns, addressed to its sender."""
    if received.message.tc1 == 0:
        reply = round(wall_s() * 1e9), received.message.ts1, *received.sender
        received.link.write(_TIME, reply)


def _answer_ping(received: ReceivedMessage) -> None:
    """Reply to a PING request."""
    ping = received.message
    if ping.target_system == 0:
        received.link.write(_PING, (ping.time_usec, ping.seq, *received.sender))


def _file_tree(params: ParamTable, onboard_log: OnboardLog) -> FileTree:
    """Return the file tree of the vehicle.

    It holds the onboard logs, the parameters in the format that ``autopilot --params`` reads, the
    same in ArduPilot's packed format, and the component metadata.
    """
    tree = FileTree()
    if onboard_log.store is not None:
        tree.add_folder("/logs", onboard_log.store.folder)
    tree.add_file(
        "/params/current.param",
        lambda: to_text({name: params.get(name) for name in params.names()}).encode(),
    )
    for with_defaults in (False, True):
        path = param_file_ftp.PATH + (param_file_ftp.WITH_DEFAULTS if with_defaults else "")
        tree.add_file(path, partial(_packed_parameters, params, with_defaults))
    tree.add_file(component_metadata.GENERAL_PATH, component_metadata.general_json)
    tree.add_file(component_metadata.PARAMETERS_PATH, component_metadata.parameters_json)
    return tree


def _packed_parameters(params: ParamTable, with_defaults: bool) -> bytes:
    """Return all parameters in ArduPilot's packed format."""
    rows = {
        row.name: param_file_ftp.PackedParameter(params.get(row.name), row.default)
        for row in PARAMETERS
    }
    return param_file_ftp.pack(rows, with_defaults)
