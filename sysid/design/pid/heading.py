"""Gains of the heading loop, and how far the tailcone's lag is undone."""

import math
from collections.abc import Mapping, Sequence

from sysid.control_analysis import loop_transfer, modal
from sysid.control_analysis.loop_transfer import Gains
from sysid.design import constrained_search, constraints
from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel, command_noise_rad, heading_rms
from sysid.design.specification import Spec

STARTS: Sequence[Mapping[str, float]] = (
    {"HDG_P": 0.7, "HDG_D": 1.8, "HDG_I": 0.04, "ACT_LEAD_W": 6.0},
)
"""Gains of Caribou's order."""
MIN_LEAD_RATIO, MAX_LEAD_RATIO = 1.2, 6.0
"""Natural frequency that the tailcone is to seem to have, as multiples of its own."""


def gains(
    vehicle: DesignModel,
    first: Gains,
    spec: Spec,
    bounds: Bounds,
    starts: Sequence[Mapping[str, float]] = STARTS,
) -> dict[str, float]:
    """HDG_P, HDG_D, HDG_I, and ACT_LEAD_W where the starts have it. Raises DesignRefused."""
    reference = heading_rms(vehicle, {**first, "ACT_LEAD_W": 0.0})[0]

    def judge(gains: Gains) -> CostAndConstraints:
        noise = math.degrees(command_noise_rad(vehicle, "yaw", gains))
        misses = {
            **violations(vehicle, gains, bounds, spec),
            "noise of the rudder's command": noise / spec.command_noise_deg - 1.0,
        }
        if lead := gains.get("ACT_LEAD_W", 0.0):
            own = gains["ACT_LAG_W"]
            misses["slowness of the tailcone's lead"] = MIN_LEAD_RATIO * own / lead - 1.0
            misses["speed of the tailcone's lead"] = lead / (MAX_LEAD_RATIO * own) - 1.0
        return CostAndConstraints(heading_rms(vehicle, gains)[0] / reference, misses)

    return constrained_search.solve(ConstrainedProblem(first, starts, judge))


def violations(
    vehicle: DesignModel, gains: Gains, bounds: Bounds, finishing: Spec | None = None
) -> ConstraintViolation:
    """Margins at both cuts, damping, and where ``finishing`` asks for it that a rudder offset's
    error goes in time."""
    cuts, plane = loop_transfer.heading_loops(vehicle.yaw, gains), vehicle.planes.yaw
    own = modal.modes_of(loop_transfer.close_heading(plane, vehicle.yaw_lag, gains))
    return {
        **constraints.margin_violations(cuts["rudder"], "rudder", bounds),
        **constraints.margin_violations(cuts["heading"], "heading", bounds),
        **constraints.damping_violations(own, "heading", bounds),
        **(constraints.load_violation(own, plane.B, 2, "heading", finishing) if finishing else {}),
    }
