"""How likely gains are to keep their promise: the share of the vehicles that a model allows for on
which they do."""

from collections import Counter
from collections.abc import Callable, Sequence

from sysid.control_analysis.loop_transfer import Gains
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel
from sysid.design.pid import depth, heading
from sysid.design.specification import DesignRobustness, Spec

Stability = Callable[[DesignModel, Gains, Bounds], ConstraintViolation]

UNLIMITED = float("inf")
RELAXED = Bounds(damping=0.5, gm_db=5.0, pm_deg=40.0, ms=UNLIMITED)


def min_bounds(spec: Spec) -> Bounds:
    """What every vehicle is asked for, the nominal one's margins being larger."""
    return Bounds(spec.damping, spec.least_gm_db, spec.least_pm_deg, UNLIMITED)


def robustness(
    vehicles: Sequence[DesignModel], gains: Gains, spec: Spec
) -> DesignRobustness | None:
    """None where there are no vehicles to try."""
    if not vehicles:
        return None
    wanted = [violations(vehicle, gains, min_bounds(spec)) for vehicle in vehicles]
    relaxed = [violations(vehicle, gains, RELAXED) for vehicle in vehicles]
    return summarise(wanted, relaxed)


def summarise(
    wanted: Sequence[ConstraintViolation], relaxed: Sequence[ConstraintViolation]
) -> DesignRobustness:
    """Of what each vehicle misses."""
    missed = Counter(
        max(each, key=lambda name: each[name])
        for each in wanted
        if max(each.values()) > CONSTRAINT_TOLERANCE
    )
    worst = missed.most_common(1)[0][0] if missed else ""
    return DesignRobustness(_fraction(wanted), _fraction(relaxed), worst, len(wanted))


def fraction_satisfying(
    vehicles: Sequence[DesignModel], stability: Stability, gains: Gains, bounds: Bounds
) -> float:
    """Of the vehicles on which the loops of one plane keep the bounds; 1 where there are none to
    try."""
    kept = [
        max(stability(vehicle, gains, bounds).values()) <= CONSTRAINT_TOLERANCE
        for vehicle in vehicles
    ]
    return sum(kept) / len(kept) if kept else 1.0


def violations(vehicle: DesignModel, gains: Gains, bounds: Bounds) -> ConstraintViolation:
    return {
        **heading.violations(vehicle, gains, bounds),
        **depth.violations(vehicle, gains, bounds),
    }


def _fraction(each: Sequence[ConstraintViolation]) -> float:
    return sum(max(found.values()) <= CONSTRAINT_TOLERANCE for found in each) / len(each)
