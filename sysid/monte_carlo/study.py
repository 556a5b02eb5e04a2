"""The same vehicles in the same seas under each set of gains, and what to tell of it."""

import signal
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import params
from autopilot.control.params import Config
from mavlink_io.mission_items import MissionItem
from sysid.monte_carlo import metrics, samples, simulate
from sysid.monte_carlo.metrics import DiveMetrics
from sysid.monte_carlo.simulate import Sea
from sysid.test_design.prior import DesignPrior

Array = NDArray[np.float64]
Report = Callable[[float, float], None]
"""Called with the share of the dives that are done and the vehicle seconds in them."""


class GainsError(ValueError):
    """Parameters that the autopilot does not take; the message names set, parameter and what would
    be right."""


class StudyRequest(NamedTuple):
    """What to fly, by whom and where."""

    items: tuple[MissionItem, ...]
    gains: Mapping[str, Mapping[str, float]]
    """Parameters by name, of each set by the set's name."""
    seas: tuple[Sea, ...] = (Sea(),)
    vehicles: int = 30
    seed: int = 1
    processes: int = 1


class Range(NamedTuple):
    """Over the vehicles."""

    median: float
    worst: float


class LegSummary(NamedTuple):
    heading_deg: float
    depth_m: float
    settled_s: Range | None
    """Of those that settled."""
    unsettled: int


class SimulationSummary(NamedTuple):
    """One set of gains in one sea. None is for what no vehicle showed."""

    gains: str
    sea: Sea
    vehicles: int
    heading_deg: Range | None
    """95 % of the steady error."""
    pitch_deg: Range | None
    depth_m: Range | None
    legs: tuple[LegSummary, ...]
    rudder_deg: Range
    elevator_deg: Range
    stopped_pct: Range
    shallowest_m: Range | None
    broached: int
    diverged: dict[str, int]
    """Vehicles by what they did not hold."""
    failsafes: dict[str, int]
    """Vehicles whose mission was ended, by what for."""
    vehicle_s: float

    @property
    def failed(self) -> int:
        """Vehicles that diverged, broached or did not come to the end; one may have done all of
        it."""
        return max(self.broached, sum(self.diverged.values()), sum(self.failsafes.values()))


class _Trial(NamedTuple):
    belief: DesignPrior
    items: tuple[MissionItem, ...]
    config: Config
    sea: Sea
    z: Array
    seed: tuple[int, int]


def simulate_samples(
    belief: DesignPrior, request: StudyRequest, report: Report | None = None
) -> tuple[SimulationSummary, ...]:
    """Fly ``request.vehicles`` draws of ``belief`` under every set of gains in every sea; the same
    draws and seas.

    Where a set has no trims, those of the believed vehicle are aboard, as a trim flight would find
    them.

    Raises:
        GainsError, RefusedError: gains or a mission that the autopilot does not take.
        UnknownError: the belief allows for hardly any vehicle that can be.
    """
    drawn = samples.draw(belief, request.vehicles, request.seed)
    trims = samples.trims_deg(belief.vehicle(belief.mean))
    sets = [(name, sea) for name in request.gains for sea in request.seas]
    configs = {name: _config(name, {**trims, **values}) for name, values in request.gains.items()}
    jobs = [
        _Trial(belief, request.items, configs[name], sea, z, (request.seed, number))
        for name, sea in sets
        for number, z in enumerate(drawn)
    ]
    flown = list(_with_progress(_fly_all(jobs, request.processes), len(jobs), report))
    each = len(drawn)
    return tuple(
        _summarise(name, sea, flown[n * each : (n + 1) * each])
        for n, (name, sea) in enumerate(sets)
    )


def _config(name: str, values: Mapping[str, float]) -> Config:
    try:
        return params.config(values)
    except params.ParamError as error:
        raise GainsError(f"{name}: {error}") from None


def _fly_all(jobs: Sequence[_Trial], processes: int) -> Iterator[DiveMetrics]:
    if processes == 1:
        yield from map(_fly, jobs)
        return
    # An interrupt reaches the whole group; the workers leave it to whoever started them.
    ignoring = partial(signal.signal, signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(
        processes, mp_context=get_context("forkserver"), initializer=ignoring
    ) as pool:
        try:
            yield from pool.map(_fly, jobs)
        finally:
            pool.shutdown(cancel_futures=True)


def _fly(job: _Trial) -> DiveMetrics:
    vehicle = job.belief.vehicle(job.z)
    flown = simulate.fly(vehicle, job.belief.noise, job.items, job.config, job.sea, job.seed)
    return metrics.of_dive(flown, job.config.travel_rad, vehicle.model.hydrostatics.radius_m)


def _with_progress(
    flown: Iterable[DiveMetrics], count: int, report: Report | None
) -> Iterator[DiveMetrics]:
    seconds = 0.0
    for number, one in enumerate(flown, start=1):
        seconds += one.seconds
        if report:
            report(number / count, seconds)
        yield one


def _summarise(name: str, sea: Sea, flown: Sequence[DiveMetrics]) -> SimulationSummary:
    steady = [one.steady for one in flown if one.steady]
    shallowest = [one.shallowest_m for one in flown if one.shallowest_m is not None]
    return SimulationSummary(
        gains=name,
        sea=sea,
        vehicles=len(flown),
        heading_deg=_range([s.heading_deg for s in steady]),
        pitch_deg=_range([s.pitch_deg for s in steady]),
        depth_m=_range([s.depth_m for s in steady]),
        legs=_legs(flown),
        rudder_deg=_range_of([one.rudder_deg for one in flown]),
        elevator_deg=_range_of([one.elevator_deg for one in flown]),
        stopped_pct=_range_of([100.0 * one.stopped for one in flown]),
        shallowest_m=Range(float(np.median(shallowest)), min(shallowest)) if shallowest else None,
        broached=sum(one.broached for one in flown),
        diverged=dict(sorted(Counter(one.diverged for one in flown if one.diverged).items())),
        failsafes=dict(sorted(Counter(one.failsafe for one in flown if one.failsafe).items())),
        vehicle_s=sum(one.seconds for one in flown),
    )


def _legs(flown: Sequence[DiveMetrics]) -> tuple[LegSummary, ...]:
    """Leg by leg of the longest dive; a vehicle that did not come to one did not settle on it."""
    longest = max((one.legs for one in flown), key=len)
    return tuple(_leg(flown, number) for number in range(len(longest)))


def _leg(flown: Sequence[DiveMetrics], number: int) -> LegSummary:
    legs = [one.legs[number] for one in flown if len(one.legs) > number]
    settled = [leg.settled_s for leg in legs if leg.settled_s is not None]
    return LegSummary(
        legs[0].heading_deg, legs[0].depth_m, _range(settled), len(flown) - len(settled)
    )


def _range(values: Sequence[float]) -> Range | None:
    return _range_of(values) if values else None


def _range_of(values: Sequence[float]) -> Range:
    return Range(float(np.median(values)), max(values))
