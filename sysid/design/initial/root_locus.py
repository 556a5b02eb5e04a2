"""Selection of the largest gain on a root locus with enough damping, margins and robustness."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer, root_locus
from sysid.design import constraints
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE, PARAMETER_RANGES
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel
from sysid.design.initial import loop_structure as shape
from sysid.design.initial import prior
from sysid.design.initial.loop_structure import LoopStructure
from sysid.design.specification import DesignInfeasibleError

Array = NDArray[np.float64]

STEP = 1.04
"""Ratio of neighbouring gains on a locus."""
TURN_FACTORS = STEP ** np.arange(-72.0, 20.0)
"""Loop gains that are tried, as factors.

The factor is one where a pure turn-rate integrator crosses unit gain at half the bandwidth.
"""
DEPTH_FACTORS = STEP ** np.arange(-80.0, 1.0)
"""DPT_P relative to the largest permitted pitch per metre."""
PITCH_SHARES = (1.0, 0.85, 0.7)
"""Gains of the pitch loop inside the depth loop, over the largest ones of the pitch loop alone."""
PITCH_GAINS = ("PTCH_P", "PTCH_D", "PTCH_I")


class LocusPoint(NamedTuple):
    """One point on a root locus."""

    shape: LoopStructure
    gains: dict[str, float]
    violations: ConstraintViolation
    """Relative constraint violations."""


class SearchLimits(NamedTuple):
    """Limits and candidates of the search for the gains of a loop."""

    bounds: Bounds
    """Limits on the nominal vehicle."""
    vehicles: Sequence[DesignModel] = ()
    """Vehicles sampled from the prior."""
    fraction: float = prior.STABLE_FRACTION
    """Minimum fraction of them with the margins of `prior`."""
    zeros: Sequence[float] = shape.ZEROS
    """Candidate ratios of the tailcone's bandwidth to the zero."""


def heading(vehicle: DesignModel, limits: SearchLimits) -> LocusPoint:
    """Return the point of HDG_P, HDG_D and HDG_I. Raises DesignInfeasibleError."""
    bandwidth = shape.bandwidth_radps(vehicle.yaw_lag)
    loop_gains = 0.5 * bandwidth / abs(float(vehicle.planes.yaw.B[1])) * TURN_FACTORS
    structures = [shape.heading(bandwidth / ratio) for ratio in limits.zeros]
    return _select_max_gain(
        "HDG_P",
        [
            point
            for structure in structures
            for point in points(structure, vehicle, loop_gains, limits.bounds)
        ],
        limits,
    )


def depth(
    vehicle: DesignModel, limits: SearchLimits, steepest_rad: float, min_pitch_gain: float
) -> tuple[LocusPoint, LocusPoint]:
    """Return the points of the pitch loop and of the depth loop around it.

    The largest pitch gain can leave the depth loop without margins, so smaller ones are tried. The
    product of PTCH_P and DPT_P, the elevator per metre, is the largest.

    Parameters
    ----------
    vehicle : DesignModel
        Nominal vehicle.
    limits : SearchLimits
        Limits and robustness.
    steepest_rad : float
        Largest DPT_P, rad/m.
    min_pitch_gain : float
        Minimum PTCH_P of a pitch loop without integrator.

    Returns
    -------
    tuple of two LocusPoint
        Pitch and depth.

    Raises
    ------
    DesignInfeasibleError
        No gains meet the limits.
    """
    inner = _pitch(vehicle, limits, integral=False)
    if inner.gains["PTCH_P"] < min_pitch_gain:
        inner = _pitch(vehicle, limits, integral=True)
    pairs, problems = [], []
    for share in PITCH_SHARES:
        factor = share * inner.gains["PTCH_D"]  # PTCH_D is one at a factor of one
        (reduced,) = points(inner.shape, vehicle, np.array([factor]), limits.bounds)
        loop = shape.depth({name: reduced.gains[name] for name in PITCH_GAINS})
        outer = points(loop, vehicle, steepest_rad * DEPTH_FACTORS, limits.bounds)
        try:
            pairs.append((reduced, _select_max_gain("DPT_P", outer, limits)))
        except DesignInfeasibleError as error:
            problems.append(error)
    if not pairs:
        raise problems[0]
    return max(pairs, key=lambda pair: pair[0].gains["PTCH_P"] * pair[1].gains["DPT_P"])


def _pitch(vehicle: DesignModel, limits: SearchLimits, *, integral: bool) -> LocusPoint:
    """Return the point of the pitch loop alone. Raises DesignInfeasibleError."""
    bandwidth = shape.bandwidth_radps(vehicle.pitch_lag)
    loop_gains = 0.5 * bandwidth / abs(float(vehicle.planes.pitch.B[1])) * TURN_FACTORS
    structures = [shape.pitch(bandwidth / ratio, integral=integral) for ratio in limits.zeros]
    return _select_max_gain(
        "PTCH_P",
        [
            point
            for structure in structures
            for point in points(structure, vehicle, loop_gains, limits.bounds)
        ],
        limits,
    )


def points(
    loop: LoopStructure, vehicle: DesignModel, factors: Array, bounds: Bounds
) -> list[LocusPoint]:
    """Return the points along one locus."""
    dampings = root_locus.damping(root_locus.poles(loop.opened(vehicle), factors))
    return [
        _point(loop, vehicle, loop.at(float(factor)), float(damping), bounds)
        for factor, damping in zip(factors, dampings, strict=True)
    ]


def _point(
    loop: LoopStructure,
    vehicle: DesignModel,
    gains: dict[str, float],
    damping: float,
    bounds: Bounds,
) -> LocusPoint:
    """Return one point with its constraint violations."""
    cuts = loop.cuts(vehicle, gains)
    margins = {name: loop_transfer.margins(cut) for name, cut in cuts.items()}
    violations = {
        f"damping of the {loop.loop} loop": 1.0 - damping / bounds.damping,
        **constraints.margin_violations(margins, bounds),
    }
    return LocusPoint(loop, gains, violations)


def _select_max_gain(
    gain: str, candidates: Sequence[LocusPoint], limits: SearchLimits
) -> LocusPoint:
    """Return the feasible point with the largest `gain` that is robust over the prior."""
    feasible = [
        point
        for point in candidates
        if max(point.violations.values()) <= CONSTRAINT_TOLERANCE
        and all(value <= PARAMETER_RANGES[name][1] for name, value in point.gains.items())
    ]
    if not feasible:
        least_violations = min(
            (point.violations for point in candidates),
            key=lambda violations: max(violations.values()),
        )
        worst, violation = max(least_violations.items(), key=lambda item: item[1])
        if violation <= CONSTRAINT_TOLERANCE:
            raise DesignInfeasibleError(
                f"no gains meet the specification: {gain} would exceed"
                f" {PARAMETER_RANGES[gain][1]:g}, the largest value of the autopilot"
            )
        raise DesignInfeasibleError(
            f"no gains meet the specification: the best ones violate the {worst} by"
            f" {100 * violation:.1f} %"
        )
    for point in sorted(feasible, key=lambda point: -point.gains[gain]):
        if prior.is_robust(point.shape, point.gains, limits.vehicles, limits.fraction):
            return point
    raise DesignInfeasibleError(
        f"no gains of the {feasible[0].shape.loop} loop stabilise "
        f"{100 * limits.fraction:.0f} % of the vehicles "
        "sampled from the prior; measure the tailcone by `ground bench-test`"
    )
