"""The ground side of the autopilot: links, heartbeats, telemetry and services.

Heartbeats and protocol timers run on the wall clock, whatever the speed of vehicle time; telemetry
runs on vehicle time. Each link has its own ``Endpoint``, sequence numbers and message intervals.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from autopilot.commands.failure_injection import FailureRelay
from autopilot.comms.ground_links import GroundLink, ground_link
from autopilot.comms.guard import Guard, print_error
from autopilot.comms.routing import Router
from autopilot.comms.services import ReceivedMessage, Services
from autopilot.comms.signing_keys import SigningKeys
from autopilot.comms.statustext import EventPublisher
from autopilot.control.types import Stick
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_store import ParamStore
from autopilot.telemetry.identity import COMPONENT, AutopilotId
from autopilot.telemetry.request_message import MessageBuilder
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.clock import Interval, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType, Values
from mavlink_io.request import MavlinkId, Send, addressed_to
from mavlink_io.transport import LinkLostError, Transport

HEARTBEAT_S = 1.0
IDLE_S = 0.05
"""Longest time between two polls."""
MAX_FRAMES_PER_POLL, MAX_PROCESSING_S = 16, 3e-3
"""Frames of one link, and wall time, that are processed before the sensors are read again.

At least one frame is processed. 3 ms is about a sixth of a tick of 20 ms."""

_HEARTBEAT = dialect.by_name("HEARTBEAT")


class GroundServer:
    """Sends telemetry to the ground links and passes received messages to the services."""

    def __init__(
        self,
        vehicle: Vehicle,
        transports: Sequence[Transport],
        autopilot: AutopilotId,
        keys: SigningKeys | None = None,
        onboard_log: OnboardLog | None = None,
        store: ParamStore | None = None,
    ) -> None:
        self._vehicle = vehicle
        self._onboard_log, keys = onboard_log or OnboardLog(vehicle, None), keys or SigningKeys()
        self._store = store or ParamStore(None)
        self._own = MavlinkId(vehicle.system, COMPONENT)
        self.links = [
            ground_link(transport, self._own.system, keys.signing(transport.address))
            for transport in transports
        ]
        self._router: Router[GroundLink] = Router(self._own)
        self._message_builder = MessageBuilder(vehicle, autopilot)
        self._event_publisher = EventPublisher(
            vehicle, self._message_builder.build, self._broadcast, self._onboard_log.log_sent
        )
        self._services = Services(
            vehicle,
            self._event_publisher,
            self._message_builder,
            self._broadcast,
            keys,
            self._onboard_log,
        )
        self._reply_functions = {link: self._reply_function(link) for link in self.links}
        """Reply function of each link, always the same object.

        Services use its identity to distinguish two clients with the same ids."""
        self.guard = Guard(vehicle.send_statustext)
        self._silent = False
        self._heartbeat = Interval(HEARTBEAT_S)

    @property
    def failures(self) -> FailureRelay:
        """Relay of failure-injection commands to the simulator."""
        return self._services.failures

    @property
    def ground_silent_s(self) -> float | None:
        """Wall seconds since a ground station's heartbeat; None before the first."""
        received_s = self._services.ground_received_s
        return None if received_s is None else wall_s() - received_s

    @property
    def stick(self) -> Stick | None:
        """Present manual-control input; None without one."""
        return self._services.helm.stick(self._vehicle.state, wall_s())

    @property
    def targets_silent_s(self) -> tuple[float | None, float | None]:
        """Wall seconds since the last attitude and motion set-point; None before the first."""
        return self._services.setpoints.silent_s

    def publish_telemetry(self) -> None:
        """Queue the telemetry that is due after a tick, then the events of the tick."""
        time_us = self._vehicle.state.time_us
        for link in self.links:
            if due := link.schedule.due(time_us):
                snapshot = self._vehicle.snapshot()
                for stream in due:
                    link.stream(stream.message, stream.build(snapshot))
                    for part, build in enumerate(stream.more_builders, 1):
                        link.stream(stream.message, build(snapshot), part)
        self._event_publisher.publish()

    def relay(self, frames: Iterable[Frame]) -> None:
        """Queue messages of onboard devices for the ground, with their own component ids."""
        for frame in frames:
            for link in self.links:
                link.relay(frame)

    def poll(self) -> float:
        """Run what depends on the wall clock: heartbeats, services and queued frames.

        Return the seconds until the next poll is due: 0 while received frames wait.
        """
        now_s, run = wall_s(), self.guard.run
        if self._heartbeat.due():
            run("heartbeat", self._send_heartbeat)
        run("ground services", self._services.poll, now_s)
        self._onboard_log.poll()
        run(
            "parameter store", self._store.poll, self._vehicle.params, self._vehicle.send_statustext
        )
        run("announcements", self._event_publisher.publish)
        if any(link.wait_s(now_s) == 0.0 for link in self.links):
            self.flush()
        run("bulk services", self._services.poll_bulk, now_s)
        if any(link.backlog for link in self.links):
            return 0.0
        return min(
            (wait_s for link in self.links if (wait_s := link.wait_s(now_s))), default=IDLE_S
        )

    def silence(self, silent: bool) -> None:
        """Block or unblock all links in both directions: a simulated loss of the ground link."""
        if silent:
            self.flush()
        self._silent = silent

    def flush(self) -> None:
        """Send all queued frames; drop a link that is lost, and continue."""
        for link in list(self.links):
            try:
                link.flush(wall_s(), discard=self._silent)
            except LinkLostError as error:
                self._drop(link, error)
            except Exception as error:
                self.guard.report("ground link", error)

    def receive(self, link: GroundLink) -> None:
        """Process received frames of a link up to the quota; the others wait in its backlog."""
        try:
            link.read_pending()
        except LinkLostError as error:
            self._drop(link, error)
            return
        except Exception as error:
            self.guard.report("ground link", error)
            return
        if self._silent:
            link.backlog.clear()
        until_s = wall_s() + MAX_PROCESSING_S
        for _ in range(min(MAX_FRAMES_PER_POLL, len(link.backlog))):
            self.guard.run("ground service", self._process, link, link.backlog.popleft())
            if wall_s() > until_s:
                return

    def _process(self, link: GroundLink, frame: Frame) -> None:
        """Forward a frame, and serve it when it is addressed to this vehicle."""
        sender = MavlinkId(frame.system, frame.component)
        if sender == self._own:
            return
        if link.register_sender(sender):
            for values in self._message_builder.build(_HEARTBEAT):
                link.write(_HEARTBEAT, values)
            self._router.learn(sender, link)
        if len(self.links) > 1 and self._vehicle.params.config.forwards:
            for other in self._router.destinations(frame, link, self.links):
                other.forward(frame)
        if not self._services.handles(frame.message_id):
            return
        message = frame.decode()
        if addressed_to(message, self._own):
            self._services.feed(
                ReceivedMessage(
                    link=link, frame=frame, message=message, send=self._reply_functions[link]
                )
            )
            self._onboard_log.log_received(frame)
            self._event_publisher.publish()
            link.flush_soon()

    def _send_heartbeat(self) -> None:
        """Queue HEARTBEAT on all links."""
        for values in self._message_builder.build(_HEARTBEAT):
            self._broadcast(_HEARTBEAT, values)

    def _reply_function(self, link: GroundLink) -> Send:
        """Return the function by which services reply on a link.

        Pending events are sent before the reply.
        """

        def send(name: str, **fields: Any) -> None:
            """Queue a reply by message name and fields."""
            self._event_publisher.publish()
            message = dialect.by_name(name)
            link.write(message, message.values(**fields))

        return send

    def _broadcast(self, message: MessageType, values: Values) -> None:
        """Log a message and queue it on all links."""
        self._onboard_log.log_sent(message, values)
        for link in self.links:
            link.write(message, values)

    def _drop(self, link: GroundLink, error: LinkLostError) -> None:
        """Close a link that is lost, and report it on standard error."""
        if link in self.links:
            self.links.remove(link)
            self._router.forget(link)
            link.transport.close()
            print_error(f"ground link lost: {error}")
