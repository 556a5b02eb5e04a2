"""Study of gains: the same sampled vehicles and disturbances under each set of gains."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import params
from autopilot.control.params import Config
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.mission_items import MissionItem
from sysid.models import noise
from sysid.monitor import tracking_metrics
from sysid.monte_carlo import metrics, samples, simulate
from sysid.monte_carlo.metrics import DiveMetrics
from sysid.monte_carlo.simulate import Sea
from sysid.test_design.prior import DesignPrior
from sysid.trials import map_trials

Array = NDArray[np.float64]
Report = Callable[[float], None]
"""Callback with the share of completed dives."""


class GainsError(InputError):
    """The autopilot rejects a parameter; the message names set, parameter and permitted range."""

    code = ErrorCode.GAINS_REJECTED


class StudyRequest(NamedTuple):
    """Mission, gains, conditions and number of samples."""

    items: tuple[MissionItem, ...]
    gains: Mapping[str, Mapping[str, float]]
    """Parameters by name, for each set by the name of the set."""
    seas: tuple[Sea, ...] = (Sea(),)
    vehicles: int = 30
    seed: int = 1
    jobs: int = 1
    """Number of processes."""
    keep: Path | None = None
    """File of finished dives, to which each new one is appended; None keeps none."""
    settling_s: float = tracking_metrics.SETTLING_S
    """Time (s) after a change of set-point from which on its errors count."""


class ResultRange(NamedTuple):
    """Statistics over the vehicles."""

    median: float
    worst: float


class LegSummary(NamedTuple):
    """One leg over all vehicles."""

    heading_deg: float
    depth_m: float
    settling_s: ResultRange | None
    """Settling time (s) of the vehicles that settled."""
    unsettled: int
    """Number of vehicles that did not settle."""


class SimulationSummary(NamedTuple):
    """One set of gains under one condition; None where no vehicle has a value."""

    gains: str
    sea: Sea
    vehicles: int
    heading_deg: ResultRange | None
    """95 % of the steady error (deg)."""
    pitch_deg: ResultRange | None
    depth_m: ResultRange | None
    legs: tuple[LegSummary, ...]
    rudder_deg: ResultRange
    elevator_deg: ResultRange
    at_stops_pct: ResultRange
    shallowest_m: ResultRange | None
    broached: int
    diverged: dict[str, int]
    """Number of vehicles by the quantity that was not held."""
    failsafes: dict[str, int]
    """Number of vehicles by the failsafe that ended the mission."""
    vehicle_s: float
    """Simulated time of all dives (s)."""

    @property
    def failed(self) -> int:
        """Number of vehicles that diverged, broached or did not finish.

        It is a lower bound, because one vehicle can fail in several ways.
        """
        return max(self.broached, sum(self.diverged.values()), sum(self.failsafes.values()))


class _Trial(NamedTuple):
    """One dive of the study."""

    posterior: DesignPrior
    items: tuple[MissionItem, ...]
    config: Config
    sea: Sea
    z: Array
    seed: tuple[int, int]
    settling_s: float


def simulate_samples(
    posterior: DesignPrior, request: StudyRequest, report: Report | None = None
) -> tuple[SimulationSummary, ...]:
    """Simulate sampled vehicles under every set of gains and every condition.

    Parameters
    ----------
    posterior : DesignPrior
        Posterior of the model.
    request : StudyRequest
        Mission, gains, conditions and number of samples. A set without trims uses those of the mean
        vehicle, as a trim flight would find them.
    report : Report, optional
        Callback for progress.

    Returns
    -------
    tuple of SimulationSummary
        One summary per set of gains and condition, with the same draws for all.

    Raises
    ------
    GainsError
        A parameter is rejected.
    MissionRejectedError
        The mission is rejected.
    NoCovarianceError
        The posterior gives hardly any possible vehicle.
    TrialsError
        The processes die.
    """
    samples_of_z = samples.draw(posterior, request.vehicles, request.seed)
    trims = samples.trims_deg(posterior.vehicle(posterior.mean))
    sets = [(name, sea) for name in request.gains for sea in request.seas]
    configs = {name: _config(name, {**trims, **values}) for name, values in request.gains.items()}
    dives = [
        _Trial(
            posterior=posterior,
            items=request.items,
            config=configs[name],
            sea=sea,
            z=z,
            seed=(request.seed, number),
            settling_s=request.settling_s,
        )
        for name, sea in sets
        for number, z in enumerate(samples_of_z)
    ]
    results = map_trials(
        _fly,
        dives,
        DiveMetrics,
        jobs=request.jobs,
        keep=request.keep,
        on_result=lambda done: report(done / len(dives)) if report else None,
    )
    n_vehicles = len(samples_of_z)
    return tuple(
        _summarise(name, sea, results[n * n_vehicles : (n + 1) * n_vehicles])
        for n, (name, sea) in enumerate(sets)
    )


def _config(name: str, values: Mapping[str, float]) -> Config:
    """Return the autopilot's parameters. Raises GainsError."""
    try:
        return params.config(values)
    except params.ParamError as error:
        raise GainsError(f"{name}: {error}") from None


def _fly(job: _Trial) -> DiveMetrics:
    """Simulate one dive and return its metrics."""
    vehicle = job.posterior.vehicle(job.z)
    levels = noise.at_depth(job.posterior.noise, simulate.mean_depth_m(job.items))
    dive = simulate.fly(vehicle, levels, job.items, job.config, job.sea, job.seed)
    hull_radius_m = vehicle.model.hydrostatics.radius_m
    return metrics.of_dive(dive, job.config.travel_rad, hull_radius_m, job.settling_s)


def _summarise(name: str, sea: Sea, results: Sequence[DiveMetrics]) -> SimulationSummary:
    """Return the summary of one set of gains under one condition."""
    steady = [dive.steady for dive in results if dive.steady]
    shallowest = [dive.shallowest_m for dive in results if dive.shallowest_m is not None]
    return SimulationSummary(
        gains=name,
        sea=sea,
        vehicles=len(results),
        heading_deg=_range([s.heading_deg for s in steady]),
        pitch_deg=_range([s.pitch_deg for s in steady]),
        depth_m=_range([s.depth_m for s in steady]),
        legs=_legs(results),
        rudder_deg=_range_of([dive.rudder_deg for dive in results]),
        elevator_deg=_range_of([dive.elevator_deg for dive in results]),
        at_stops_pct=_range_of([100.0 * dive.stopped for dive in results]),
        shallowest_m=ResultRange(float(np.median(shallowest)), min(shallowest))
        if shallowest
        else None,
        broached=sum(dive.broached for dive in results),
        diverged=dict(sorted(Counter(dive.diverged for dive in results if dive.diverged).items())),
        failsafes=dict(sorted(Counter(dive.failsafe for dive in results if dive.failsafe).items())),
        vehicle_s=sum(dive.seconds for dive in results),
    )


def _legs(results: Sequence[DiveMetrics]) -> tuple[LegSummary, ...]:
    """Return the legs of the longest dive; legs that a vehicle did not reach count as unsettled."""
    longest = max((dive.legs for dive in results), key=len)
    return tuple(_leg(results, number) for number in range(len(longest)))


def _leg(results: Sequence[DiveMetrics], number: int) -> LegSummary:
    """Return the summary of one leg."""
    legs = [dive.legs[number] for dive in results if len(dive.legs) > number]
    settled = [leg.settling_s for leg in legs if leg.settling_s is not None]
    return LegSummary(
        heading_deg=legs[0].heading_deg,
        depth_m=legs[0].depth_m,
        settling_s=_range(settled),
        unsettled=len(results) - len(settled),
    )


def _range(values: Sequence[float]) -> ResultRange | None:
    """Return the range of the values, or None without values."""
    return _range_of(values) if values else None


def _range_of(values: Sequence[float]) -> ResultRange:
    """Return median and maximum."""
    return ResultRange(float(np.median(values)), max(values))
