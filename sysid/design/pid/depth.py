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
from sysid.planes import Plane

STARTS: Sequence[Mapping[str, float]] = (
    {"PTCH_P": 0.75, "PTCH_D": 2.0, "DPT_P": 0.22, "DPT_D": 0.4, "DPT_I": 0.007},
    {"PTCH_P": 0.65, "PTCH_D": 1.5, "DPT_P": 0.16, "DPT_D": 0.3, "DPT_I": 0.005},
)
"""Starting points of the search, suitable for Caribou."""


def gains(
    vehicle: DesignModel,
    reference: Gains,
    spec: Spec,
    bounds: Bounds,
    starts: Sequence[Mapping[str, float]] = STARTS,
) -> dict[str, float]:
    """Return PTCH_P, PTCH_D, DPT_P, DPT_D and DPT_I with the smallest depth rms within the limits.

    Parameters
    ----------
    vehicle : DesignModel
        Nominal model.
    reference : Gains
        Gains of the reference design and the actuator lead.
    spec : Spec
        Limits.
    bounds : Bounds
        Stability bounds, possibly stricter than those of `spec`.
    starts : Sequence of Mapping
        Starting points.

    Returns
    -------
    dict
        Gains by name.

    Raises
    ------
    DesignInfeasibleError
        No gains meet the limits.
    """
    initial_pitch, initial_depth, _ = depth_rms(vehicle, {**reference, "ACT_LEAD_W": 0.0})

    def evaluate(gains: Gains) -> CostAndConstraints:
        """Return relative depth rms and violations."""
        pitch, depth, _ = depth_rms(vehicle, gains)
        noise = math.degrees(command_noise_rad(vehicle, Plane.PITCH, gains))
        constraint_violations = {
            **violations(vehicle, gains, bounds, spec),
            "pitch activity": pitch / initial_pitch / spec.pitch_rms_ratio - 1.0,
            "pitch per metre of depth": math.degrees(gains["DPT_P"]) / spec.pitch_per_metre_deg
            - 1.0,
            "noise of the elevator's command": noise / spec.command_noise_deg - 1.0,
        }
        return CostAndConstraints(depth / initial_depth, constraint_violations)

    return constrained_search.solve(ConstrainedProblem(reference, starts, evaluate))


def violations(
    vehicle: DesignModel, gains: Gains, bounds: Bounds, finishing: Spec | None = None
) -> ConstraintViolation:
    """Return the violations of margins at both cuts and of damping in pitch and depth.

    With `finishing`, the residual depth error after an elevator offset is limited as well.
    """
    loops, plane = loop_transfer.depth_loops(vehicle.pitch, gains), vehicle.planes.pitch
    modes = modal.modes_of(loop_transfer.close_depth(plane, vehicle.pitch_lag, gains))
    return {
        **constraints.margin_violations(loops["elevator"], "elevator", bounds),
        **constraints.margin_violations(loops["depth"], "depth", bounds),
        **constraints.damping_violations(modes, "depth", bounds),
        **(constraints.load_violation(modes, plane.B, 3, "depth", finishing) if finishing else {}),
    }
