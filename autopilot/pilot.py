"""The tick of a vehicle: ``core.tick``, and compiled steady ticks in simulated flights."""

from autopilot.control import core, estimator
from autopilot.control.params import Config
from autopilot.control.setpoints import Path, Setpoint
from autopilot.control.types import (
    AutopilotState,
    Events,
    Home,
    Inputs,
    Motion,
    Trace,
)
from autopilot.steady_ticks import Expected, Results, SteadyTicks
from mavlink_io.endpoint import Endpoint


class Pilot:
    """State of the autopilot between ticks, and the ticks.

    Parameters
    ----------
    compiled : bool
        Whether steady ticks are compiled: this loads the compiler.
    """

    def __init__(self, *, compiled: bool) -> None:
        self._steady = SteadyTicks() if compiled else None
        self._state = core.initial_state()
        self.time_us = self._state.time_us
        """Vehicle time of the last tick; -1 before the first."""
        self.armed = self._state.armed
        self._results: Results | None = None
        """Results of the last tick, if that was a steady one in compiled code."""
        self._unread = False
        """Whether compiled code has newer results."""
        self._motion: Motion | None = None
        """Motion of ``_state``; None until it is asked for."""
        self._trace = Trace()
        self.changes = 0
        """Number of changes of the state that were no steady ticks."""

    @property
    def state(self) -> AutopilotState:
        """State after the last tick or request."""
        if self._steady is not None:
            self._state = self._steady.update(self._state)
        return self._state

    @state.setter
    def state(self, state: AutopilotState) -> None:
        """Set the state, which ends steady ticks.

        Parameters
        ----------
        state : AutopilotState
            New state.
        """
        if self._steady is not None:
            self._steady.stop()
        self._state, self.time_us, self.armed = state, state.time_us, state.armed
        self._trace = self.trace
        self._results, self._motion, self._unread = None, None, False
        self.changes += 1

    @property
    def results(self) -> Results | None:
        """Results of the last tick, if that was a steady one in compiled code."""
        if self._unread and self._steady is not None:
            self._results, self._unread = self._steady.results(), False
        return self._results

    @property
    def trace(self) -> Trace:
        """Signals of the last tick."""
        results = self.results
        return self._trace if results is None else results.trace

    @trace.setter
    def trace(self, trace: Trace) -> None:
        """Set the signals of the last tick.

        Parameters
        ----------
        trace : Trace
            New signals.
        """
        self._trace = trace

    @property
    def motion(self) -> Motion:
        """Motion after the last tick or request."""
        results = self.results
        if results is not None:
            return results.motion
        if self._motion is None:
            self._motion = estimator.motion_of(self._state.estimate, self._state.time_us)
        return self._motion

    @property
    def setpoint(self) -> Setpoint:
        """Set-points after the last tick or request."""
        results = self.results
        return self._state.setpoint if results is None else results.setpoint

    @property
    def path(self) -> Path | None:
        """Path; the integral of its guidance is that of an earlier tick."""
        return self._state.path

    @property
    def home(self) -> Home:
        """Home."""
        return self._state.home

    def advance(self, inputs: Inputs, config: Config) -> bool:
        """Advance by one steady tick in compiled code, if that is possible.

        Parameters
        ----------
        inputs : Inputs
            Inputs of the tick.
        config : Config
            Parameters.

        Returns
        -------
        bool
            Whether it was possible; if not, nothing has changed.
        """
        if self._steady is None or not self._steady.advance(inputs, config):
            return False
        self.time_us, self._unread = inputs.sensors.time_us, True
        return True

    def exchange(self, endpoint: Endpoint, expected: Expected, config: Config) -> list[Results]:
        """Answer the samples of steady ticks in compiled code, as long as that is possible.

        Parameters
        ----------
        endpoint : Endpoint
            Link to the simulator. It reads next the datagram that was not answered.
        expected : Expected
            Samples that are expected.
        config : Config
            Parameters.

        Returns
        -------
        list of Results
            Results of each tick, in order; empty if the next tick has to be a full one.
        """
        if self._steady is None:
            return []
        results = self._steady.exchange(endpoint, expected, config)
        if results:
            self._results, self._unread = results[-1], False
            self.time_us = results[-1].time_us
        return results

    def tick(self, inputs: Inputs, config: Config) -> Events:
        """Advance by one tick.

        Parameters
        ----------
        inputs : Inputs
            Inputs of the tick.
        config : Config
            Parameters.

        Returns
        -------
        tuple of events
            Events to send.
        """
        self.state, _, self.trace, events = core.tick(self.state, inputs, config)
        if self._steady is not None:
            self._steady.begin(self._state, config)
        return events
