"""The tick of a vehicle: ``core.tick``, and compiled steady ticks in simulated flights."""

from collections.abc import Callable, Iterable
from importlib import import_module
from struct import Struct
from typing import Any, NamedTuple, cast

from autopilot.control import core, estimator, excitation, params, steady
from autopilot.control.core import Events
from autopilot.control.params import Config
from autopilot.control.sensor_health.sensor_checks import has_data
from autopilot.control.setpoints import Path, Setpoint
from autopilot.control.steady import DeviceRecords, Task
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Excitation,
    Home,
    Inputs,
    Motion,
    Trace,
)
from mavlink_io import jit

_FRAME, _SIGNAL, _FIRST_DEVICE = 0, 1, 2
"""Index of inputs in ``steady_kernel.KINDS``."""
_SETPOINT = len(Motion._fields)
_TRACE = _SETPOINT + len(Setpoint._fields)
"""Indices of set-points and signals in the results of ``steady_kernel``."""


def is_compiled() -> bool:
    """Return whether the machine code of steady ticks is on disk; to compile it takes a minute."""
    if not jit.COMPILED:
        return False
    kernel = import_module("autopilot.control.steady_kernel")
    return jit.is_stored(kernel.advance) and jit.is_stored(kernel.read)


class Pilot:
    """State of the autopilot between ticks, and the ticks.

    Parameters
    ----------
    compiled : bool
        Whether steady ticks are compiled: this loads the compiler.
    """

    def __init__(self, *, compiled: bool) -> None:
        self._steady = _SteadyTicks() if compiled else None
        self._state = core.initial_state()
        self.time_us = self._state.time_us
        """Vehicle time of the last tick; -1 before the first."""
        self.armed = self._state.armed
        self._results: _Results | None = None
        """Results of the last tick, if that was a steady one in compiled code."""
        self._motion: Motion | None = None
        """Motion of ``_state``; None until it is asked for."""
        self.trace = Trace()
        """Signals of the last tick."""
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
        if self._steady is not None:
            self._steady.stop()
        self._state, self.time_us, self.armed = state, state.time_us, state.armed
        self._results = self._motion = None
        self.changes += 1

    @property
    def motion(self) -> Motion:
        """Motion after the last tick or request."""
        if self._results is not None:
            return self._results.motion
        if self._motion is None:
            self._motion = estimator.motion_of(self._state.estimate, self._state.time_us)
        return self._motion

    @property
    def setpoint(self) -> Setpoint:
        """Set-points after the last tick or request."""
        return self._state.setpoint if self._results is None else self._results.setpoint

    @property
    def path(self) -> Path | None:
        """Path; the integral of its guidance is that of an earlier tick."""
        return self._state.path

    @property
    def home(self) -> Home:
        """Home."""
        return self._state.home

    def advance(self, inputs: Inputs, config: Config) -> bool:
        """Advance by one steady tick in compiled code; return whether this was possible."""
        results = None if self._steady is None else self._steady.advance(inputs, config)
        if results is None:
            return False
        self._results, self.trace = results, results.trace
        self.time_us = inputs.sensors.time_us
        return True

    def tick(self, inputs: Inputs, config: Config) -> Events:
        """Advance by one tick; return the events to send."""
        self.state, _, self.trace, events = core.tick(self.state, inputs, config)
        if self._steady is not None:
            self._steady.begin(self._state, config)
        return events


class _Results(NamedTuple):
    """Results of a steady tick."""

    motion: Motion
    setpoint: Setpoint
    trace: Trace


class _Course(NamedTuple):
    """Compiled steady ticks in progress."""

    advance: Callable[[jit.Native, jit.Native, jit.Numbers, int], bool]
    """Machine code of the tick."""
    flight: jit.Native
    config: jit.Native
    parameters: Config
    test: Excitation | None


class _SteadyTicks:
    """Steady ticks in compiled code."""

    def __init__(self) -> None:
        # Imported by name: it loads the compiler, which only simulated flights need.
        self._kernel = kernel = import_module("autopilot.control.steady_kernel")
        self._values = jit.numbers(kernel.SIZE)
        self._layouts = [
            (Struct(f"{len(kind._fields)}d").pack_into, 8 * start)
            for kind, start in zip(kernel.KINDS, kernel.STARTS, strict=False)
        ]
        """Function and offset (bytes) that store each record of the inputs."""
        self._course: _Course | None = None
        self._ahead = False
        """Whether compiled code is ahead of the ``AutopilotState``."""
        self._parameters: tuple[Config, jit.Native] | None = None
        self._prepare()

    def begin(self, state: AutopilotState, config: Config) -> None:
        """Begin steady ticks after a state, if the next tick may be one."""
        task = steady.task_of(state, config)
        if task is not None:
            flight, flat = self._flight(state, task), self._flat(config)
            advance = jit.machine_code(self._kernel.advance, flight, flat, self._values, 0)
            self._course = _Course(advance, flight, flat, parameters=config, test=state.test)

    def advance(self, inputs: Inputs, config: Config) -> _Results | None:
        """Advance by one steady tick; None if the tick has to be a full one."""
        course = self._course
        if course is None or course.parameters is not config or _ground_lost(inputs, config):
            return None
        store, _ = self._layouts[_FRAME]
        store(self._values, 0, *inputs.sensors)
        if course.test is not None:
            elapsed_us = inputs.sensors.time_us - course.test.started_us
            self._store(_SIGNAL, excitation.sample(course.test, elapsed_us / US_PER_S))
        new = self._collect(inputs) if has_data(inputs) else 0
        if not course.advance(course.flight, course.config, self._values, new):
            return None
        self._ahead = True
        numbers = self._values[self._kernel.RESULTS :].tolist()
        return _Results(
            Motion._make(numbers[:_SETPOINT]),
            Setpoint._make(numbers[_SETPOINT:_TRACE]),
            Trace._make(numbers[_TRACE:]),
        )

    def update(self, state: AutopilotState) -> AutopilotState:
        """Return the state after the steady ticks since the last call."""
        if not self._ahead or self._course is None:
            return state
        self._ahead = False
        return steady.end(state, *self._kernel.read(self._course.flight))

    def stop(self) -> None:
        """End the steady ticks: the state has changed."""
        if self._course is not None and self._course.test is not None:
            self._store(_SIGNAL, excitation.NO_SIGNAL)
        self._course, self._ahead = None, False

    def _prepare(self) -> None:
        """Load the machine code, so that no tick waits for it."""
        flight = self._flight(core.initial_state(), steady.NO_TASK)
        self._kernel.advance(flight, self._flat(params.config({})), self._values, 0)
        self._kernel.read(flight)

    def _flight(self, state: AutopilotState, task: Task) -> jit.Native:
        """Return the state in memory of compiled code."""
        devices = steady.begin_devices(state.health.devices)
        return jit.native(self._kernel.Flight(steady.begin(state), devices, task))

    def _store(self, part: int, record: Iterable[float]) -> None:
        """Store a record of the inputs."""
        store, offset = self._layouts[part]
        store(self._values, offset, *record)

    def _collect(self, inputs: Inputs) -> int:
        """Store the device records of this tick; return their bits."""
        new = 0
        for index, name in enumerate(DeviceRecords._fields):
            record = getattr(inputs, name)
            if record is not None:
                new |= 1 << index
                self._store(_FIRST_DEVICE + index, record)
        return new

    def _flat(self, config: Config) -> jit.Native:
        """Return the parameters in memory of compiled code."""
        if self._parameters is None or self._parameters[0] is not config:
            flat = jit.native(cast(tuple[Any, ...], params.flat(config)))
            self._parameters = config, flat
        return self._parameters[1]


def _ground_lost(inputs: Inputs, config: Config) -> bool:
    """Return whether the failsafe of a lost ground station may begin."""
    silent_s = inputs.ground_silent_s
    return silent_s is not None and 0.0 < config.fs_ground_s < silent_s
