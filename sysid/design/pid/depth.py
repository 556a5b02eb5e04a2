"""Gains of the pitch and depth loops, and peak filter."""

import math
from collections.abc import Mapping, Sequence

from sysid.control_analysis import loop_state_space, loop_transfer
from sysid.control_analysis.loop_transfer import ComplexArray, Gains
from sysid.design import constrained_search, constraints
from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints
from sysid.design.constraints import Bounds, PlaneAnalysis
from sysid.design.design_model import DesignModel
from sysid.design.disturbance_response import command_noise_rad, depth_rms
from sysid.design.pid import peak_filter
from sysid.design.specification import Spec
from sysid.planes import Plane

STARTS: Sequence[Mapping[str, float]] = (
    {
        "PTCH_P": 0.95,
        "PTCH_D": 1.9,
        "DPT_P": 0.3,
        "DPT_D": 0.65,
        "DPT_I": 0.02,
        "PTCH_PEAK_W": 1.5,
        "PTCH_PEAK_Z": 0.5,
        "PTCH_PEAK_GAIN": 1.3,
    },
    {
        "PTCH_P": 0.65,
        "PTCH_D": 1.5,
        "DPT_P": 0.16,
        "DPT_D": 0.3,
        "DPT_I": 0.005,
        "PTCH_PEAK_W": 1.5,
        "PTCH_PEAK_Z": 0.5,
        "PTCH_PEAK_GAIN": 1.05,
    },
)
"""Starting points of the search, suitable for Caribou."""


def gains(
    vehicle: DesignModel,
    reference: Gains,
    spec: Spec,
    bounds: Bounds,
    starts: Sequence[Mapping[str, float]] = STARTS,
    sampled: Sequence[DesignModel] = (),
) -> dict[str, float]:
    """Return the gains with the smallest depth rms within the limits.

    Parameters
    ----------
    vehicle : DesignModel
        Nominal model.
    reference : Gains
        Gains of the reference design without peak filter, and the actuator lead.
    spec : Spec
        Limits.
    bounds : Bounds
        Stability bounds, possibly stricter than those of `spec`.
    starts : Sequence of Mapping
        Starting points.
    sampled : Sequence of DesignModel
        Sampled vehicles, each of which must meet the limits of sampled vehicles.

    Returns
    -------
    dict
        PTCH_P, PTCH_D, DPT_P, DPT_D, DPT_I and the PTCH_PEAK_ parameters.

    Raises
    ------
    DesignInfeasibleError
        No gains meet the limits.
    """
    initial_pitch, initial_depth, _ = depth_rms(
        vehicle, {**reference, "ACT_LEAD_W": 0.0, "PTCH_PEAK_W": 0.0}
    )

    def evaluate(gains: Gains) -> CostAndConstraints:
        """Return relative depth rms and violations."""
        pitch, depth, _ = depth_rms(vehicle, gains)
        noise = math.degrees(command_noise_rad(vehicle, Plane.PITCH, gains))
        nominal = analyse(vehicle, gains)
        constraint_violations = {
            **constraints.violations(nominal, bounds),
            **constraints.load_violation(nominal.modes, vehicle.planes.pitch.B, 3, "depth", spec),
            **constraints.worst_of_samples(
                constraints.violations(analyse(sample, gains), constraints.min_bounds(spec))
                for sample in sampled
            ),
            "pitch activity": pitch / initial_pitch / spec.pitch_rms_ratio - 1.0,
            "pitch per metre of depth": math.degrees(gains["DPT_P"]) / spec.pitch_per_metre_deg
            - 1.0,
            "noise of the elevator's command": noise / spec.command_noise_deg - 1.0,
        }
        constraint_violations |= peak_filter.violations(Plane.PITCH, gains)
        return CostAndConstraints(depth / initial_depth, constraint_violations)

    return constrained_search.solve(ConstrainedProblem(reference, starts, evaluate))


def open_loops(vehicle: DesignModel, gains: Gains) -> dict[str, ComplexArray]:
    """Return the loops opened at elevator and pitch command, and the pitch loop alone."""
    return loop_transfer.depth_loops(vehicle.pitch, gains)


def analyse(vehicle: DesignModel, gains: Gains) -> PlaneAnalysis:
    """Return the margins at the three cuts, and the modes of the depth loop."""
    closed = loop_state_space.close_depth(vehicle.planes.pitch, vehicle.pitch_lag, gains)
    return constraints.analyse(open_loops(vehicle, gains), closed, "depth")
