"""The simulator process: the plant at one end, the HIL link at the other, and the clock between them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Event
from typing import NamedTuple

from link.clock import Pacer
from link.records import TruthFrame
from link.transport import open_transport
from sitl import plant, scenario, truth
from sitl.hil import HilLink
from sitl.lockstep import Lockstep
from sitl.plant import Plant, State
from sitl.truth import Truth
from sitl.vehicle import config

TRUTH_PERIOD_US = 100_000
"""HIL_STATE_QUATERNION goes out ten times a second of vehicle time: a viewer's pace."""

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
    wait_for_arm: bool
    truth: Path | None


def run(options: Options) -> None:
    """Simulate until SIGINT or SIGTERM.

    Raises:
        VehicleError, ScenarioError, AddressError, TruthFileError: the options cannot be used.
        AutopilotSilentError, LinkLostError: the autopilot is gone.
    """
    sea = plant.build(config.load(options.vehicle), scenario.load(options.scenario))
    stop = _stop_on_signals()
    with closing(open_transport(options.hil)) as transport, _truth_record(options.truth) as record:
        _fly(sea, options, HilLink(transport), stop.is_set, record)


def _fly(sea: Plant, options: Options, link: HilLink, stopped: Callable[[], bool], record: Record) -> None:
    """Ask the autopilot, step the plant, tick by tick."""
    lockstep, pacer = Lockstep(link, stopped), Pacer(options.speed)
    ask = lockstep.ask_until_armed if options.wait_for_arm else lockstep.ask
    rng = plant.random_streams(options.seed)
    state, sensors = plant.launch(sea, rng)
    while True:
        record(state.truth)
        actuators = ask(link.datagram(sensors, _truth_frame(sea, state), state.faults.changes), state.time_us)
        if actuators is None:
            return
        for verdict in link.take_orders():
            state = plant.obey(state, verdict)
        state, sensors = plant.step(sea, state, actuators, rng)
        pacer.wait(state.time_us * 1e-6)


def _truth_frame(sea: Plant, state: State) -> TruthFrame | None:
    """What viewers may see, when it is due."""
    if state.time_us % TRUTH_PERIOD_US:
        return None
    return truth.to_frame(state.truth, sea.sea.latitude_deg, sea.sea.longitude_deg)


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
    from sitl.truth_log import TruthLog  # its libraries cost start-up time that most runs need not pay

    try:
        log = TruthLog(path)
    except OSError as error:
        reason = "the file exists; give a new one" if isinstance(error, FileExistsError) else error.strerror
        raise TruthFileError(f"--truth {path}: {reason}") from None
    with closing(log):
        yield log.write
