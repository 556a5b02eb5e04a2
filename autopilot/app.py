"""The process: one loop that answers the sensors first, then tells and serves the ground."""

from collections.abc import Callable

from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink, HilSample
from autopilot.control.types import US_PER_S, Inputs, Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.vehicle import Vehicle
from mavlink_io.clock import wall_s
from mavlink_io.transport import SPIN_S, wait

RESTART_US = US_PER_S
"""Vehicle time that falls back by more than this belongs to a new run of the simulator."""
STALE_FRAMES = 5
"""So many old frames in a row are no stragglers: the simulator has begun again, shortly after its
last start."""
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
        self._stale_frames = 0
        self._heard_s = 0.0
        self._gibberish_told = False
        self._sampled_s: float | None = None
        """When the last sample came by wall time, None before the first and once its absence was
        noticed."""

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
            for sample in self._hil.receive():
                self._take(sample)
                self._sampled_s = self._heard_s
            if complaint := self._hil.take_complaint():
                self._vehicle.say(complaint, Severity.ERROR)
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
        elif self._sampled_s is not None and wall_s() - self._sampled_s >= SENSOR_SILENCE_S:
            self._sampled_s = None
            self._vehicle.lose_sensors()

    def _look_for_gibberish(self) -> None:
        if not self._gibberish_told and self._hil.gibberish_bytes > WRONG_BAUD_BYTES:
            self._gibberish_told = True
            self._vehicle.say("HIL: no MAVLink in what is heard: baud rate?")

    def _take(self, sample: HilSample) -> None:
        """Answer a sample: a new one with a tick, one that came again with what was answered
        before."""
        late_us = self._vehicle.state.time_us - sample.sensors.time_us
        if late_us == 0:
            self._hil.answer(self._vehicle.again())
            return
        if late_us > 0:
            self._stale_frames += 1
            if late_us <= RESTART_US and self._stale_frames < STALE_FRAMES:
                return
            self._vehicle.restart("vehicle time fell back")
            self._ground.silence(False)
        self._stale_frames = 0
        self._tick(sample)

    def _tick(self, sample: HilSample) -> None:
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
        self._hil.answer(self._vehicle.tick(inputs))
        if sample.links_silent is False:
            self._ground.silence(False)
        self._ground.guard.run("relay of devices", self._ground.relay, sample.relayed)
        self._ground.guard.run("telemetry", self._ground.tell)
        self._logbook.tick(sample.heard)
        if sample.links_silent:
            self._ground.silence(True)
