"""Steady ticks of the autopilot in compiled code, and their results for Python."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from importlib import import_module
from struct import Struct
from typing import Any, NamedTuple, cast

from autopilot.control import core, excitation, params, steady
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.failsafe import ground_lost
from autopilot.control.params import Config
from autopilot.control.sensor_health.sensor_checks import has_data
from autopilot.control.setpoints import Setpoint
from autopilot.control.steady import DeviceRecords, Task
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Excitation,
    Inputs,
    Motion,
    Trace,
)
from mavlink_io import device_records, jit, lockstep_frames
from mavlink_io.codec import MAX_FRAME_BYTES, Frame, Framer
from mavlink_io.endpoint import Endpoint
from mavlink_io.lockstep_frames import frame_memory
from mavlink_io.records import Altimeter, Battery, GpsFix, Leak, SensorFrame
from mavlink_io.transport import MAX_DATAGRAM, Peer, spin_s

_FRAME, _SIGNAL, _FIRST_DEVICE = 0, 1, 2
"""Index of inputs in ``steady_kernel.KINDS``."""
_REPORTED = GpsFix, Altimeter, Battery, Leak
"""Kinds of the records of ``NewRecords``."""
_SIGNALS, _TABLES = len(ExcitationOutput._fields), 8
"""Numbers of a test signal; length of a table of signals, as a multiple of one exchange."""
_TRACE = -len(Trace._fields)
_SETPOINT = _TRACE - len(Setpoint._fields)
_MOTION = _SETPOINT - len(Motion._fields)
"""Indices of the results of ``steady_kernel``, from the end."""
_SENSORS = len(SensorFrame._fields)
"""Length of the sensor frame, with which the array begins."""
_MAX_ANSWER_BYTES = lockstep_frames.CONTROLS.length + lockstep_frames.OVERHEAD
_KERNEL, _EXCHANGE = "autopilot.control.steady_kernel", "autopilot.compiled_exchange"
_SOCKET, TELEMETRY = "mavlink_io.lockstep_socket", "autopilot.telemetry.compiled_streams"
"""Modules that are imported by name: they load the compiler, which only simulated flights need."""


def is_compiled() -> bool:
    """Return whether the machine code of steady ticks is on disk; to compile it takes a minute."""
    if not jit.COMPILED:
        return False
    kernel, exchange, telemetry = map(import_module, (_KERNEL, _EXCHANGE, TELEMETRY))
    used = kernel.advance, kernel.read, exchange.answer_many, telemetry.encode
    return all(map(jit.is_stored, used))


class NewRecords(NamedTuple):
    """Device records that have come in a tick and that telemetry uses; None for the others."""

    gps: GpsFix | None
    altimeter: Altimeter | None
    battery: Battery | None
    leak: Leak | None


class Results:
    """Inputs and results of a steady tick; each record is made when it is read.

    Parameters
    ----------
    rows : Numbers
        Arrays of ``steady_kernel`` of some ticks, which do not change any more.
    start, end : int
        Index of the first number of this tick, and behind its last.
    time_us : int
        Vehicle time of the tick.
    config : Native
        Parameters of the tick.
    """

    __slots__ = ("_end", "config", "devices", "relayed", "rows", "start", "time_us")

    def __init__(
        self, rows: jit.Numbers, start: int, end: int, time_us: int, config: jit.Native
    ) -> None:
        self.rows, self.start, self._end = rows, start, end
        self.time_us, self.config = time_us, config
        self.devices: NewRecords | None = None
        """Device records that have come in the tick, for an exchange."""
        self.relayed: Sequence[Frame] = ()
        """Device messages of the tick to relay to ground, for an exchange."""

    def _numbers(self, first: int, end: int) -> list[float]:
        """Return some numbers for Python, by their indices from the end."""
        numbers: list[float] = self.rows[self._end + first : self._end + end].tolist()
        return numbers

    @property
    def motion(self) -> Motion:
        """Motion after the tick."""
        return Motion._make(self._numbers(_MOTION, _SETPOINT))

    @property
    def setpoint(self) -> Setpoint:
        """Set-points after the tick."""
        return Setpoint._make(self._numbers(_SETPOINT, _TRACE))

    @property
    def trace(self) -> Trace:
        """Signals of the tick."""
        return Trace._make(self._numbers(_TRACE, 0))

    @property
    def sensors(self) -> SensorFrame:
        """Sensor frame of the tick."""
        first = self.start - self._end
        time_us, *readings, updated, number = self._numbers(first, first + _SENSORS)
        return SensorFrame._make((int(time_us), *readings, int(updated), int(number)))


class Expected(NamedTuple):
    """The next samples of a simulator in lockstep."""

    time_us: int
    """Time stamp of the first."""
    interval_us: int
    """Time between two of them."""
    ticks: int
    """Largest number of samples to answer."""
    duration_s: float
    """Wall time after which no further sample is waited for."""


class _Course(NamedTuple):
    """Compiled steady ticks in progress."""

    advance: Callable[[jit.Native, jit.Native, jit.Numbers, int], bool]
    """Machine code of the tick."""
    flight: jit.Native
    config: jit.Native
    parameters: Config
    test: Excitation | None


def _signal(test: Excitation, time_us: int) -> ExcitationOutput:
    """Return the test signal at a vehicle time."""
    return excitation.sample(test, (time_us - test.started_us) / US_PER_S)


class _SignalTable:
    """Test signals of the next ticks, sampled many ticks at a time.

    Parameters
    ----------
    most : int
        Largest number of ticks that are asked for at a time.
    """

    def __init__(self, most: int) -> None:
        self._size = _TABLES * most
        self.numbers = jit.numbers(self._size * _SIGNALS)
        """One ``ExcitationOutput`` after the other."""
        self._store = Struct(f"{_SIGNALS}d").pack_into
        self._test: Excitation | None = None
        self._start_us = self._interval_us = 0

    def index(self, test: Excitation, time_us: int, interval_us: int, ticks: int) -> int:
        """Return the index of the signal at a vehicle time; those of ``ticks`` ticks follow it."""
        first, rest = divmod(time_us - self._start_us, max(1, interval_us))
        is_sampled = test is self._test and interval_us == self._interval_us and rest == 0
        if not (is_sampled and 0 <= first <= self._size - ticks):
            self._test, self._start_us, self._interval_us = test, time_us, interval_us
            first = 0
            for tick in range(self._size):
                signal = _signal(test, time_us + tick * interval_us)
                self._store(self.numbers, 8 * _SIGNALS * tick, *signal)
        return first


class SteadyTicks:
    """Steady ticks in compiled code."""

    def __init__(self) -> None:
        self._kernel, self._exchange = import_module(_KERNEL), import_module(_EXCHANGE)
        self._socket, kernel = import_module(_SOCKET), self._kernel
        self._values = jit.numbers(kernel.SIZE)
        self._layouts = [
            (Struct(f"{len(kind._fields)}d").pack_into, 8 * start)
            for kind, start in zip(kernel.KINDS, kernel.STARTS, strict=False)
        ]
        """Function and offset (bytes) that store each record of the inputs."""
        kinds = [device_records.KINDS.index(kind) for kind in _REPORTED]
        starts = kernel.STARTS[_FIRST_DEVICE:]
        self._readers = [
            (1 << kind, device_records.READERS[kind], starts[kind], starts[kind + 1])
            for kind in kinds
        ]
        """Bit, reader, first index and end of the records of ``NewRecords``."""
        exchange = self._exchange
        frames = exchange.Frames(
            datagram=jit.octets(MAX_DATAGRAM),
            frame=frame_memory(MAX_FRAME_BYTES),
            answer=frame_memory(_MAX_ANSWER_BYTES),
            relay=jit.octets(exchange.MAX_TICKS * MAX_FRAME_BYTES),
        )
        self._frames = jit.native(frames)
        self._datagram, self._relay = memoryview(frames.datagram), memoryview(frames.relay)
        self._rows = jit.numbers(exchange.MAX_TICKS * exchange.ROW)
        self._signals = _SignalTable(exchange.MAX_TICKS)
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
            self._course = _Course(
                advance=jit.machine_code(self._kernel.advance, flight, flat, self._values, 0),
                flight=flight,
                config=flat,
                parameters=config,
                test=state.test,
            )

    def advance(self, inputs: Inputs, config: Config) -> bool:
        """Advance by one steady tick; return False if the tick has to be a full one."""
        course = self._course
        silent_s = inputs.ground_silent_s
        if course is None or course.parameters is not config or ground_lost(silent_s, config):
            return False
        store, _ = self._layouts[_FRAME]
        store(self._values, 0, *inputs.sensors)
        if course.test is not None:
            self._store(_SIGNAL, _signal(course.test, inputs.sensors.time_us))
        new = self._collect(inputs) if has_data(inputs) else 0
        if not course.advance(course.flight, course.config, self._values, new):
            return False
        self._ahead = True
        return True

    def exchange(self, endpoint: Endpoint, expected: Expected, config: Config) -> list[Results]:
        """Answer samples of steady ticks; return the results of each."""
        course, peer = self._course, endpoint.peer()
        if course is None or peer is None or course.parameters is not config:
            return []
        time_us, interval_us, ticks, duration_s = expected
        ticks = min(ticks, self._exchange.MAX_TICKS)
        first = 0
        if course.test is not None:
            first = self._signals.index(course.test, time_us, interval_us, ticks)
        socket = self._socket.compiled_socket(peer)
        done, received = self._answer_many(
            *(socket.native, self._frames, course.flight, course.config, self._values),
            *(self._signals.numbers, self._rows, course.test is not None, first),
            *(time_us, interval_us, endpoint.sequence, endpoint.sender),
            *(ticks, duration_s, spin_s()),
        )
        endpoint.take_sequence(done)
        socket.return_rest(endpoint, self._datagram, received)
        if not done:
            return []
        self._ahead = True
        return self._all_results(done, course.config)

    def _all_results(self, ticks: int, config: jit.Native) -> list[Results]:
        """Return the results of the ticks of an exchange."""
        row, size = self._exchange.ROW, self._kernel.SIZE
        rows, relayed_end = copy(self._rows[: ticks * row]), 0
        times = rows[::row].tolist()
        new = rows[self._exchange.NEW :: row].tolist()
        ends = rows[self._exchange.RELAY_END :: row].tolist()
        results = []
        for tick, (time_us, bits, end) in enumerate(zip(times, new, ends, strict=True)):
            start = tick * row
            result = Results(rows, start, start + size, int(time_us), config)
            if bits:
                result.devices = self._new_records(int(bits), rows, start)
            if end > relayed_end:
                result.relayed = Framer().feed(bytes(self._relay[int(relayed_end) : int(end)]))
                relayed_end = end
            results.append(result)
        return results

    def _new_records(self, new: int, rows: jit.Numbers, row: int) -> NewRecords:
        """Return the device records of the bits ``new`` in the row that begins at an index."""
        return NewRecords._make(
            read(rows[row + first : row + end].tolist()) if new & bit else None
            for bit, read, first, end in self._readers
        )

    def results(self) -> Results:
        """Return the results of the last steady tick."""
        assert self._course is not None
        values = copy(self._values)
        return Results(values, 0, len(values), int(values[0]), self._course.config)

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
        tick = flight, self._flat(params.config({})), self._values
        self._kernel.advance(*tick, 0)
        self._kernel.read(flight)
        nowhere = self._socket.compiled_socket(Peer(-1, None)).native
        arguments = (
            *(nowhere, self._frames, *tick, self._signals.numbers, self._rows, False, 0),
            *(0, 0, 0, 0, 0, 0.0, 0.0),
        )
        self._answer_many = jit.machine_code(self._exchange.answer_many, *arguments)
        self._answer_many(*arguments)

    def _flight(self, state: AutopilotState, task: Task) -> jit.Native:
        """Return the state in memory of compiled code."""
        devices = steady.begin_devices(state.health.devices)
        return jit.native(self._kernel.TickRun(steady.begin(state), devices, task))

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
