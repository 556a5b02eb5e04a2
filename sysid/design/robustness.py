"""How likely gains are to keep their promise: the share of the vehicles that a model allows for on
which they do."""

from collections import Counter
from collections.abc import Callable, Sequence

from sysid.control_analysis.loop_transfer import Gains
from sysid.design.constrained_search import SLACK
from sysid.design.constraints import Bounds, Misses
from sysid.design.design_model import Plant
from sysid.design.pid import depth, heading
from sysid.design.specification import Spec, Trust

Stability = Callable[[Plant, Gains, Bounds], Misses]

ANY = float("inf")
RELAXED = Bounds(damping=0.5, gm_db=5.0, pm_deg=40.0, ms=ANY)


def least(spec: Spec) -> Bounds:
    """What every vehicle is asked for, the nominal one's margins being larger."""
    return Bounds(spec.damping, spec.least_gm_db, spec.least_pm_deg, ANY)


def trust(vehicles: Sequence[Plant], gains: Gains, spec: Spec) -> Trust | None:
    """None where there are no vehicles to try."""
    if not vehicles:
        return None
    wanted = [misses(vehicle, gains, least(spec)) for vehicle in vehicles]
    relaxed = [misses(vehicle, gains, RELAXED) for vehicle in vehicles]
    return summed_up(wanted, relaxed)


def summed_up(wanted: Sequence[Misses], relaxed: Sequence[Misses]) -> Trust:
    """Of what each vehicle misses."""
    missed = Counter(
        max(each, key=lambda name: each[name]) for each in wanted if max(each.values()) > SLACK
    )
    worst = missed.most_common(1)[0][0] if missed else ""
    return Trust(_share(wanted), _share(relaxed), worst, len(wanted))


def share_of(
    vehicles: Sequence[Plant], stability: Stability, gains: Gains, bounds: Bounds
) -> float:
    """Of the vehicles on which the loops of one plane keep the bounds; 1 where there are none to
    try."""
    kept = [max(stability(vehicle, gains, bounds).values()) <= SLACK for vehicle in vehicles]
    return sum(kept) / len(kept) if kept else 1.0


def misses(vehicle: Plant, gains: Gains, bounds: Bounds) -> Misses:
    return {**heading.stability(vehicle, gains, bounds), **depth.stability(vehicle, gains, bounds)}


def _share(each: Sequence[Misses]) -> float:
    return sum(max(found.values()) <= SLACK for found in each) / len(each)
