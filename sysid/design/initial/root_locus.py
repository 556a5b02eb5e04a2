"""The largest gains on a root locus that are damped, keep their margins, and keep hold of the
vehicles of the prior."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import root_locus
from sysid.design import constraints
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel
from sysid.design.initial import loop_structure as shape
from sysid.design.initial import prior
from sysid.design.initial.loop_structure import LoopStructure
from sysid.design.specification import DesignInfeasibleError

Array = NDArray[np.float64]

STEP = 1.04
"""Between neighbours on a locus."""
TURN_FACTORS = STEP ** np.arange(-72.0, 20.0)
"""Loop gains that are tried, over the one with which a vehicle that only turned would cross at half
the bandwidth."""
DEPTH_FACTORS = STEP ** np.arange(-80.0, 1.0)
"""DPT_P over what a metre may ask of the pitch at most."""


class LocusPoint(NamedTuple):
    """One place on a locus."""

    shape: LoopStructure
    gains: dict[str, float]
    misses: ConstraintViolation


def heading(vehicle: DesignModel, drawn: Sequence[DesignModel], bounds: Bounds) -> LocusPoint:
    """HDG_P, HDG_D and HDG_I. Raises DesignRefused."""
    bandwidth = shape.bandwidth_radps(vehicle.yaw_lag)
    factors = 0.5 * bandwidth / abs(float(vehicle.planes.yaw.B[1])) * TURN_FACTORS
    shapes = [shape.heading(bandwidth / ratio) for ratio in shape.ZEROS]
    return _select_max_gain(
        "HDG_P", [p for s in shapes for p in points(s, vehicle, factors, bounds)], drawn
    )


def depth(
    vehicle: DesignModel, drawn: Sequence[DesignModel], bounds: Bounds, steepest_rad: float
) -> tuple[LocusPoint, LocusPoint]:
    """PTCH_P and PTCH_D; with them DPT_P, of ``steepest_rad`` a metre at most, and DPT_I. Raises
    DesignRefused."""
    bandwidth = shape.bandwidth_radps(vehicle.pitch_lag)
    factors = 0.5 * bandwidth / abs(float(vehicle.planes.pitch.B[1])) * TURN_FACTORS
    shapes = [shape.pitch(bandwidth / ratio) for ratio in shape.ZEROS]
    inner = _select_max_gain(
        "PTCH_P", [p for s in shapes for p in points(s, vehicle, factors, bounds)], drawn
    )
    held_by = {name: inner.gains[name] for name in ("PTCH_P", "PTCH_D", "PTCH_I")}
    outer = points(shape.depth(held_by), vehicle, steepest_rad * DEPTH_FACTORS, bounds)
    return inner, _select_max_gain("DPT_P", outer, drawn)


def points(
    loop: LoopStructure, vehicle: DesignModel, factors: Array, bounds: Bounds
) -> list[LocusPoint]:
    """Along one locus."""
    dampings = root_locus.damping(root_locus.poles(loop.opened(vehicle), factors))
    return [
        _point(loop, vehicle, loop.at(float(k)), float(z), bounds)
        for k, z in zip(factors, dampings, strict=True)
    ]


def _point(
    loop: LoopStructure,
    vehicle: DesignModel,
    gains: dict[str, float],
    damping: float,
    bounds: Bounds,
) -> LocusPoint:
    misses = {f"damping of the {loop.loop} loop": 1.0 - damping / bounds.damping}
    for name, cut in loop.cuts(vehicle, gains).items():
        misses |= constraints.margin_violations(cut, name, bounds)
    return LocusPoint(loop, gains, misses)


def _select_max_gain(
    gain: str, tried: Sequence[LocusPoint], drawn: Sequence[DesignModel]
) -> LocusPoint:
    """Of the points within the bounds, the one of the largest ``gain`` that the vehicles of the
    prior allow."""
    within = [point for point in tried if max(point.misses.values()) <= CONSTRAINT_TOLERANCE]
    if not within:
        nearest = min((point.misses for point in tried), key=lambda misses: max(misses.values()))
        worst, miss = max(nearest.items(), key=lambda item: item[1])
        raise DesignInfeasibleError(
            f"no gains meet the specification: the best found miss the {worst} by"
            f" {100 * miss:.1f} %"
        )
    for point in sorted(within, key=lambda point: -point.gains[gain]):
        if prior.is_robust(point.shape, point.gains, drawn):
            return point
    raise DesignInfeasibleError(
        f"no gains of the {within[0].shape.loop} loop keep hold of "
        f"{100 * prior.MIN_STABLE_FRACTION:.0f} % of the vehicles "
        "that the prior allows for; measure the tailcone by `ground bench-test`"
    )
