"""The ground side of the autopilot: links, heartbeats, telemetry and services.

Heartbeats and protocol timers run on the wall clock, whatever the speed of vehicle time; telemetry
runs on vehicle time. Each link has its own ``Endpoint``, sequence numbers and message intervals.
"""

from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from typing import Any

from autopilot.commands.failure_injection import FailureRelay
from autopilot.comms.commanders import COMMANDS, Commanders
from autopilot.comms.ground_links import GroundLink, ground_link
from autopilot.comms.guard import Guard, print_error
from autopilot.comms.routing import Router
from autopilot.comms.services import ReceivedMessage, Services
from autopilot.comms.signing_keys import SigningKeys
from autopilot.comms.statustext import EventPublisher
from autopilot.comms.stream_rates import NEVER_US
from autopilot.control.types import DENIED, Stick
from autopilot.identities import IDENTITIES
from autopilot.lateness import Lateness
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_store import ParamStore
from autopilot.reports import Snapshot, SteadyReport
from autopilot.steady_ticks import TELEMETRY
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.telemetry.identity import COMPONENT
from autopilot.telemetry.request_message import MessageBuilder
from autopilot.telemetry.streams import TelemetryStream
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
LATENESS_NAMES = ("LATE_P50", "LATE_P99", "LATE_MAX", "LATE_OVR")
"""Names of NAMED_VALUE_FLOAT: lateness of the ticks in ms, and number of overruns."""
LATENESS_PART = 100
"""First part number of these messages in the queue of a slow line; streams use smaller ones."""
LATENESS_REPORT_S = 60.0
"""Shortest time between two texts about overruns."""
FLOOD_REPORT_S = 10.0
"""Shortest time between two reports of dropped messages."""
MAX_FRAMES_PER_POLL, MAX_PROCESSING_S = 16, 3e-3
"""Frames of one link, and wall time of all links, before the sensors are read again.

At least one frame is processed. 3 ms is about a sixth of a tick of 20 ms."""

_NAMED_VALUE = dialect.by_name("NAMED_VALUE_FLOAT")
_HEARTBEAT, _COMMAND_ACK = dialect.by_name("HEARTBEAT"), dialect.by_name("COMMAND_ACK")
_HIGH_LATENCY, _PARAM_VALUE = dialect.by_name("HIGH_LATENCY2"), dialect.by_name("PARAM_VALUE")


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
        commanders: Commanders | None = None,
        modems: Mapping[str, float] | None = None,
    ) -> None:
        """``modems`` has the time between two HIGH_LATENCY2 (s) by address of a modem's link."""
        self._vehicle, identity = vehicle, IDENTITIES[autopilot]
        self._onboard_log, keys = onboard_log or OnboardLog(vehicle, None), keys or SigningKeys()
        self._store, self._commanders = store or ParamStore(None), commanders or Commanders()
        self._own = MavlinkId(vehicle.system, COMPONENT)
        encoder = import_module(TELEMETRY).FrameEncoder() if vehicle.compiled else None
        self.links = [
            ground_link(
                transport,
                self._own.system,
                keys.signing(transport.address),
                identity.streams,
                (modems or {}).get(transport.address),
                encoder,
            )
            for transport in transports
        ]
        self._router: Router[GroundLink] = Router(self._own)
        self._message_builder = MessageBuilder(vehicle, identity)
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
            identity,
        )
        self._reply_functions = {link: self._reply_function(link) for link in self.links}
        """Reply function of each link, always the same object.

        Services use its identity to distinguish two clients with the same ids."""
        self.guard = Guard(vehicle.send_statustext)
        self._silent = False
        self._answered_link: GroundLink | None = None
        """Link of the message that is being processed."""
        self._heartbeat = Interval(HEARTBEAT_S)
        self._flood_report = Interval(FLOOD_REPORT_S)
        self._lateness_report = Interval(LATENESS_REPORT_S)

    @property
    def failures(self) -> FailureRelay:
        """Relay of failure-injection commands to the simulator."""
        return self._services.failures

    @property
    def ground_silent_s(self) -> float | None:
        """Wall seconds since a ground station's heartbeat; None before the first."""
        received_s = self._services.ground_received_s
        return None if received_s is None else wall_s() - received_s

    def continue_ground_timeout(self) -> None:
        """Count the silence of a ground station that a process before this one received."""
        self._services.ground_received_s = wall_s()

    @property
    def stick(self) -> Stick | None:
        """Present manual-control input; None without one."""
        helm = self._services.helm
        return helm.stick(self._vehicle.state, wall_s()) if helm.in_use else None

    @property
    def targets_silent_s(self) -> tuple[float | None, float | None]:
        """Wall seconds since the last attitude and motion set-point; None before the first."""
        return self._services.setpoints.silent_s

    @property
    def snapshot_due_us(self) -> int:
        """Vehicle time of the next tick whose telemetry needs the whole state after that tick."""
        return min((link.schedule.snapshot_due_us for link in self.links), default=NEVER_US)

    def publish_telemetry(self, reports: Sequence[SteadyReport] = ()) -> None:
        """Queue what each of the newest ticks relays and has due, then their events.

        Without ``reports`` there was one tick, which relays nothing here. Only in the last tick may
        a message be due that needs the state of the vehicle.
        """
        for report in reports or (self._vehicle.report(),):
            if report.relayed:
                self.guard.run("relay of devices", self.relay, report.relayed)
            snapshot = None
            for link in self.links:
                for group in link.schedule.due(report.time_us):
                    if group.of_tick:
                        link.publish(group, report)
                    else:
                        snapshot = snapshot or self._vehicle.snapshot()
                        self._publish_slowly(link, group.streams, snapshot)
        self._event_publisher.publish()

    def _publish_slowly(
        self, link: GroundLink, streams: Iterable[TelemetryStream], snapshot: Snapshot
    ) -> None:
        """Queue the messages of streams that need the whole state."""
        for stream in streams:
            for part, build in enumerate(stream.builders):
                try:
                    link.stream(stream.message, build(snapshot), part)
                except Exception as error:  # the other messages are sent
                    self.guard.report("telemetry", error)

    def publish_lateness(self, lateness: Lateness) -> None:
        """Queue and log the lateness of the ticks; report overruns as a text."""
        time_ms = self._vehicle.time_us // 1000 & 0xFFFF_FFFF
        values = zip(LATENESS_NAMES, lateness, strict=False)
        for part, (name, value) in enumerate(values, LATENESS_PART):
            fields = time_ms, float(value), name.encode()
            self._onboard_log.log_sent(_NAMED_VALUE, fields)
            for link in self._telemetry_links():
                link.stream(_NAMED_VALUE, fields, part)
        if lateness.new_overruns and self._lateness_report.due():
            self._vehicle.send_statustext(
                f"{lateness.new_overruns} ticks late by more than {lateness.interval_ms:.0f} ms;"
                f" p99 {lateness.p99_ms:.0f}, at most {lateness.max_ms:.0f} ms"
            )

    def relay(self, frames: Iterable[Frame]) -> None:
        """Queue messages of onboard devices for the ground, with their own component ids."""
        for frame in frames:
            for link in self._telemetry_links():
                link.relay(frame)

    def poll(self) -> float:
        """Run what depends on the wall clock: heartbeats, services and queued frames.

        Return the seconds until the next poll is due: 0 while received frames wait.
        """
        now_s, run = wall_s(), self.guard.run
        if self._heartbeat.due():
            run("heartbeat", self._send_heartbeat)
        run("high latency", self._send_high_latency, now_s)
        if not run("ground services", self._services.poll, now_s):
            self._services.restart()
        self._onboard_log.poll()
        run(
            "parameter store", self._store.poll, self._vehicle.params, self._vehicle.send_statustext
        )
        run("announcements", self._event_publisher.publish)
        if any(link.wait_s(now_s) == 0.0 for link in self.links):
            self.flush()
        if not run("bulk services", self._services.poll_bulk, now_s):
            self._services.restart()
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
            errors, link.errors = link.errors, []
            for failure in errors:
                self.guard.report("telemetry", failure)

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
        self._report_flood(link)
        until_s = wall_s() + MAX_PROCESSING_S / len(self.links)
        for _ in range(MAX_FRAMES_PER_POLL):
            if not link.backlog:
                return
            if not self.guard.run("ground service", self._process, link, link.backlog.pop()):
                self._services.restart()
            if wall_s() > until_s:
                return

    def _report_flood(self, link: GroundLink) -> None:
        """Report messages that were dropped because their sender sends too many."""
        if link.backlog.dropped and self._flood_report.due():
            dropped, link.backlog.dropped = link.backlog.dropped, 0
            self._vehicle.send_statustext(
                f"Link {link.transport.address}: {dropped} messages of a flood dropped"
            )

    def _process(self, link: GroundLink, frame: Frame) -> None:
        """Forward a frame, and serve it when it is addressed to this vehicle."""
        sender = MavlinkId(frame.system, frame.component)
        if sender == self._own:
            return
        if link.register_sender(sender):
            if not link.schedule.answers_only:
                for values in self._message_builder.build(_HEARTBEAT):
                    link.write(_HEARTBEAT, values)
            self._router.learn(sender, link)
        if len(self.links) > 1 and self._vehicle.params.config.forwards:
            for other in self._router.destinations(frame, link, self.links):
                if not other.schedule.answers_only:
                    other.forward(frame)
        if not self._services.handles(frame.message_id):
            return
        message = frame.decode()
        if addressed_to(message, self._own) and self._may_command(link, frame):
            received = ReceivedMessage(
                link=link, frame=frame, message=message, send=self._reply_functions[link]
            )
            self._answered_link = link
            try:
                self._services.feed(received)
            finally:
                self._answered_link = None
            self._onboard_log.log_received(frame)
            self._event_publisher.publish()
            link.flush_soon()

    def _may_command(self, link: GroundLink, frame: Frame) -> bool:
        """Return whether a message is served; answer a refused command, and report it once."""
        if self._commanders.accepts(frame):
            return True
        if text := self._commanders.report(frame):
            self._vehicle.send_statustext(text)
        if frame.message_id in COMMANDS:
            values = frame.decode().command, DENIED, 0, 0, frame.system, frame.component
            link.write(_COMMAND_ACK, values)
            link.flush_soon()
        return False

    def _send_heartbeat(self) -> None:
        """Queue HEARTBEAT on all links."""
        for values in self._message_builder.build(_HEARTBEAT):
            self._broadcast(_HEARTBEAT, values)

    def _send_high_latency(self, now_s: float) -> None:
        """Queue HIGH_LATENCY2 on the links on which it is due."""
        for link in self.links:
            if link.schedule.high_latency_due(now_s):
                for values in self._message_builder.build(_HIGH_LATENCY):
                    link.write(_HIGH_LATENCY, values)

    def _telemetry_links(self) -> list[GroundLink]:
        """Return the links that carry more than answers and HIGH_LATENCY2."""
        return [link for link in self.links if not link.schedule.answers_only]

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
        """Log a message and queue it on all links; on a modem only the answer to its PARAM_SET."""
        self._onboard_log.log_sent(message, values)
        for link in self.links:
            is_answer = message is _PARAM_VALUE and link is self._answered_link
            if is_answer or not link.schedule.answers_only:
                link.write(message, values)

    def _drop(self, link: GroundLink, error: LinkLostError) -> None:
        """Close a link that is lost, and report it on standard error."""
        if link in self.links:
            self.links.remove(link)
            self._router.forget(link)
            link.transport.close()
            print_error(f"ground link lost: {error}")
