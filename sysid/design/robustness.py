"""Robustness of a design: the share of vehicles sampled from a model that meet the limits."""

import math
from collections import Counter
from collections.abc import Sequence

from sysid.control_analysis.loop_transfer import Gains
from sysid.design import constraints
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, ConstraintViolation, PlaneAnalysis, min_bounds
from sysid.design.design_model import DesignModel
from sysid.design.pid import depth, heading
from sysid.design.specification import DesignRobustness, Spec

RELAXED = Bounds(damping=0.5, gm_db=5.0, pm_deg=40.0, max_sensitivity=math.inf)
"""Relaxed bounds that are reported in addition to the specification's."""


def robustness(
    vehicles: Sequence[DesignModel], gains: Gains, spec: Spec
) -> DesignRobustness | None:
    """Return the shares of vehicles that meet the limits, or None without vehicles.

    Parameters
    ----------
    vehicles : Sequence of DesignModel
        Vehicles sampled from the model.
    gains : Gains
        Parameters of the loops by name.
    spec : Spec
        Specification.

    Returns
    -------
    DesignRobustness or None
        Shares for the specification and for `RELAXED`.
    """
    if not vehicles:
        return None
    analyses = [_analyse(vehicle, gains) for vehicle in vehicles]
    specified, relaxed = (
        [_violations(planes, bounds) for planes in analyses]
        for bounds in (min_bounds(spec), RELAXED)
    )
    return summarise(specified, relaxed)


def summarise(
    specified: Sequence[ConstraintViolation], relaxed: Sequence[ConstraintViolation]
) -> DesignRobustness:
    """Return the robustness from the constraint violations of each vehicle."""
    worst_counts = Counter(
        max(vehicle, key=lambda name: vehicle[name])
        for vehicle in specified
        if max(vehicle.values()) > CONSTRAINT_TOLERANCE
    )
    worst = worst_counts.most_common(1)[0][0] if worst_counts else ""
    return DesignRobustness(
        specification=_fraction(specified),
        relaxed=_fraction(relaxed),
        worst=worst,
        vehicles=len(specified),
    )


def violations(vehicle: DesignModel, gains: Gains, bounds: Bounds) -> ConstraintViolation:
    """Return the constraint violations of all loops on one vehicle.

    Parameters
    ----------
    vehicle : DesignModel
        Vehicle on which the loops are closed.
    gains : Gains
        Gains of all loops.
    bounds : Bounds
        Limits of damping and margins.

    Returns
    -------
    ConstraintViolation
        Violation of each limit, by name.
    """
    return _violations(_analyse(vehicle, gains), bounds)


def _analyse(vehicle: DesignModel, gains: Gains) -> tuple[PlaneAnalysis, PlaneAnalysis]:
    """Return the analysis of both planes."""
    return heading.analyse(vehicle, gains), depth.analyse(vehicle, gains)


def _violations(planes: tuple[PlaneAnalysis, PlaneAnalysis], bounds: Bounds) -> ConstraintViolation:
    """Return the constraint violations of both planes."""
    yaw, pitch = planes
    return {**constraints.violations(yaw, bounds), **constraints.violations(pitch, bounds)}


def _fraction(vehicles: Sequence[ConstraintViolation]) -> float:
    """Return the share of vehicles without a violation."""
    return sum(max(violations.values()) <= CONSTRAINT_TOLERANCE for violations in vehicles) / len(
        vehicles
    )
