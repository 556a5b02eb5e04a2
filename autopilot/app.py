"""The main loop: answer the sensor samples first, then serve the ground links."""

import math
from collections.abc import Callable, Sequence

from autopilot.comms import sensor_clock
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink, HilSample
from autopilot.comms.sensor_clock import SensorClock, StampClass
from autopilot.control.types import US_PER_S, Inputs, Severity
from autopilot.lateness import LatenessMeter
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.reports import SteadyReport
from autopilot.resume import StateFiles
from autopilot.steady_ticks import Expected
from autopilot.vehicle import Vehicle
from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import SPIN_S, wait

SENSOR_SILENCE_S = 1.0
"""Wall time without a sample after which the sensors of a vehicle are reported as silent.

It does not apply in lockstep, where a simulator may pause."""
BURST_S = 5e-3
"""Wall time for which only the HIL link of a running simulation is served.

The other links wait for it; it is a quarter of the time over which telemetry is batched."""
WRONG_BAUD_BYTES = 1000
"""Number of bytes without MAVLink, before the first sample, that indicates a wrong baud rate."""
WRONG_BAUD_PERIOD_S = 10.0
"""Wall time between reports of a wrong baud rate: a ground station may connect after the first."""


class App:
    """Connects the vehicle to the HIL link, the ground links and the onboard log."""

    def __init__(
        self,
        vehicle: Vehicle,
        hil: HilLink,
        ground: GroundServer,
        onboard_log: OnboardLog,
        files: StateFiles | None = None,
    ) -> None:
        self._vehicle, self._hil = vehicle, hil
        self._ground, self._onboard_log = ground, onboard_log
        self._files = files or StateFiles(None, vehicle.system, "")
        self._clock = SensorClock()
        self._received_s = 0.0
        """Wall time of the newest HIL traffic."""
        self._baud_rate_report_s = -math.inf
        self._non_mavlink_bytes = 0
        self._accepted_s = 0.0
        """Wall time at which a sample was last accepted."""
        self._timeout_reported = False
        self._lateness = LatenessMeter()

    def continue_from(self, clock: SensorClock) -> None:
        """Continue with the check of time stamps of a process that has ended."""
        self._clock = clock

    def continue_ground_timeout(self) -> None:
        """Count the silence of a ground station that a process before this one received."""
        self._ground.continue_ground_timeout()

    def run(self, stopping: Callable[[], bool]) -> None:
        """Serve the links until ``stopping`` returns true.

        Raises LinkLostError when the HIL link is lost and cannot be opened again.
        """
        try:
            while not stopping():
                self.step(self._ground.poll())
                self._serve_lockstep()
            self._ground.flush()
        finally:
            self._onboard_log.close()

    def step(self, timeout_s: float) -> None:
        """Wait for data on any link, and process it."""
        links = {link.transport: link for link in self._ground.links}
        ready = wait(
            [self._hil.transport, *links], 0.0 if self._simulator_is_running() else timeout_s
        )
        if self._hil.transport in ready:
            self._serve_hil()
        for transport, link in links.items():
            if link.backlog or transport in ready:
                self._ground.receive(link)
        for order in self._ground.failures.pop_orders():
            self._hil.send_failure_order(order)
        self._check_sensor_timeout()
        self._ground.guard.run("state on disk", self._store_state)

    def _store_state(self) -> None:
        """Store a changed mission, and the state of an armed vehicle for a restart."""
        self._files.poll(
            lambda: self._vehicle.state,
            self._clock,
            self._vehicle.intended_mode,
            self._ground.ground_silent_s is not None,
            self._vehicle.send_statustext,
        )

    def _serve_lockstep(self) -> None:
        """Answer a simulator that sends without a pause; the other links wait for `BURST_S`."""
        until_s = wall_s() + BURST_S
        while self._simulator_is_running() and self._received_s < until_s:
            if self._exchange(until_s):
                continue
            if not self._serve_hil(eager=True):
                break

    def _exchange(self, until_s: float) -> bool:
        """Answer the samples of steady ticks in compiled code; return whether more may follow.

        The first other datagram is left to ``_serve_hil``. The exchange also ends with a tick whose
        telemetry needs the whole state of the vehicle, and at the wall time ``until_s``.
        """
        vehicle, ground, clock = self._vehicle, self._ground, self._clock
        if not (
            clock.is_regular
            and not self._hil.has_waiting_frames
            and ground.stick is None
            and self._onboard_log.store is None
            and vehicle.allows_exchange(ground.ground_silent_s)
        ):
            return False
        step_us = clock.interval_us
        expected = Expected(
            time_us=clock.newest_us + step_us,
            interval_us=step_us,
            ticks=max(1, math.ceil((ground.snapshot_due_us - clock.newest_us) / step_us)),
            duration_s=max(0.0, until_s - self._received_s),
        )
        reports = vehicle.exchange(self._hil.endpoint, expected)
        if reports:
            self._received_s = self._accepted_s = wall_s()
            self._clock = clock._replace(newest_us=vehicle.time_us)
            self._report(vehicle.time_us, reports=reports)
        return bool(reports) and not self._hil.endpoint.has_unread

    def _simulator_is_running(self) -> bool:
        """Return whether the next sample of a simulator in lockstep is expected at once."""
        return self._hil.lockstep and wall_s() - self._received_s < SPIN_S

    def _serve_hil(self, *, eager: bool = False) -> bool:
        """Process what has arrived on the HIL link; return whether anything has."""
        samples = self._hil.receive(eager=eager)
        if samples is None:
            return False
        self._received_s = wall_s()
        silent_us = round((self._received_s - self._accepted_s) * US_PER_S)
        for sample in samples:
            if self._accept(sample, silent_us):
                self._accepted_s, self._timeout_reported = self._received_s, False
        if error := self._hil.pop_error():
            self._vehicle.send_statustext(error, Severity.ERROR)
        for result in self._hil.pop_failure_results():
            self._ground.guard.run("failure injection", self._ground.failures.on_result, result)
        return True

    def _check_sensor_timeout(self) -> None:
        """Report missing samples by wall time: without samples vehicle time does not advance."""
        if self._hil.lockstep:
            return
        if self._vehicle.time_us < 0:
            self._check_baud_rate()
        elif not self._timeout_reported and wall_s() - self._accepted_s >= SENSOR_SILENCE_S:
            self._timeout_reported = True
            self._vehicle.on_sensor_loss()

    def _check_baud_rate(self) -> None:
        """Report that the HIL line carries bytes but no MAVLink, as long as more arrive."""
        new_bytes = self._hil.non_mavlink_bytes - self._non_mavlink_bytes
        is_due = wall_s() - self._baud_rate_report_s >= WRONG_BAUD_PERIOD_S
        if is_due and new_bytes > WRONG_BAUD_BYTES:
            self._baud_rate_report_s = wall_s()
            self._non_mavlink_bytes = self._hil.non_mavlink_bytes
            self._vehicle.send_statustext("HIL: no MAVLink in received bytes: check baud rate")

    def _accept(self, sample: HilSample, silent_us: int) -> bool:
        """Answer a sample: run a tick for a new one, repeat the last answer for a repeated one.

        ``silent_us`` is the wall time since a sample was last accepted. Return whether the sample
        is new.
        """
        stamp_us = sample.sensors.time_us
        previous_clock = self._clock if self._vehicle.time_us >= 0 else SensorClock()
        self._clock, stamp_class = sensor_clock.classify_stamp(previous_clock, stamp_us, silent_us)
        if stamp_class is StampClass.REFUSED:
            return False
        if stamp_class is StampClass.REPEATED:
            self._answer(self._vehicle.repeat_last(), stamp_us)
            return False
        if stamp_class is StampClass.RESTARTED:
            self._restart(previous_clock, stamp_us)
        offset_us = self._clock.offset_us
        self._tick(sensor_clock.rebase(sample, offset_us) if offset_us else sample, stamp_us)
        return True

    def _restart(self, previous_clock: SensorClock, stamp_us: int) -> None:
        """Adopt a new time base of the sensors; vehicle time continues.

        A disarmed vehicle restarts instead when the stamp is older than the newest one: a new run
        of a simulator looks like this. A simulated loss of the ground links ends in both cases.
        """
        self._ground.silence(False)
        if not self._vehicle.state.armed and stamp_us < previous_clock.newest_us:
            self._clock = sensor_clock.begin(stamp_us)
            self._vehicle.restart("vehicle time fell back")
            return
        jump_s = (previous_clock.offset_us - self._clock.offset_us) / US_PER_S
        self._vehicle.send_statustext(f"Sensor clock jumped {jump_s:+.1f} s: vehicle time goes on")

    def _answer(self, frame: ActuatorFrame, stamp_us: int) -> None:
        """Send actuators with the stamp of the answered sample: a simulator waits for it."""
        self._hil.answer(frame if frame.time_us == stamp_us else frame._replace(time_us=stamp_us))

    def _tick(self, sample: HilSample, stamp_us: int) -> None:
        """Run one tick, answer the sample, then send telemetry and write the log."""
        attitude_silent_s, motion_silent_s = self._ground.targets_silent_s
        inputs = Inputs(
            sensors=sample.sensors,
            gps=sample.gps,
            altimeter=sample.altimeter,
            ground_silent_s=self._ground.ground_silent_s,
            stick=self._ground.stick,
            dvl=sample.dvl,
            battery=sample.battery,
            leak=sample.leak,
            duct=sample.duct,
            attitude_silent_s=attitude_silent_s,
            motion_silent_s=motion_silent_s,
        )
        self._answer(self._vehicle.tick(inputs), stamp_us)
        if sample.links_silent is False:
            self._ground.silence(False)
        self._report(sample.sensors.time_us, sample.relayed)
        self._onboard_log.tick(sample.frames)
        if sample.links_silent:
            self._ground.silence(True)

    def _report(
        self,
        time_us: int,
        relayed: Sequence[Frame] = (),
        reports: Sequence[SteadyReport] = (),
    ) -> None:
        """Queue what a tick, or the ticks of ``reports``, have to report; device messages first.

        The lateness counts the last of them: in real time there is one.
        """
        run = self._ground.guard.run
        if lateness := self._lateness.record(time_us):
            run("lateness", self._ground.publish_lateness, lateness)
        if relayed:
            run("relay of devices", self._ground.relay, relayed)
        run("telemetry", self._ground.publish_telemetry, reports)
