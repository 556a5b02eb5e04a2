"""Search of one plane's gains that also suit the vehicles sampled from the model.

The search meets the limits of the nominal model. It is repeated until enough of the sampled
vehicles meet theirs: with single sampled vehicles that have to meet their limits, then with more
nominal damping, and at last with vehicles whose drive leaves too little gain margin.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Gains
from sysid.design import constraints
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, min_bounds
from sysid.design.design_model import DesignModel
from sysid.design.specification import DesignInfeasibleError, Spec

Array = NDArray[np.float64]

ROBUST_ENOUGH = 0.95
"""Share of sampled vehicles above which the search is not repeated for more of them."""
HARD_QUANTILES, ADDITIONS = (0.25, 0.75), 4
"""Quantiles of the vehicles that violate their limits, at which vehicles are added to the search,
and how often they are added.

A mode can be visible in the motion of sampled vehicles only; more nominal damping does not help
there.
"""
DAMPING_FACTORS = (1.08, 1.16)
"""Factors on the nominal damping ratio, tried in this order until the design is robust enough.

The margins required of the nominal model exceed those required of sampled vehicles; damping is the
same for both, so a robust design needs more damping on the nominal model.
"""
LOW_QUANTILE = 0.025
"""Quantile of the sampled vehicles' gain margins that must be large enough: the lower end of the
95 % interval."""
GAIN_MARGIN_ADDITIONS = 2
"""How often a vehicle at `LOW_QUANTILE` is added to the search."""


class Samples(NamedTuple):
    """Vehicles sampled from the posterior of a model."""

    vehicles: Sequence[DesignModel]
    unmeasured_drive: Sequence[Sequence[DesignModel]]
    """Vehicles whose drive only tests and bench test inform, each with its `drive_forms`."""


class PlaneSearch(NamedTuple):
    """Search of the gains of one plane."""

    plane: ModuleType
    """Module `heading` or `depth`."""
    vehicle: DesignModel
    """Nominal model."""
    samples: Samples
    spec: Spec
    others: Gains
    """Parameters that the search does not change."""

    def find(
        self,
        bounds: Bounds,
        starts: Sequence[Gains],
        sampled: Sequence[DesignModel] = (),
    ) -> dict[str, float]:
        """Return all parameters with the best gains of the plane within the bounds.

        Each of the vehicles `sampled` has to meet its limits. Raises DesignInfeasibleError.
        """
        found = self.plane.gains(self.vehicle, self.others, self.spec, bounds, starts, sampled)
        return {**self.others, **found}

    def worst_violations(self, gains: Gains) -> Array:
        """Return the largest violation of each sampled vehicle's limits."""
        bounds = min_bounds(self.spec)
        return np.array(
            [
                max(constraints.violations(self.plane.analyse(vehicle, gains), bounds).values())
                for vehicle in self.samples.vehicles
            ]
        )

    def gain_margin_db(self, vehicle: DesignModel, gains: Gains) -> float:
        """Return the smallest gain margin of the plane's loops on a vehicle."""
        loops = self.plane.open_loops(vehicle, gains).values()
        return min(loop_transfer.margins(loop).gm_db for loop in loops)

    def vehicle_of_low_margin(self, gains: Gains) -> DesignModel | None:
        """Return the vehicle at `LOW_QUANTILE` of the gain margins if its margin is too small."""
        lowest = sorted(
            (
                min(((self.gain_margin_db(form, gains), form) for form in forms), key=itemgetter(0))
                for forms in self.samples.unmeasured_drive
            ),
            key=itemgetter(0),
        )
        margin_db, vehicle = lowest[int(LOW_QUANTILE * len(lowest))] if lowest else (math.inf, None)
        enough_db = (1.0 - CONSTRAINT_TOLERANCE) * self.spec.robust_gm_db
        return None if margin_db >= enough_db else vehicle


class _Candidate(NamedTuple):
    """Gains, and the bounds of the nominal model within which they were found."""

    gains: dict[str, float]
    bounds: Bounds
    worst: Array
    """Largest violation of each sampled vehicle's limits."""
    sampled: tuple[DesignModel, ...] = ()
    """Sampled vehicles that had to meet their limits."""

    @property
    def fraction(self) -> float:
        """Share of the sampled vehicles that meet their limits; 1 without vehicles."""
        return float(np.mean(self.worst <= CONSTRAINT_TOLERANCE)) if self.worst.size else 1.0

    @property
    def hard(self) -> list[int]:
        """Numbers of vehicles that violate their limits, at `HARD_QUANTILES` of the violations."""
        order = np.argsort(self.worst)
        violating = order[self.worst[order] > CONSTRAINT_TOLERANCE].tolist()
        return [violating[int(at * len(violating))] for at in HARD_QUANTILES]


def robust_gains(search: PlaneSearch, starts: Sequence[Gains]) -> dict[str, float]:
    """Return gains of one plane that suit the nominal model and most of the sampled vehicles.

    Parameters
    ----------
    search : PlaneSearch
        Plane, model, sampled vehicles and specification.
    starts : Sequence of Gains
        Starting points of the free gains.

    Returns
    -------
    dict
        All parameters by name.

    Raises
    ------
    DesignInfeasibleError
        No gains meet the limits of the nominal model.
    """
    nominal = constraints.nominal(search.spec)
    gains = search.find(nominal, starts)
    candidate = _Candidate(gains, nominal, search.worst_violations(gains))
    candidate = _with_samples(search, candidate, starts)
    candidate = _with_damping(search, candidate, starts)
    return _with_gain_margin(search, candidate, starts).gains


def free_gains(plane: ModuleType, gains: Gains) -> dict[str, float]:
    """Return the gains that the search of a plane varies.

    Parameters
    ----------
    plane : ModuleType
        Module `heading` or `depth`.
    gains : Gains
        All parameters by name.

    Returns
    -------
    dict
        Free gains by name.
    """
    return {name: gains[name] for name in plane.STARTS[0]}


def _with_samples(
    search: PlaneSearch, candidate: _Candidate, starts: Sequence[Gains]
) -> _Candidate:
    """Add sampled vehicles to the search until enough of all meet their limits."""

    def with_hard(latest: _Candidate) -> _Candidate:
        hard = (search.samples.vehicles[number] for number in latest.hard)
        return latest._replace(sampled=(*latest.sampled, *hard))

    return _stricter(search, candidate, starts, [with_hard] * ADDITIONS)


def _with_damping(
    search: PlaneSearch, candidate: _Candidate, starts: Sequence[Gains]
) -> _Candidate:
    """Increase the nominal damping until enough sampled vehicles meet their limits."""

    def with_damping(factor: float, latest: _Candidate) -> _Candidate:
        damping = factor * candidate.bounds.damping
        return latest._replace(bounds=latest.bounds._replace(damping=damping))

    changes = [partial(with_damping, factor) for factor in DAMPING_FACTORS]
    return _stricter(search, candidate, starts, changes)


def _stricter(
    search: PlaneSearch,
    candidate: _Candidate,
    starts: Sequence[Gains],
    changes: Sequence[Callable[[_Candidate], _Candidate]],
) -> _Candidate:
    """Repeat the search with stricter limits until enough sampled vehicles meet theirs.

    Each change of the limits follows the last one, even if the share became smaller. Returns the
    candidate with the largest share.
    """
    best = latest = candidate
    for change in changes:
        if best.fraction >= ROBUST_ENOUGH:
            break
        found = _find(search, change(latest), starts)
        if found is None:
            break
        latest = found
        best = max(best, latest, key=_share)
    return best


def _with_gain_margin(
    search: PlaneSearch, candidate: _Candidate, starts: Sequence[Gains]
) -> _Candidate:
    """Add sampled vehicles to the search until nearly all have a gain margin that is large enough.

    A loop has its gain margin above the tested frequencies, where the model is least certain. If
    too few vehicles then meet their limits, single vehicles and damping are added again; a search
    that still has too few is not used. Each plane needs the square root of the share that is
    required of both planes together.
    """
    lowest_fraction = math.sqrt(search.spec.robust_fraction)
    for _ in range(GAIN_MARGIN_ADDITIONS):
        vehicle = search.vehicle_of_low_margin(candidate.gains)
        if vehicle is None:
            break
        found = _find(search, candidate._replace(sampled=(*candidate.sampled, vehicle)), starts)
        if found is not None and found.fraction < lowest_fraction:
            found = _with_damping(search, _with_samples(search, found, starts), starts)
        if found is None or found.fraction < lowest_fraction:
            break
        candidate = found
    return candidate


def _find(search: PlaneSearch, wanted: _Candidate, starts: Sequence[Gains]) -> _Candidate | None:
    """Search within the limits of a candidate, from its gains first; None if infeasible."""
    near = (free_gains(search.plane, wanted.gains), *starts)
    try:
        gains = search.find(wanted.bounds, near, wanted.sampled)
    except DesignInfeasibleError:
        return None
    return wanted._replace(gains=gains, worst=search.worst_violations(gains))


def _share(candidate: _Candidate) -> float:
    """Return the share of sampled vehicles that meet their limits."""
    return candidate.fraction
