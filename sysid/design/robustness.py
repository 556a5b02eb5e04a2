"""Robustness of a design: the share of vehicles sampled from a model that meet the limits."""

import math
from collections import Counter
from collections.abc import Sequence

from sysid.control_analysis.loop_transfer import Gains
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, ConstraintViolation, min_bounds
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
    specified = [violations(vehicle, gains, min_bounds(spec)) for vehicle in vehicles]
    relaxed = [violations(vehicle, gains, RELAXED) for vehicle in vehicles]
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


def min_gain_margin_db(violations: ConstraintViolation, bounds: Bounds) -> float:
    """Return the smallest gain margin of all cuts (dB).

    Parameters
    ----------
    violations : ConstraintViolation
        Violations of one vehicle, 1 - GM / GM_min at each cut.
    bounds : Bounds
        Limits that are violated.

    Returns
    -------
    float
        Gain margin.
    """
    shares = [value for name, value in violations.items() if name.startswith("gain margin")]
    return bounds.gm_db * (1.0 - max(shares))


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
    return {
        **heading.violations(vehicle, gains, bounds),
        **depth.violations(vehicle, gains, bounds),
    }


def _fraction(vehicles: Sequence[ConstraintViolation]) -> float:
    """Return the share of vehicles without a violation."""
    return sum(max(violations.values()) <= CONSTRAINT_TOLERANCE for violations in vehicles) / len(
        vehicles
    )
