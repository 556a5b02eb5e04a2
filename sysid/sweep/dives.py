"""Dives of a sweep: the inputs of each dive, and the row of its results.

Workers import this module, and the start of a worker takes as long as its imports.
"""

import csv
import io
import math
import shlex
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control.params import Config
from mavlink_io.errors import ErrorCode, OperationError
from sitl.vehicle.config import VehicleFileError
from sysid.models.parameters import MAX_DRAWS_PER_SAMPLE, NAMES, CandidateVehicle
from sysid.monte_carlo import metrics, simulate
from sysid.monte_carlo.metrics import DiveMetrics
from sysid.monte_carlo.samples import NoCovarianceError
from sysid.monte_carlo.simulate import MissionRejectedError, Sea
from sysid.planes import Plane
from sysid.sweep import campaigns
from sysid.sweep.campaigns import CampaignPlan, CampaignResult, SweepMission
from sysid.test_design.prior import DesignPrior
from sysid.trials import key_of, source_hash

Array = NDArray[np.float64]
KEY_LETTERS = 16
"""Number of letters of a dive's key: 64 bits."""
Z_DIGITS = 4
"""Decimals of z in a row, which is for analysis; the dive uses all digits."""


class OtherSourcesError(OperationError):
    """A process of the sweep runs other source code; the message gives the remedy."""

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


class DiveLimits(NamedTuple):
    """Limits that a dive must meet to pass, besides being held to its end; infinite for none."""

    heading_deg: float = math.inf
    pitch_deg: float = math.inf
    depth_m: float = math.inf
    """Largest 95 % error after settling."""
    settling_s: float = math.inf
    """Largest settling time of any leg."""


class SweepDive(NamedTuple):
    """Inputs of one dive."""

    number: int
    vehicle: str
    prior: DesignPrior
    spread: float
    gains: SweepGains
    mission: SweepMission
    conditions: Conditions
    shared_key: str
    """Hash of vehicle distribution, gains and mission, which many dives share."""
    z: Array
    """Sampled vehicle."""
    seed: int
    sample: int
    repeat: int

    def identity(self) -> tuple[object, ...]:
        """Return what identifies the dive, with the hash of what it shares with others."""
        return (
            self.number,
            self.vehicle,
            self.shared_key,
            self.conditions,
            self.z,
            self.seed,
            self.sample,
            self.repeat,
        )


class DiveChunk(NamedTuple):
    """Dives that one process flies in turn."""

    plan: str
    limits: DiveLimits
    source: str
    """Hash of the source code that the dives are to be flown with."""
    dives: tuple[SweepDive, ...]

    def identity(self) -> tuple[object, ...]:
        """Return what identifies the chunk."""
        return self.plan, self.limits, self.source, [dive.identity() for dive in self.dives]


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


def root(prior: DesignPrior, spread: float) -> Array:
    """Return a matrix L with L L^T = spread^2 P, P the covariance of z.

    Parameters
    ----------
    prior : DesignPrior
        Distribution of z.
    spread : float
        Factor on the standard deviations.

    Returns
    -------
    ndarray, shape (number of parameters, number of parameters)
        L, lower triangular.
    """
    regular = prior.covariance + 1e-12 * np.eye(len(NAMES))
    return np.asarray(spread * np.linalg.cholesky(regular))


def fly_chunk(chunk: DiveChunk) -> Part:
    """Fly the dives of a chunk.

    Parameters
    ----------
    chunk : DiveChunk
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
            z = dive.prior.mean + root(dive.prior, dive.spread) @ normals
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
    chunk: DiveChunk,
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
        f"ground sweep {shlex.quote(chunk.plan)} --dive {dive.number}",
    ]


def _passes(result: DiveMetrics, limits: DiveLimits) -> bool:
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
