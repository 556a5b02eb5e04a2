"""The simulator process: the plant at one end, the HIL link at the other, and the clock between them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Event
from typing import NamedTuple

from link.clock import Pacer
from link.transport import open_transport
from sitl import plant, scenario, truth
from sitl.hil import HilLink
from sitl.lockstep import Lockstep
from sitl.plant import Plant
from sitl.truth import Truth
from sitl.vehicle import config

Record = Callable[[Truth], None]
"""Takes note of what really happens, once a tick."""


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
        VehicleError, ScenarioError, AddressError, OSError: the options cannot be used.
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
        frame = truth.to_frame(state.truth, sea.sea.latitude_deg, sea.sea.longitude_deg)
        actuators = ask(link.datagram(sensors, frame), state.time_us)
        if actuators is None:
            return
        state, sensors = plant.step(sea, state, actuators, rng)
        pacer.wait(state.time_us * 1e-6)


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

    with closing(TruthLog(path)) as log:
        yield log.write
