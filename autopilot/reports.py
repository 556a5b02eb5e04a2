"""The result of a tick, as telemetry and the log use it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from autopilot.control import core, estimator
from autopilot.control.params import Config
from autopilot.control.setpoints import Path, Setpoint
from autopilot.control.types import AutopilotState, Home, Motion, Stick, Trace
from mavlink_io.records import ActuatorFrame, Altimeter, Battery, GpsFix, Leak, SensorFrame

if TYPE_CHECKING:  # the machine code of the messages does not depend on it
    from autopilot.steady_ticks import Results
    from mavlink_io.codec import Frame


class TickReport(NamedTuple):
    """Result of a tick, for messages that are sent or logged several times a second.

    It needs no ``AutopilotState``, which compiled code would have to convert first.
    """

    time_us: int
    motion: Motion
    setpoint: Setpoint
    path: Path | None
    home: Home
    trace: Trace
    actuators: ActuatorFrame
    sensors: SensorFrame | None
    altimeter: Altimeter | None

    @property
    def relayed(self) -> Sequence[Frame]:
        """No device messages: those of a single tick are relayed before its report."""
        return ()


class SteadyReport:
    """``TickReport`` of a steady tick in compiled code; each record is made when it is read."""

    __slots__ = ("_config", "altimeter", "home", "path", "results", "time_us")

    def __init__(
        self,
        results: Results,
        config: Config,
        path: Path | None,
        home: Home,
        altimeter: Altimeter | None,
    ) -> None:
        self.time_us, self.results, self._config = results.time_us, results, config
        self.path, self.home, self.altimeter = path, home, altimeter

    @property
    def motion(self) -> Motion:
        """Estimated motion."""
        return self.results.motion

    @property
    def setpoint(self) -> Setpoint:
        """Set-points of the loops."""
        return self.results.setpoint

    @property
    def trace(self) -> Trace:
        """Signals of the loops."""
        return self.results.trace

    @property
    def relayed(self) -> Sequence[Frame]:
        """Device messages of the tick to relay to ground."""
        return self.results.relayed

    @property
    def actuators(self) -> ActuatorFrame:
        """Commands of the tick."""
        return core.armed_frame(self.time_us, self.results.trace, self._config)

    @property
    def sensors(self) -> SensorFrame:
        """Sensor frame of the tick."""
        return self.results.sensors


class Snapshot(NamedTuple):
    """State of the vehicle after a tick, as telemetry and the log use it.

    It has the fields of ``TickReport`` too.
    """

    state: AutopilotState
    trace: Trace
    actuators: ActuatorFrame
    sensors: SensorFrame | None
    fix: GpsFix | None
    """Newest satellite fix; None when it is older than FIX_TIMEOUT_US."""
    config: Config
    intended_mode: int
    """Mode that was last requested; a failsafe may have selected another one."""
    altimeter: Altimeter | None = None
    """Newest altimeter record; None before the first."""
    battery: Battery | None = None
    """Newest battery record; None before the first."""
    leak: Leak | None = None
    """Newest record of the leak sensor; None before the first."""
    stick: Stick | None = None
    """Manual control of the newest tick; None without it."""

    @property
    def time_us(self) -> int:
        """Vehicle time of the tick; -1 before the first."""
        return self.state.time_us

    @property
    def motion(self) -> Motion:
        """Estimated motion."""
        return estimator.motion_of(self.state.estimate, self.state.time_us)

    @property
    def setpoint(self) -> Setpoint:
        """Set-points of the loops."""
        return self.state.setpoint

    @property
    def path(self) -> Path | None:
        """Path over ground; None without one."""
        return self.state.path

    @property
    def home(self) -> Home:
        """Home."""
        return self.state.home
