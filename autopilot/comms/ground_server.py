"""The ground side of the autopilot: its links, what they are told, and whom they may ask.

Heartbeats and protocol timers run on the wall clock, whatever the speed of vehicle time; telemetry
runs on vehicle time. A link is one ``Endpoint``, with its own sequence numbers and its own message
intervals."""

from collections.abc import Iterable, Sequence
from typing import Any

from autopilot.commands.failure_injection import FailureRelay
from autopilot.comms.ground_links import GroundLink, ground_link
from autopilot.comms.guard import Guard, print_error
from autopilot.comms.routing import Router
from autopilot.comms.services import Arrival, Services
from autopilot.comms.signing_keys import Keys
from autopilot.comms.statustext import Announcer
from autopilot.control.types import Stick
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_store import ParamStore
from autopilot.telemetry.identity import COMPONENT, AutopilotId
from autopilot.telemetry.request_message import MessageBuilder
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.clock import Every, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType, Values
from mavlink_io.request import MavlinkId, Send, addressed_to
from mavlink_io.transport import LinkLostError, Transport

HEARTBEAT_S = 1.0
IDLE_S = 0.05
"""How long the wall-clock side may be left alone."""
FRAMES_PER_POLL, SERVE_S = 16, 3e-3
"""Frames of one link, and wall time, that are served before the sensors are looked at again; at
least one frame is. 3 ms are a sixth of a tick of 20 ms."""

_HEARTBEAT = dialect.by_name("HEARTBEAT")


class GroundServer:
    """Tells the ground of the vehicle, and the vehicle of the ground's wishes."""

    def __init__(
        self,
        vehicle: Vehicle,
        transports: Sequence[Transport],
        autopilot: AutopilotId,
        keys: Keys | None = None,
        logbook: OnboardLog | None = None,
        store: ParamStore | None = None,
    ) -> None:
        self._vehicle = vehicle
        self._logbook, keys = logbook or OnboardLog(vehicle, None), keys or Keys()
        self._store = store or ParamStore(None)
        self._own = MavlinkId(vehicle.system, COMPONENT)
        self.links = [
            ground_link(transport, self._own.system, keys.signing(transport.address))
            for transport in transports
        ]
        self._router: Router[GroundLink] = Router(self._own)
        self._message_builder = MessageBuilder(vehicle, autopilot)
        self._announcer = Announcer(
            vehicle, self._message_builder.build, self._broadcast, self._logbook.note
        )
        self._services = Services(
            vehicle, self._announcer, self._message_builder, self._broadcast, keys, self._logbook
        )
        self._answers = {link: self._sender(link) for link in self.links}
        """The way back of each link, always the same one: by it services tell apart two clients of
        the same ids."""
        self.guard = Guard(vehicle.send_statustext)
        self._silent = False
        self._heartbeat = Every(HEARTBEAT_S)

    @property
    def failures(self) -> FailureRelay:
        return self._services.failures

    @property
    def ground_silent_s(self) -> float | None:
        """Wall seconds since a ground station's heartbeat; None before the first."""
        heard_s = self._services.ground_heard_s
        return None if heard_s is None else wall_s() - heard_s

    @property
    def stick(self) -> Stick | None:
        """The pilot's hand, None where there is none."""
        return self._services.helm.stick(self._vehicle.state, wall_s())

    @property
    def targets_silent_s(self) -> tuple[float | None, float | None]:
        """Wall seconds since an attitude and a motion set-point were heard; None before the
        first."""
        return self._services.setpoints.silent_s

    def publish_telemetry(self) -> None:
        """After a tick: the telemetry that is due, then what happened in it."""
        time_us = self._vehicle.state.time_us
        for link in self.links:
            if due := link.schedule.due(time_us):
                snapshot = self._vehicle.snapshot()
                for stream in due:
                    link.stream(stream.message, stream.build(snapshot))
                    for part, build in enumerate(stream.further, 1):
                        link.stream(stream.message, build(snapshot), part)
        self._announcer.announce()

    def relay(self, frames: Iterable[Frame]) -> None:
        """Tell the ground what the vehicle's devices say, under their own component ids."""
        for frame in frames:
            for link in self.links:
                link.relay(frame)

    def poll(self) -> float:
        """Keep the wall-clock side going: heartbeats, services, and what waits to be sent.

        Returns after how many seconds it wants to be polled again: 0 while received frames wait.
        """
        now_s, run = wall_s(), self.guard.run
        if self._heartbeat.due():
            run("heartbeat", self._beat)
        run("ground services", self._services.poll, now_s)
        self._logbook.poll()
        run(
            "parameter store", self._store.poll, self._vehicle.params, self._vehicle.send_statustext
        )
        run("announcements", self._announcer.announce)
        if any(link.wait_s(now_s) == 0.0 for link in self.links):
            self.flush()
        run("bulk services", self._services.poll_bulk, now_s)
        if any(link.backlog for link in self.links):
            return 0.0
        return min(
            (wait_s for link in self.links if (wait_s := link.wait_s(now_s))), default=IDLE_S
        )

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
            except Exception as error:
                self.guard.report("ground link", error)

    def receive(self, link: GroundLink) -> None:
        """Serve what has arrived on a link, up to the quota; the rest waits in its backlog."""
        try:
            link.take_in()
        except LinkLostError as error:
            self._drop(link, error)
            return
        except Exception as error:
            self.guard.report("ground link", error)
            return
        if self._silent:
            link.backlog.clear()
        until_s = wall_s() + SERVE_S
        for _ in range(min(FRAMES_PER_POLL, len(link.backlog))):
            self.guard.run("ground service", self._serve, link, link.backlog.popleft())
            if wall_s() > until_s:
                return

    def _serve(self, link: GroundLink, frame: Frame) -> None:
        sender = MavlinkId(frame.system, frame.component)
        if sender == self._own:
            return
        if link.meets(sender):
            for values in self._message_builder.build(_HEARTBEAT):
                link.write(_HEARTBEAT, values)
            self._router.learn(sender, link)
        if len(self.links) > 1 and self._vehicle.params.config.forwards:
            for other in self._router.onward(frame, link, self.links):
                other.forward(frame)
        if not self._services.hears(frame.message_id):
            return
        message = frame.decode()
        if addressed_to(message, self._own):
            self._services.feed(Arrival(link, frame, message, self._answers[link]))
            self._logbook.hear(frame)
            self._announcer.announce()
            link.hasten()

    def _beat(self) -> None:
        for values in self._message_builder.build(_HEARTBEAT):
            self._broadcast(_HEARTBEAT, values)

    def _sender(self, link: GroundLink) -> Send:
        """How a service answers on a link: what happened is told before the answer that came of
        it."""

        def send(name: str, **fields: Any) -> None:
            self._announcer.announce()
            message = dialect.by_name(name)
            link.write(message, message.values(**fields))

        return send

    def _broadcast(self, message: MessageType, values: Values) -> None:
        self._logbook.note(message, values)
        for link in self.links:
            link.write(message, values)

    def _drop(self, link: GroundLink, error: LinkLostError) -> None:
        if link in self.links:
            self.links.remove(link)
            self._router.forget(link)
            link.transport.close()
            print_error(f"ground link lost: {error}")
