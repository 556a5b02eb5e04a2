"""Gains of the pitch and depth loops."""

import math
from collections.abc import Mapping, Sequence

from sysid.control_analysis import loop_transfer, modal
from sysid.control_analysis.loop_transfer import Gains
from sysid.design import constrained_search, constraints
from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel, command_noise_rad, depth_rms
from sysid.design.specification import Spec

STARTS: Sequence[Mapping[str, float]] = (
    {"PTCH_P": 0.75, "PTCH_D": 2.0, "DPT_P": 0.22, "DPT_D": 0.4, "DPT_I": 0.007},
    {"PTCH_P": 0.65, "PTCH_D": 1.5, "DPT_P": 0.16, "DPT_D": 0.3, "DPT_I": 0.005},
)
"""Gains of Caribou's order."""


def gains(
    vehicle: DesignModel,
    first: Gains,
    spec: Spec,
    bounds: Bounds,
    starts: Sequence[Mapping[str, float]] = STARTS,
) -> dict[str, float]:
    """PTCH_P, PTCH_D, DPT_P, DPT_D and DPT_I; ``first`` holds the tailcone's lead. Raises
    DesignRefused."""
    pitch_0, depth_0, _ = depth_rms(vehicle, {**first, "ACT_LEAD_W": 0.0})

    def judge(gains: Gains) -> CostAndConstraints:
        pitch, depth, _ = depth_rms(vehicle, gains)
        noise = math.degrees(command_noise_rad(vehicle, "pitch", gains))
        misses = {
            **violations(vehicle, gains, bounds, spec),
            "pitch activity": pitch / pitch_0 / spec.pitch_rms_growth - 1.0,
            "pitch asked by a metre": math.degrees(gains["DPT_P"]) / spec.pitch_per_metre_deg - 1.0,
            "noise of the elevator's command": noise / spec.command_noise_deg - 1.0,
        }
        return CostAndConstraints(depth / depth_0, misses)

    return constrained_search.solve(ConstrainedProblem(first, starts, judge))


def violations(
    vehicle: DesignModel, gains: Gains, bounds: Bounds, finishing: Spec | None = None
) -> ConstraintViolation:
    """Margins at both cuts, damping in pitch and depth, and where ``finishing`` asks for it that
    the error in depth of an elevator offset goes in time."""
    cuts, plane = loop_transfer.depth_loops(vehicle.pitch, gains), vehicle.planes.pitch
    own = modal.modes_of(loop_transfer.close_depth(plane, vehicle.pitch_lag, gains))
    return {
        **constraints.margin_violations(cuts["elevator"], "elevator", bounds),
        **constraints.margin_violations(cuts["depth"], "depth", bounds),
        **constraints.damping_violations(own, "depth", bounds),
        **(constraints.load_violation(own, plane.B, 3, "depth", finishing) if finishing else {}),
    }
