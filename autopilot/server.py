"""The ground side of the autopilot: every MAVLink service, on every link.

Heartbeats and protocol timers run on the wall clock, whatever the speed of vehicle time; telemetry runs on vehicle
time. A link is one ``Endpoint``, with its own sequence numbers and its own message intervals.
"""

import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from autopilot import identity, telemetry
from autopilot.failures import INJECT_FAILURE, FailureRelay
from autopilot.identity import COMPONENT, AutopilotId
from autopilot.keys import Keys
from autopilot.links import GroundLink, ground_link
from autopilot.logbook.book import Logbook
from autopilot.mav_cmd import Commander, command_from_message
from autopilot.requests import SetMode
from autopilot.routing import Router
from autopilot.shown_files import file_tree
from autopilot.telemetry import Values
from autopilot.types import Event, ItemReached, Stick
from autopilot.vehicle import MissionStore, Vehicle
from link import dialect
from link.clock import Every, wall_s
from link.codec import Frame
from link.dialect import MessageType, constant
from link.exchange import Party, Send, addressed_to
from link.files.server import FileServer
from link.logs.server import LogServer
from link.mission_server import MissionServer
from link.params import ParamServer
from link.transport import LinkLostError, Transport

HEARTBEAT_S = 1.0
STICK_LASTS_S = 1.5
"""A pilot's hand that was not heard of for longer has let go."""
STATUSTEXT_BYTES = 50
IDLE_S = 0.05
"""How long the wall-clock side may be left alone."""

_GROUND_STATION = constant("MAV_TYPE_GCS")
_NOT_GIVEN = 32_767
"""MANUAL_CONTROL's mark of an axis that the stick lacks."""
_STICK_FULL = 1000.0
_HEARTBEAT, _CURRENT_MODE = dialect.by_name("HEARTBEAT"), dialect.by_name("CURRENT_MODE")
_ACKNOWLEDGEMENT = dialect.by_name("COMMAND_ACK")
_STATUSTEXT, _ITEM_REACHED = dialect.by_name("STATUSTEXT"), dialect.by_name("MISSION_ITEM_REACHED")


Handler = Callable[[GroundLink, Frame, Any], None]


class GroundServer:
    """Tells the ground of the vehicle, and the vehicle of the ground's wishes."""

    def __init__(
        self,
        vehicle: Vehicle,
        transports: Sequence[Transport],
        autopilot: AutopilotId,
        keys: Keys | None = None,
        logbook: Logbook | None = None,
    ) -> None:
        self._vehicle, self._autopilot = vehicle, autopilot
        self._logbook = logbook or Logbook(vehicle, None)
        self._own = Party(vehicle.params.config.system_id, COMPONENT)
        self._keys = keys or Keys()
        self.links = [
            ground_link(transport, self._own.system, self._keys.signing(transport.address)) for transport in transports
        ]
        self._router: Router[GroundLink] = Router(self._own)
        self._commander = Commander(vehicle, self._message, self._own.system)
        self._missions = MissionServer(MissionStore(vehicle))
        self._params = ParamServer(vehicle.params, self._broadcast, vehicle.say)
        self.files = FileServer(file_tree(vehicle.params, self._logbook))
        self._logs = LogServer(self._logbook, vehicle.say, lambda: vehicle.state.armed)
        self.failures = FailureRelay(vehicle.say)
        self._silent = False
        self._heartbeat = Every(HEARTBEAT_S)
        self._announced = self._condition()
        self._ground_heard_s: float | None = None
        self._stick: tuple[Stick, float] | None = None
        self._long_texts = 0
        self._handlers = self._table()

    def _table(self) -> dict[int, Handler]:
        handlers: dict[str, Handler] = {
            "HEARTBEAT": self._hear_heartbeat,
            "COMMAND_LONG": self._obey,
            "COMMAND_INT": self._obey,
            "SET_MODE": self._set_mode,
            "MANUAL_CONTROL": self._take_stick,
            "TIMESYNC": self._tell_time,
            "PING": self._answer_ping,
            "SETUP_SIGNING": self._change_key,
        }
        handlers |= dict.fromkeys(MissionServer.hears, self._serve_mission)
        handlers |= dict.fromkeys(ParamServer.hears, self._serve_params)
        handlers |= dict.fromkeys(FileServer.hears, self._serve_files)
        handlers |= dict.fromkeys(LogServer.hears, self._serve_logs)
        return {dialect.by_name(name).message_id: handler for name, handler in handlers.items()}

    @property
    def ground_silent_s(self) -> float | None:
        """Wall seconds since a ground station's heartbeat; None before the first."""
        return None if self._ground_heard_s is None else wall_s() - self._ground_heard_s

    @property
    def stick(self) -> Stick | None:
        """The pilot's hand, None where there is none."""
        if self._stick is None or wall_s() - self._stick[1] > STICK_LASTS_S:
            return None
        return self._stick[0]

    def tell(self) -> None:
        """After a tick: the telemetry that is due, then what happened in it."""
        time_us = self._vehicle.state.time_us
        for link in self.links:
            if due := link.schedule.due(time_us):
                snapshot = self._vehicle.snapshot()
                for stream in due:
                    link.stream(stream.message, stream.build(snapshot))
        self.announce()

    def relay(self, frames: Iterable[Frame]) -> None:
        """Tell the ground what the vehicle's devices say, under their own component ids."""
        for frame in frames:
            for link in self.links:
                link.relay(frame)

    def announce(self) -> None:
        """Send what happened since the last call, and the mode at once when it changed."""
        for event in self._vehicle.take_events():
            self._tell_event(event)
        condition = self._condition()
        if condition != self._announced:
            self._announced = condition
            for message in (_CURRENT_MODE, _HEARTBEAT):
                self._broadcast_values(message, self._message(message) or ())

    def poll(self) -> float:
        """Keep the wall-clock side going: heartbeats, mission timers, parameter lists, and what waits to be sent.

        Returns after how many seconds it wants to be polled again.
        """
        now_s = wall_s()
        if self._heartbeat.due():
            self._broadcast_values(_HEARTBEAT, self._message(_HEARTBEAT) or ())
        self._missions.poll(now_s)
        self._params.poll()
        self.failures.poll(now_s)
        self._logbook.poll()
        if complaint := self._keys.save_when_due():
            self._vehicle.say(complaint)
        self.announce()
        if any(link.wait_s(now_s) == 0.0 for link in self.links):
            self.flush()
        self.files.poll(now_s)
        self._logs.poll()
        return min((wait_s for link in self.links if (wait_s := link.wait_s(now_s))), default=IDLE_S)

    def silence(self, wanted: bool) -> None:
        """Cut every link, both ways, or join it again: what a simulated loss of the link does."""
        if wanted:
            self.flush()
        self._silent = wanted

    def flush(self) -> None:
        """Send all that waits. A link that breaks is the ground's loss, never the vehicle's."""
        for link in list(self.links):
            try:
                link.flush(wall_s(), lost=self._silent)
            except LinkLostError as error:
                self._drop(link, error)

    def receive(self, link: GroundLink) -> None:
        """Serve what has arrived on a link."""
        try:
            frames = link.endpoint.receive()
        except LinkLostError as error:
            self._drop(link, error)
            return
        for frame in () if self._silent else frames:
            self._serve(link, frame)

    def _serve(self, link: GroundLink, frame: Frame) -> None:
        sender = Party(frame.system, frame.component)
        if sender == self._own:
            return
        if link.meets(sender):
            link.write(_HEARTBEAT, self._message(_HEARTBEAT) or ())
            self._router.learn(sender, link)
        if len(self.links) > 1 and self._vehicle.params.config.forwards:
            for other in self._router.onward(frame, link, self.links):
                other.forward(frame)
        handler = self._handlers.get(frame.message_id)
        if handler is None:
            return
        message = frame.decode()
        if addressed_to(message, self._own):
            handler(link, frame, message)
            self._logbook.hear(frame)
            self.announce()
            link.hasten()

    def _hear_heartbeat(self, link: GroundLink, frame: Frame, message: Any) -> None:
        if message.type == _GROUND_STATION:
            self._ground_heard_s = wall_s()

    def _obey(self, link: GroundLink, frame: Frame, message: Any) -> None:
        def acknowledge(result: int) -> None:
            self.announce()
            answer = message.command, result, 0, 0, frame.system, frame.component
            self._logbook.note(_ACKNOWLEDGEMENT, answer)
            link.write(_ACKNOWLEDGEMENT, answer)
            link.hasten()

        command = command_from_message(message)
        if command.number == INJECT_FAILURE:
            enabled, asker = bool(self._vehicle.params.config.failure_enabled), Party(frame.system, frame.component)
            self.failures.ask(command, asker, acknowledge, enabled, wall_s())
            return
        outcome = self._commander.execute(command, link.schedule)
        acknowledge(outcome.result)
        for answer, values in outcome.messages:
            link.write(answer, values)

    def _set_mode(self, link: GroundLink, frame: Frame, message: Any) -> None:
        """The old way to set a mode: never acknowledged, so the heartbeat tells what became of it."""
        self._vehicle.request(SetMode(message.custom_mode))
        self._announced = None

    def _take_stick(self, link: GroundLink, frame: Frame, message: Any) -> None:
        """Stick forward (x) is nose down, twist (r) is rudder, lever (z) is thrust."""
        if message.target not in (0, self._own.system):
            return
        nose_down, rudder, thrust = (
            0.0 if axis == _NOT_GIVEN else max(-1.0, min(1.0, axis / _STICK_FULL))
            for axis in (message.x, message.r, message.z)
        )
        self._stick = Stick(rudder, -nose_down, thrust), wall_s()

    def _tell_time(self, link: GroundLink, frame: Frame, message: Any) -> None:
        if message.tc1 == 0:
            link.write(dialect.by_name("TIMESYNC"), (round(wall_s() * 1e9), message.ts1))

    def _answer_ping(self, link: GroundLink, frame: Frame, message: Any) -> None:
        if message.target_system == 0:
            ping = dialect.by_name("PING")
            link.write(ping, (message.time_usec, message.seq, frame.system, frame.component))

    def _change_key(self, link: GroundLink, frame: Frame, message: Any) -> None:
        told = self._keys.change(message, link.endpoint.signing, link.trusted, self._vehicle.state.armed)
        self._vehicle.say(told)

    def _serve_mission(self, link: GroundLink, frame: Frame, message: Any) -> None:
        self._missions.feed(frame, self._sender(link), wall_s())

    def _serve_params(self, link: GroundLink, frame: Frame, message: Any) -> None:
        self._params.feed(frame, self._sender(link), link.room_bytes)

    def _serve_files(self, link: GroundLink, frame: Frame, message: Any) -> None:
        self.files.feed(frame, self._sender(link), link.room_bytes, wall_s())

    def _serve_logs(self, link: GroundLink, frame: Frame, message: Any) -> None:
        self._logs.feed(frame, self._sender(link), link.room_bytes)

    def _condition(self) -> tuple[int, bool, int] | None:
        state = self._vehicle.state
        return state.mode, state.armed, identity.system_status(state)

    def _message(self, message: MessageType) -> Values | None:
        """The fields of any message that can be asked for, None for one that cannot."""
        snapshot = self._vehicle.snapshot()
        if message is _HEARTBEAT:
            return identity.heartbeat(snapshot.state, self._autopilot)
        if message.name == "AUTOPILOT_VERSION":
            return identity.autopilot_version(self._own.system)
        stream = telemetry.BY_ID.get(message.message_id)
        return None if stream is None else stream.build(snapshot)

    def _tell_event(self, event: Event | ItemReached) -> None:
        if isinstance(event, ItemReached):
            self._broadcast_values(_ITEM_REACHED, (event.sequence,))
            return
        text = event.text.encode()
        chunks = [text[at : at + STATUSTEXT_BYTES] for at in range(0, len(text), STATUSTEXT_BYTES)]
        number = 0
        if len(chunks) > 1:
            self._long_texts = self._long_texts % 0xFFFF + 1
            number = self._long_texts
        for position, chunk in enumerate(chunks):
            self._broadcast_values(_STATUSTEXT, (int(event.severity), chunk, number, position))

    def _sender(self, link: GroundLink) -> Send:
        """How a service answers on a link: what happened is told before the answer that came of it."""

        def send(name: str, **fields: Any) -> None:
            self.announce()
            message = dialect.by_name(name)
            link.write(message, message.values(**fields))

        return send

    def _broadcast(self, name: str, **fields: Any) -> None:
        message = dialect.by_name(name)
        self._broadcast_values(message, message.values(**fields))

    def _broadcast_values(self, message: MessageType, values: Values) -> None:
        self._logbook.note(message, values)
        for link in self.links:
            link.write(message, values)

    def _drop(self, link: GroundLink, error: LinkLostError) -> None:
        if link in self.links:
            self.links.remove(link)
            self._router.forget(link)
            link.transport.close()
            print(f"autopilot: ground link lost: {error}", file=sys.stderr, flush=True)
