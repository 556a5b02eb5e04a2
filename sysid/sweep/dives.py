"""Dives of a sweep: the inputs of each dive, and the row of its results.

The dives are numbered sample by sample, so that more samples append dives to a sweep and leave the
numbers of the first ones.
"""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from autopilot.control.params import Config
from mavlink_io.errors import ErrorCode, OperationError
from sitl.vehicle.config import VehicleFileError
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.monte_carlo import metrics, simulate
from sysid.monte_carlo.metrics import DiveMetrics
from sysid.monte_carlo.samples import MAX_DRAWS_PER_SAMPLE, NoCovarianceError
from sysid.monte_carlo.simulate import MissionRejectedError, Sea
from sysid.planes import Plane
from sysid.sweep import campaigns, points
from sysid.sweep.campaigns import CampaignPlan, CampaignResult, SweepMission
from sysid.sweep.points import Range, Sampler
from sysid.test_design.prior import DesignPrior
from sysid.trials import key_of, source_hash

Array = NDArray[np.float64]
Levels = tuple[float, ...] | Range
"""Values of an input: each of them is flown, or samples of a range are."""

KEY_LETTERS = 16
"""Number of letters of a dive's key: 64 bits."""
Z_DIGITS = 4
"""Decimals of z in a row, which is for analysis; the dive uses all digits."""


class OtherSourcesError(OperationError):
    """A process of the sweep runs other source code; the message says what to do."""

    code = ErrorCode.OTHER_SOURCES


class Conditions(NamedTuple):
    """Sea and faults of a dive; the fields are the inputs that a sweep may vary."""

    disturbance_scale: float = 1.0
    """Factor on the identified disturbance."""
    current_mps: float = 0.0
    """Speed of the current; its direction is random."""
    rudder_bias_deg: float = 0.0
    elevator_bias_deg: float = 0.0
    """Change of the biases of rudder and elevator since identification."""
    actuator_rate_scale: float = 1.0
    """Factor on the rate limit of both surfaces."""
    actuator_delay_s: float = 0.0
    """Additional delay of both surfaces."""


class SweepGains(NamedTuple):
    """Parameters of the autopilot for one vehicle and one set of gains."""

    name: str
    config: Config
    campaign: CampaignPlan | None = None
    """Campaign on each vehicle, whose redesigned gains are flown instead of `config`."""


class SweepVehicle(NamedTuple):
    """A distribution of vehicles, and the sets of gains that fly them."""

    name: str
    prior: DesignPrior
    spread: float
    """Factor on the standard deviations; 0 flies the mean vehicle."""
    gains: tuple[SweepGains, ...]


class Limits(NamedTuple):
    """Limits that a dive must meet to pass, besides being held to its end; infinite for none."""

    heading_deg: float = math.inf
    pitch_deg: float = math.inf
    depth_m: float = math.inf
    """Largest 95 % error after settling."""
    settling_s: float = math.inf
    """Largest settling time of any leg."""


class SweepRequest(NamedTuple):
    """A sweep: every combination is flown with every sample."""

    name: str
    """File name of the plan, for the command in each row."""
    vehicles: tuple[SweepVehicle, ...]
    missions: tuple[SweepMission, ...]
    conditions: Mapping[str, Levels]
    """Values of the fields of `Conditions`; a field that is missing has its default."""
    limits: Limits = Limits()
    sampler: Sampler = Sampler.SOBOL
    samples: int = 64
    repeats: int = 1
    """Number of dives of each combination and sample, with other noise."""
    seed: int = 1
    chunk: int = 8
    """Number of dives that a process flies at a time, and of rows of a part."""


class SweepDive(NamedTuple):
    """Inputs of one dive."""

    number: int
    vehicle: str
    prior: DesignPrior
    spread: float
    gains: SweepGains
    mission: SweepMission
    conditions: Conditions
    z: Array
    """Sampled vehicle."""
    seed: int
    sample: int
    repeat: int


class Chunk(NamedTuple):
    """Dives that one process flies in turn."""

    plan: str
    limits: Limits
    source: str
    """Hash of the source code that the dives are to be flown with."""
    dives: tuple[SweepDive, ...]


class Part(NamedTuple):
    """Rows of a chunk."""

    first: int
    """Number of the first dive."""
    rows: int
    text: str
    """Lines of CSV without a header; empty where only the number of rows is of interest."""


_CHOICES = ("vehicle", "gains", "mission")
_METRICS = (
    "passed",
    "diverged",
    "failsafe",
    "broached",
    "heading_deg",
    "pitch_deg",
    "depth_m",
    "settling_s",
    "unsettled_legs",
    "rudder_deg",
    "elevator_deg",
    "at_stops_pct",
    "shallowest_m",
    "seconds",
)
COLUMNS = (
    "dive",
    *_CHOICES,
    "sample",
    "repeat",
    *Conditions._fields,
    *_METRICS,
    "tests_s",
    "not_redesigned",
    "redraws",
    *(f"z_{name}" for name in NAMES),
    "key",
    "command",
)
"""Columns of a row."""


class Chunks(Sequence[Chunk]):
    """The chunks of a sweep, each made when it is read: a sweep may have a million dives.

    Parameters
    ----------
    request : SweepRequest
        The sweep.
    """

    def __init__(self, request: SweepRequest) -> None:
        self._request = request
        self._ranges = {
            name: levels for name, levels in request.conditions.items() if isinstance(levels, Range)
        }
        grid = {
            name: levels
            for name, levels in request.conditions.items()
            if not isinstance(levels, Range)
        }
        self._combinations = [
            (vehicle, gains, mission, dict(zip(grid, values, strict=True)))
            for vehicle in request.vehicles
            for gains in vehicle.gains
            for mission in request.missions
            for values in product(*grid.values())
        ]
        self._points = points.draw(
            request.sampler, request.samples, len(self._ranges) + len(NAMES), request.seed
        )
        self._roots = {v.name: _root(v.prior, v.spread) for v in request.vehicles}

    @property
    def combinations(self) -> int:
        """Number of combinations of vehicle, gains, mission and listed values."""
        return len(self._combinations)

    @property
    def dives(self) -> int:
        """Number of dives."""
        return self._request.samples * self.combinations * self._request.repeats

    def __len__(self) -> int:
        """Return the number of chunks."""
        return -(-self.dives // self._request.chunk)

    @overload
    def __getitem__(self, index: int) -> Chunk: ...
    @overload
    def __getitem__(self, index: slice) -> list[Chunk]: ...
    def __getitem__(self, index: int | slice) -> Chunk | list[Chunk]:
        """Return one chunk or several."""
        if isinstance(index, slice):
            return [self[n] for n in range(*index.indices(len(self)))]
        if not 0 <= index < len(self):
            raise IndexError(index)
        first = index * self._request.chunk
        return self.of_dives(range(first, min(first + self._request.chunk, self.dives)))

    def of_dives(self, numbers: Sequence[int]) -> Chunk:
        """Return a chunk with these dives.

        Parameters
        ----------
        numbers : sequence of int
            Numbers of dives, from 0.

        Returns
        -------
        Chunk
            Inputs of the dives.
        """
        return Chunk(
            plan=self._request.name,
            limits=self._request.limits,
            source=source_hash(),
            dives=tuple(map(self._dive, numbers)),
        )

    def _dive(self, number: int) -> SweepDive:
        """Return the inputs of a dive: repeats vary fastest, samples slowest."""
        request = self._request
        others, repeat = divmod(number, request.repeats)
        sample, combination = divmod(others, self.combinations)
        vehicle, gains, mission, listed = self._combinations[combination]
        point, count = self._points[sample], len(self._ranges)
        sampled = points.to_ranges(point[:count].tolist(), tuple(self._ranges.values()))
        values = listed | dict(zip(self._ranges, sampled, strict=True))
        return SweepDive(
            number=number,
            vehicle=vehicle.name,
            prior=vehicle.prior,
            spread=vehicle.spread,
            gains=gains,
            mission=mission,
            conditions=Conditions(**values),
            z=vehicle.prior.mean + self._roots[vehicle.name] @ points.to_normal(point[count:]),
            seed=request.seed,
            sample=sample,
            repeat=repeat,
        )


def _root(prior: DesignPrior, spread: float) -> Array:
    """Return a matrix L with L L^T = spread^2 P, P the covariance of z."""
    regular = prior.covariance + 1e-12 * np.eye(len(NAMES))
    return np.asarray(spread * np.linalg.cholesky(regular))


def fly_chunk(chunk: Chunk) -> Part:
    """Fly the dives of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Inputs of the dives.

    Returns
    -------
    Part
        One row for each dive.

    Raises
    ------
    OtherSourcesError
        This process runs other source code than the one that made the chunk.
    MissionRejectedError
        The autopilot rejects a mission; the message names gains and mission.
    NoCovarianceError
        A distribution gives hardly any possible vehicle.
    """
    if chunk.source != source_hash():
        raise OtherSourcesError(
            "a process of the sweep has other source code or another version of Python or numpy;"
            " install the same versions for all workers"
        )
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    vehicles = dict[tuple[str, int], tuple[CandidateVehicle, Array, int]]()
    campaign_results = dict[tuple[object, ...], CampaignResult]()
    for dive in chunk.dives:
        sampled = (dive.vehicle, dive.sample)
        if sampled not in vehicles:
            vehicles[sampled] = _possible_vehicle(dive)
        vehicle, z, redraws = vehicles[sampled]
        config, result = dive.gains.config, None
        if dive.gains.campaign:
            tested = (*sampled, dive.repeat, dive.gains.name, _sea_before_faults(dive.conditions))
            if tested not in campaign_results:
                campaign_results[tested] = _run_campaign(dive, dive.gains.campaign, vehicle)
            result = campaign_results[tested]
            config = result.config
        lines.writerow(_row(dive, chunk, _fly(dive, vehicle, config), result, z, redraws))
    return Part(chunk.dives[0].number, len(chunk.dives), text.getvalue())


def _run_campaign(dive: SweepDive, plan: CampaignPlan, vehicle: CandidateVehicle) -> CampaignResult:
    """Return the gains of a campaign in the sea of a dive, before its faults."""
    sea, seed = _sea_before_faults(dive.conditions), (dive.seed, dive.sample, dive.repeat)
    try:
        return campaigns.run(plan, vehicle, dive.prior, sea, seed)
    except MissionRejectedError as error:
        raise MissionRejectedError(f"tests of {dive.gains.name}: {error}") from None


def _sea_before_faults(conditions: Conditions) -> Sea:
    """Return the sea without the change of the rudder bias."""
    return Sea(times=conditions.disturbance_scale, current_mps=conditions.current_mps)


def _possible_vehicle(dive: SweepDive) -> tuple[CandidateVehicle, Array, int]:
    """Return vehicle, z and number of redraws; impossible vehicles are drawn again at random."""
    z, rng = dive.z, np.random.default_rng((dive.seed, dive.sample))
    for redraws in range(MAX_DRAWS_PER_SAMPLE):
        try:
            return dive.prior.vehicle(z), z, redraws
        except VehicleFileError:
            normals = rng.standard_normal(len(NAMES))
            z = dive.prior.mean + _root(dive.prior, dive.spread) @ normals
    raise NoCovarianceError(
        f"{dive.vehicle}: its distribution gives hardly any possible vehicle; give a smaller spread"
    )


def _fly(dive: SweepDive, vehicle: CandidateVehicle, config: Config) -> DiveMetrics:
    """Return the metrics of one dive."""
    shift_rad = math.radians(dive.conditions.rudder_bias_deg)
    sea = _sea_before_faults(dive.conditions)._replace(bias_shift_rad=shift_rad)
    try:
        flown = simulate.fly(
            _with_faults(vehicle, dive.conditions),
            dive.prior.noise,
            dive.mission.items,
            config,
            sea,
            (dive.seed, dive.sample, dive.repeat),
        )
    except MissionRejectedError as error:
        raise MissionRejectedError(f"{dive.mission.name}, {dive.gains.name}: {error}") from None
    return metrics.of_dive(flown, config.travel_rad, vehicle.model.hydrostatics.radius_m)


def _with_faults(vehicle: CandidateVehicle, conditions: Conditions) -> CandidateVehicle:
    """Return the vehicle with the faults that `Sea` does not have."""
    shift_rad = {Plane.YAW: 0.0, Plane.PITCH: math.radians(conditions.elevator_bias_deg)}
    actuators = {
        plane: actuator._replace(
            bias_rad=actuator.bias_rad + shift_rad[plane],
            rate_radps=actuator.rate_radps * conditions.actuator_rate_scale,
            delay_s=actuator.delay_s + conditions.actuator_delay_s,
        )
        for plane, actuator in vehicle.actuators.items()
    }
    return vehicle._replace(actuators=actuators)


def _row(
    dive: SweepDive,
    chunk: Chunk,
    result: DiveMetrics,
    campaign: CampaignResult | None,
    z: Array,
    redraws: int,
) -> list[object]:
    """Return the row of a dive; an empty cell means that there is no value."""
    steady = result.steady
    settling_s = [leg.settling_s for leg in result.legs if leg.settling_s is not None]
    return [
        dive.number,
        dive.vehicle,
        dive.gains.name,
        dive.mission.name,
        dive.sample,
        dive.repeat,
        *dive.conditions,
        int(_passes(result, chunk.limits)),
        result.diverged,
        result.failsafe,
        int(result.broached),
        steady and steady.heading_deg,
        steady and steady.pitch_deg,
        steady and steady.depth_m,
        max(settling_s, default=None),
        len(result.legs) - len(settling_s),
        result.rudder_deg,
        result.elevator_deg,
        100.0 * result.stopped,
        result.shallowest_m,
        result.seconds,
        campaign and campaign.tests_s,
        campaign and campaign.failure,
        redraws,
        *(f"{value:.{Z_DIGITS}f}" for value in z),
        key_of(fly_chunk, chunk._replace(dives=(dive,)))[:KEY_LETTERS],
        f"ground sweep {chunk.plan} --dive {dive.number}",
    ]


def _passes(result: DiveMetrics, limits: Limits) -> bool:
    """Return whether a dive was held to its end, did not broach and met the limits."""
    if result.diverged or result.failsafe or result.broached:
        return False
    errors = [
        (result.steady and getattr(result.steady, name), getattr(limits, name))
        for name in ("heading_deg", "pitch_deg", "depth_m")
    ]
    settling = [(leg.settling_s, limits.settling_s) for leg in result.legs]
    return all(
        limit == math.inf or (value is not None and value <= limit)
        for value, limit in (*errors, *settling)
    )


def rows_of(text: str) -> Iterator[dict[str, str]]:
    """Yield the rows of a part as text by column.

    Parameters
    ----------
    text : str
        Lines of CSV without a header.

    Yields
    ------
    dict
        Cells by the names in `COLUMNS`.
    """
    yield from csv.DictReader(io.StringIO(text), fieldnames=COLUMNS)
