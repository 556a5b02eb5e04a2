"""The largest gains on a root locus that are damped, keep their margins, and keep hold of the
vehicles of the prior."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import root_locus
from sysid.design import constraints
from sysid.design.constrained_search import SLACK
from sysid.design.constraints import Bounds, Misses
from sysid.design.design_model import Plant
from sysid.design.initial import loop_structure as shape
from sysid.design.initial import prior
from sysid.design.initial.loop_structure import Shape
from sysid.design.specification import DesignRefused

Array = NDArray[np.float64]

STEP = 1.04
"""Between neighbours on a locus."""
TURN_FACTORS = STEP ** np.arange(-72.0, 20.0)
"""Loop gains that are tried, over the one with which a vehicle that only turned would cross at half
the bandwidth."""
DEPTH_FACTORS = STEP ** np.arange(-80.0, 1.0)
"""DPT_P over what a metre may ask of the pitch at most."""


class Point(NamedTuple):
    """One place on a locus."""

    shape: Shape
    gains: dict[str, float]
    misses: Misses


def heading(vehicle: Plant, drawn: Sequence[Plant], bounds: Bounds) -> Point:
    """HDG_P, HDG_D and HDG_I. Raises DesignRefused."""
    bandwidth = shape.bandwidth_radps(vehicle.yaw_lag)
    factors = 0.5 * bandwidth / abs(float(vehicle.planes.yaw.B[1])) * TURN_FACTORS
    shapes = [shape.heading(bandwidth / ratio) for ratio in shape.ZEROS]
    return _largest(
        "HDG_P", [p for s in shapes for p in points(s, vehicle, factors, bounds)], drawn
    )


def depth(
    vehicle: Plant, drawn: Sequence[Plant], bounds: Bounds, steepest_rad: float
) -> tuple[Point, Point]:
    """PTCH_P and PTCH_D; with them DPT_P, of ``steepest_rad`` a metre at most, and DPT_I. Raises
    DesignRefused."""
    bandwidth = shape.bandwidth_radps(vehicle.pitch_lag)
    factors = 0.5 * bandwidth / abs(float(vehicle.planes.pitch.B[1])) * TURN_FACTORS
    shapes = [shape.pitch(bandwidth / ratio) for ratio in shape.ZEROS]
    inner = _largest(
        "PTCH_P", [p for s in shapes for p in points(s, vehicle, factors, bounds)], drawn
    )
    held_by = {name: inner.gains[name] for name in ("PTCH_P", "PTCH_D", "PTCH_I")}
    outer = points(shape.depth(held_by), vehicle, steepest_rad * DEPTH_FACTORS, bounds)
    return inner, _largest("DPT_P", outer, drawn)


def points(loop: Shape, vehicle: Plant, factors: Array, bounds: Bounds) -> list[Point]:
    """Along one locus."""
    dampings = root_locus.damping(root_locus.poles(loop.opened(vehicle), factors))
    return [
        _point(loop, vehicle, loop.at(float(k)), float(z), bounds)
        for k, z in zip(factors, dampings, strict=True)
    ]


def _point(
    loop: Shape, vehicle: Plant, gains: dict[str, float], damping: float, bounds: Bounds
) -> Point:
    misses = {f"damping of the {loop.loop} loop": 1.0 - damping / bounds.damping}
    for name, cut in loop.cuts(vehicle, gains).items():
        misses |= constraints.of_cut(cut, name, bounds)
    return Point(loop, gains, misses)


def _largest(gain: str, tried: Sequence[Point], drawn: Sequence[Plant]) -> Point:
    """Of the points within the bounds, the one of the largest ``gain`` that the vehicles of the
    prior allow."""
    within = [point for point in tried if max(point.misses.values()) <= SLACK]
    if not within:
        nearest = min((point.misses for point in tried), key=lambda misses: max(misses.values()))
        worst, miss = max(nearest.items(), key=lambda item: item[1])
        raise DesignRefused(
            f"no gains meet the specification: the best found miss the {worst} by"
            f" {100 * miss:.1f} %"
        )
    for point in sorted(within, key=lambda point: -point.gains[gain]):
        if prior.enough_hold(point.shape, point.gains, drawn):
            return point
    raise DesignRefused(
        f"no gains of the {within[0].shape.loop} loop keep hold of {100 * prior.SHARE:.0f} % of the"
        " vehicles that the prior allows for; measure the tailcone by `ground bench`"
    )
