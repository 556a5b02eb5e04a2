"""The simulator process: the plant at one end, whoever steers at the other, and the clock between
them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache, partial
from pathlib import Path
from threading import Event
from typing import NamedTuple

from mavlink_io.clock import Pacer
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import open_transport
from sitl import scenario
from sitl.backends import Pilot
from sitl.backends.factory import Choice, take_on
from sitl.core import plant
from sitl.core.plant import Plant
from sitl.core.timestep import OURS, Pace
from sitl.core.truth import Truth
from sitl.vehicle import config

Record = Callable[[Truth], None]
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
    pilot: Choice
    """One that ``pilots.choice.check`` let pass."""


def run(options: Options) -> None:
    """Simulate until SIGINT or SIGTERM.

    Raises:
        VehicleError, ScenarioError, AddressError, TruthFileError: the options cannot be used.
        AutopilotSilentError, LinkLostError: the autopilot is gone.
    """
    build = cache(
        partial(plant.build, config.load(options.vehicle), scenario.load(options.scenario))
    )
    rehearse(
        build(OURS)
    )  # bad input is told, and the physics compiled, before anybody waits for us
    stop = _stop_on_signals()
    with closing(open_transport(options.hil)) as transport, _truth_record(options.truth) as record:
        _fly(build, options, take_on(options.pilot, transport, stop.is_set), record)


def rehearse(sea: Plant) -> None:
    """Fly one tick that nobody will know of."""
    rng = plant.random_streams(0)
    state, _ = plant.launch(sea, rng)
    plant.step(sea, state, ActuatorFrame(0, 0, (0.0, 0.0, 0.0), 0), rng)


def _fly(build: Callable[[Pace], Plant], options: Options, pilot: Pilot, record: Record) -> None:
    """Put a vehicle into the sea for whoever comes to steer her, and a new one whenever he begins
    anew."""
    while (pace := pilot.meet()) is not None:
        sea, rng, pacer = build(pace), plant.random_streams(options.seed), Pacer(options.speed)
        state, sensors = plant.launch(sea, rng)
        record(state.truth)
        while (actuators := pilot.ask(sea, state, sensors)) is not None:
            for verdict in pilot.take_orders():
                state = plant.obey(state, verdict)
            state, sensors = plant.step(sea, state, actuators, rng)
            pacer.wait(state.time_us * 1e-6)
            record(state.truth)


def _stop_on_signals() -> Event:
    """An event that SIGINT and SIGTERM set: the tick under way is finished and the log closed."""
    stop = Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    return stop


@contextmanager
def _truth_record(path: Path | None) -> Iterator[Record]:
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
