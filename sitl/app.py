"""The simulator process: connects the plant to an autopilot and paces vehicle time."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

from mavlink_io import jit
from mavlink_io.clock import Pacer
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.parent_watch import on_end_signals
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import open_transport
from sitl import scenario
from sitl.backends import Backend, QuickBackend
from sitl.backends.factory import BackendOptions, create_backend
from sitl.core import plant, tick
from sitl.core.plant import Plant, PlantState
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.vehicle import config

RecordTruth = Callable[[PlantState], None]
"""Callback that records the true state, called once per tick."""


class TruthFileError(InputError):
    """The truth log cannot be created; the message names the file and the reason."""

    code = ErrorCode.TRUTH_FILE


class SimulatorOptions(NamedTuple):
    """Options of the command line."""

    vehicle: str
    scenario: str
    hil: str
    speed: float | None
    """Vehicle seconds per second of wall time; None for no limit."""
    seed: int
    sea_seed: int | None
    """Seed of the sea; None for that of the other random streams."""
    place_m: tuple[float, float] | None
    """Place of the start, north and east of the site; None for that of the scenario."""
    truth: Path | None
    """Truth log to create; None for no log."""
    backend: BackendOptions
    """Autopilot options that ``backends.factory.check_options`` has accepted."""


_COMPILER_NOTICE = "sitl: compiling the physics, once, for up to 4 minutes"


def needs_compiler() -> bool:
    """Return whether the physics have to be compiled before the first tick."""
    return jit.COMPILED and not jit.is_stored(tick.advance)


def report_compilation(alternative: str = "") -> None:
    """Print one line on stderr if the physics have to be compiled; it ends with an alternative."""
    if needs_compiler():
        print(_COMPILER_NOTICE + alternative, file=sys.stderr, flush=True)


def run(options: SimulatorOptions) -> None:
    """Simulate until SIGINT, SIGTERM or SIGHUP.

    Raises
    ------
    VehicleFileError, ScenarioError, AddressError, TruthFileError
        An option cannot be used.
    AutopilotTimeoutError, LinkLostError
        The autopilot no longer answers, or the link is lost.
    """
    site = scenario.load(options.scenario)
    if options.place_m is not None:
        site = scenario.with_place(site, *options.place_m)
    build = cache(partial(plant.build, config.load(options.vehicle), site))
    report_compilation("; --no-compile begins in Python")
    # Report bad input and compile the physics before an autopilot waits for the first frame.
    warm_up(build(DEFAULT_TIMESTEP))
    # What is loaded now lives until the end of the process. Visiting it then, to collect garbage,
    # took 0.4 s, more than loading the compiled physics.
    gc.freeze()
    is_stopped = _stop_on_signals()
    with (
        closing(open_transport(options.hil)) as transport,
        _open_truth_log(options.truth) as record,
    ):
        _simulate(build, options, create_backend(options.backend, transport, is_stopped), record)


def warm_up(simulated: Plant) -> None:
    """Simulate one tick and discard it, so that the physics are compiled."""
    rng = plant.random_streams(0)
    state, _ = plant.initial_state(simulated, rng)
    plant.step(
        simulated, state, ActuatorFrame(time_us=0, flags=0, controls=(0.0, 0.0, 0.0), mode=0), rng
    )


def _simulate(
    build: Callable[[Timestep], Plant],
    options: SimulatorOptions,
    backend: Backend,
    record: RecordTruth,
) -> None:
    """Simulate one run per connection; start from the initial state when the autopilot restarts."""
    is_observed = options.speed is not None or options.truth is not None
    quick = None if is_observed or not isinstance(backend, QuickBackend) else backend
    while (timestep := backend.wait_for_autopilot()) is not None:
        simulated, rng = build(timestep), plant.random_streams(options.seed, options.sea_seed)
        pacer = Pacer(options.speed)
        state, sensors = plant.initial_state(simulated, rng)
        record(state)
        while True:
            if quick is not None:
                state, sensors = quick.advance(simulated, state, sensors, rng)
            actuators = backend.exchange(simulated, state, sensors)
            if actuators is None:
                break
            for injection in backend.take_injections():
                state = plant.inject_failure(state, injection)
            state, sensors = plant.step(simulated, state, actuators, rng)
            pacer.wait(state.time_us * 1e-6)
            record(state)


def _stop_on_signals() -> Callable[[], bool]:
    """Return a function that returns whether an end signal has come.

    The present tick then ends, and the log is closed.
    """
    signals: list[int] = []
    on_end_signals(lambda number, _: signals.append(number))
    return lambda: bool(signals)


@contextmanager
def _open_truth_log(path: Path | None) -> Iterator[RecordTruth]:
    """Yield the recorder: one that does nothing, or one that writes an MCAP file closed on exit."""
    if path is None:
        yield lambda _: None
        return
    # Imported here because its libraries take start-up time that most runs do not need.
    from sitl.truth_log import TruthLog

    try:
        log = TruthLog(path)
    except OSError as error:
        reason = (
            "the file exists; choose another name"
            if isinstance(error, FileExistsError)
            else error.strerror
        )
        raise TruthFileError(f"--truth {path}: {reason}") from None
    with closing(log):
        yield lambda state: log.write(state.truth)
