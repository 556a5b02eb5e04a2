"""The process: one loop that answers the sensors first, then tells and serves the ground."""

from collections.abc import Callable

from autopilot.comms import sensor_clock
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink, HilSample
from autopilot.comms.sensor_clock import SensorClock, StampVerdict
from autopilot.control.types import US_PER_S, Inputs, Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.vehicle import Vehicle
from mavlink_io.clock import wall_s
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import SPIN_S, wait

SENSOR_SILENCE_S = 1.0
"""Wall time without a sample after which a vehicle's own sensors count as silent. A simulator may
pause in lockstep."""
WRONG_BAUD_BYTES = 1000
"""So many before the first sample are no noise: the line has another baud rate."""


class App:
    """Joins the vehicle to its two sides and to its log."""

    def __init__(
        self, vehicle: Vehicle, hil: HilLink, ground: GroundServer, logbook: OnboardLog
    ) -> None:
        self._vehicle, self._hil, self._ground, self._logbook = vehicle, hil, ground, logbook
        self._clock = SensorClock()
        self._heard_s = 0.0
        self._gibberish_told = False
        self._taken_s = 0.0
        """Wall time at which a sample was last taken."""
        self._silence_told = False

    def run(self, stopping: Callable[[], bool]) -> None:
        """Serve until ``stopping`` says so. Raises LinkLostError when the HIL link is gone for
        good."""
        try:
            while not stopping():
                self.step(self._ground.poll())
            self._ground.flush()
        finally:
            self._logbook.close()

    def step(self, timeout_s: float) -> None:
        """Wait for something to arrive and deal with it."""
        links = {link.transport: link for link in self._ground.links}
        eager = self._hil.lockstep and wall_s() - self._heard_s < SPIN_S
        ready = wait([self._hil.transport, *links], timeout_s, eager=eager)
        if self._hil.transport in ready:
            self._heard_s = wall_s()
            silent_us = round((self._heard_s - self._taken_s) * US_PER_S)
            for sample in self._hil.receive():
                if self._take(sample, silent_us):
                    self._taken_s, self._silence_told = self._heard_s, False
            if complaint := self._hil.take_complaint():
                self._vehicle.send_statustext(complaint, Severity.ERROR)
            for result in self._hil.take_verdicts():
                self._ground.guard.run("failure injection", self._ground.failures.judged, result)
        for transport, link in links.items():
            if link.backlog or transport in ready:
                self._ground.receive(link)
        for order in self._ground.failures.take_orders():
            self._hil.order_failure(order)
        self._look_for_silence()

    def _look_for_silence(self) -> None:
        """Notice that samples no longer come: vehicle time stands still meanwhile, and nothing else
        would."""
        if self._hil.lockstep:
            return
        if self._vehicle.state.time_us < 0:
            self._look_for_gibberish()
        elif not self._silence_told and wall_s() - self._taken_s >= SENSOR_SILENCE_S:
            self._silence_told = True
            self._vehicle.on_sensor_loss()

    def _look_for_gibberish(self) -> None:
        if not self._gibberish_told and self._hil.gibberish_bytes > WRONG_BAUD_BYTES:
            self._gibberish_told = True
            self._vehicle.send_statustext("HIL: no MAVLink in what is heard: baud rate?")

    def _take(self, sample: HilSample, silent_us: int) -> bool:
        """Answer a sample: a new one with a tick, a repeated one as before. True where it is new.

        ``silent_us`` is the wall time since a sample was last taken.
        """
        stamp_us = sample.sensors.time_us
        before = self._clock if self._vehicle.state.time_us >= 0 else SensorClock()
        self._clock, verdict = sensor_clock.classify_stamp(before, stamp_us, silent_us)
        if verdict is StampVerdict.REFUSED:
            return False
        if verdict is StampVerdict.REPEATED:
            self._answer(self._vehicle.repeat_last(), stamp_us)
            return False
        if verdict is StampVerdict.RESTARTED:
            self._restart(before, stamp_us)
        offset_us = self._clock.offset_us
        self._tick(sensor_clock.rebase(sample, offset_us) if offset_us else sample, stamp_us)
        return True

    def _restart(self, before: SensorClock, stamp_us: int) -> None:
        """Follow a new time base of the sensors: vehicle time goes on.

        A disarmed vehicle whose time falls back begins anew instead: this is how a new run of a
        simulator looks. An order to silence the ground links ends with the old run.
        """
        self._ground.silence(False)
        if not self._vehicle.state.armed and stamp_us < before.newest_us:
            self._clock = sensor_clock.begin(stamp_us)
            self._vehicle.restart("vehicle time fell back")
            return
        jump_s = (before.offset_us - self._clock.offset_us) / US_PER_S
        self._vehicle.send_statustext(f"Sensor clock jumped {jump_s:+.1f} s: vehicle time goes on")

    def _answer(self, frame: ActuatorFrame, stamp_us: int) -> None:
        """Send actuators with the stamp of the sample they answer: a simulator waits for it."""
        self._hil.answer(frame if frame.time_us == stamp_us else frame._replace(time_us=stamp_us))

    def _tick(self, sample: HilSample, stamp_us: int) -> None:
        inputs = Inputs(
            sample.sensors,
            sample.gps,
            sample.altimeter,
            self._ground.ground_silent_s,
            self._ground.stick,
            sample.dvl,
            sample.battery,
            sample.leak,
            sample.duct,
            *self._ground.targets_silent_s,
        )
        self._answer(self._vehicle.tick(inputs), stamp_us)
        if sample.links_silent is False:
            self._ground.silence(False)
        self._ground.guard.run("relay of devices", self._ground.relay, sample.relayed)
        self._ground.guard.run("telemetry", self._ground.publish_telemetry)
        self._logbook.tick(sample.heard)
        if sample.links_silent:
            self._ground.silence(True)
