"""The simulator process: the plant at one end, whoever steers at the other, and the clock between
them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache, partial
from pathlib import Path
from threading import Event
from typing import NamedTuple

from mavlink_io.clock import Pacer
from mavlink_io.parent_watch import on_end_signals
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import open_transport
from sitl import scenario
from sitl.backends import Backend
from sitl.backends.factory import BackendOptions, create_backend
from sitl.core import plant
from sitl.core.plant import Plant
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.core.truth import Truth
from sitl.vehicle import config

RecordTruth = Callable[[Truth], None]
"""Takes note of what really happens, once a tick."""


class TruthFileError(ValueError):
    """The truth log cannot be made where it was asked for."""


class Options(NamedTuple):
    """What the command line asks for."""

    vehicle: str
    scenario: str
    hil: str
    speed: float | None
    """Vehicle seconds a wall second; None runs free."""
    seed: int
    truth: Path | None
    pilot: BackendOptions
    """One that ``pilots.choice.check`` let pass."""


def run(options: Options) -> None:
    """Simulate until SIGINT, SIGTERM or SIGHUP.

    Raises:
        VehicleError, ScenarioError, AddressError, TruthFileError: the options cannot be used.
        AutopilotSilentError, LinkLostError: the autopilot is gone.
    """
    build = cache(
        partial(plant.build, config.load(options.vehicle), scenario.load(options.scenario))
    )
    warm_up(
        build(DEFAULT_TIMESTEP)
    )  # bad input is told, and the physics compiled, before anybody waits for us
    stop = _stop_on_signals()
    with (
        closing(open_transport(options.hil)) as transport,
        _open_truth_log(options.truth) as record,
    ):
        _simulate(build, options, create_backend(options.pilot, transport, stop.is_set), record)


def warm_up(sea: Plant) -> None:
    """Fly one tick that nobody will know of."""
    rng = plant.random_streams(0)
    state, _ = plant.initial_state(sea, rng)
    plant.step(sea, state, ActuatorFrame(0, 0, (0.0, 0.0, 0.0), 0), rng)


def _simulate(
    build: Callable[[Timestep], Plant], options: Options, pilot: Backend, record: RecordTruth
) -> None:
    """Put a vehicle into the sea for whoever comes to steer her, and a new one whenever he begins
    anew."""
    while (pace := pilot.meet()) is not None:
        sea, rng, pacer = build(pace), plant.random_streams(options.seed), Pacer(options.speed)
        state, sensors = plant.initial_state(sea, rng)
        record(state.truth)
        while (actuators := pilot.ask(sea, state, sensors)) is not None:
            for verdict in pilot.take_orders():
                state = plant.inject_failure(state, verdict)
            state, sensors = plant.step(sea, state, actuators, rng)
            pacer.wait(state.time_us * 1e-6)
            record(state.truth)


def _stop_on_signals() -> Event:
    """Return an event that end signals set: the tick under way is finished and the log closed."""
    stop = Event()
    on_end_signals(lambda *_: stop.set())
    return stop


@contextmanager
def _open_truth_log(path: Path | None) -> Iterator[RecordTruth]:
    """Where truths go: nowhere, or into an MCAP file that is closed whatever happens."""
    if path is None:
        yield lambda _: None
        return
    from sitl.truth_log import (
        TruthLog,  # its libraries cost start-up time that most runs need not pay
    )

    try:
        log = TruthLog(path)
    except OSError as error:
        reason = (
            "the file exists; give a new one"
            if isinstance(error, FileExistsError)
            else error.strerror
        )
        raise TruthFileError(f"--truth {path}: {reason}") from None
    with closing(log):
        yield log.write
