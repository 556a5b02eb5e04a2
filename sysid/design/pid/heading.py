"""Gains of the heading loop, the actuator lead, which both planes use, and peak filter."""

import math
from collections.abc import Mapping, Sequence

from sysid.control_analysis import loop_state_space, loop_transfer
from sysid.control_analysis.loop_transfer import ComplexArray, Gains
from sysid.design import constrained_search, constraints
from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints
from sysid.design.constraints import Bounds, ConstraintViolation, PlaneAnalysis
from sysid.design.design_model import DesignModel
from sysid.design.disturbance_response import command_noise_rad, heading_rms
from sysid.design.pid import peak_filter
from sysid.design.specification import Spec
from sysid.planes import Plane

STARTS: Sequence[Mapping[str, float]] = (
    {
        "HDG_P": 1.0,
        "HDG_D": 1.86,
        "HDG_I": 0.068,
        "ACT_LEAD_W": 6.3,
        "ACT_LEAD_Z": 0.17,
        "HDG_PEAK_W": 0.9,
        "HDG_PEAK_Z": 0.6,
        "HDG_PEAK_GAIN": 1.27,
    },
    {
        "HDG_P": 0.7,
        "HDG_D": 1.8,
        "HDG_I": 0.04,
        "ACT_LEAD_W": 6.0,
        "ACT_LEAD_Z": 0.7,
        "HDG_PEAK_W": 1.1,
        "HDG_PEAK_Z": 0.6,
        "HDG_PEAK_GAIN": 1.05,
    },
)
"""Starting points of the search, suitable for Caribou."""
MIN_LEAD_RATIO, MAX_LEAD_RATIO = 1.2, 6.0
"""Bounds of ACT_LEAD_W as multiples of the tailcone's own natural frequency."""
MIN_LEAD_DAMPING = 0.15
"""Minimum of ACT_LEAD_Z: with less, one step of the command makes the duct ring."""


def gains(
    vehicle: DesignModel,
    reference: Gains,
    spec: Spec,
    bounds: Bounds,
    starts: Sequence[Mapping[str, float]] = STARTS,
    sampled: Sequence[DesignModel] = (),
) -> dict[str, float]:
    """Return gains and peak filter with the smallest heading rms within the limits.

    Parameters
    ----------
    vehicle : DesignModel
        Nominal model.
    reference : Gains
        Gains of the reference design and the identified lag of the tailcone.
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
        HDG_P, HDG_D, HDG_I, ACT_LEAD_W, ACT_LEAD_Z and the HDG_PEAK_ parameters by name.

    Raises
    ------
    DesignInfeasibleError
        No gains meet the limits.

    Notes
    -----
    Below its natural frequency a weakly damped lead has less phase lag than a well damped one, and
    above it less gain for the gyro's noise. So the noise limit permits a faster loop.
    """
    reference_rms_rad = heading_rms(vehicle, {**reference, "ACT_LEAD_W": 0.0, "HDG_PEAK_W": 0.0})[0]

    def evaluate(gains: Gains) -> CostAndConstraints:
        """Return relative heading rms and violations."""
        noise = math.degrees(command_noise_rad(vehicle, Plane.YAW, gains))
        nominal = analyse(vehicle, gains)
        constraint_violations = {
            **constraints.violations(nominal, bounds),
            **constraints.load_violation(nominal.modes, vehicle.planes.yaw.B, 2, "heading", spec),
            **constraints.impulse_violation(nominal.modes, 2, "heading", spec),
            **constraints.worst_of_samples(
                constraints.violations(analyse(sample, gains), constraints.min_bounds(spec))
                for sample in sampled
            ),
            **peak_filter.violations(Plane.YAW, gains),
            **_lead_violations(gains),
            "noise of the rudder's command": noise / spec.command_noise_deg - 1.0,
        }
        return CostAndConstraints(
            heading_rms(vehicle, gains)[0] / reference_rms_rad, constraint_violations
        )

    return constrained_search.solve(ConstrainedProblem(reference, starts, evaluate))


def _lead_violations(gains: Gains) -> ConstraintViolation:
    """Return the violations of the bounds of the actuator lead."""
    lag_radps, lead_radps = gains["ACT_LAG_W"], gains["ACT_LEAD_W"]
    return {
        "lower bound of the actuator lead": MIN_LEAD_RATIO * lag_radps / lead_radps - 1.0,
        "upper bound of the actuator lead": lead_radps / (MAX_LEAD_RATIO * lag_radps) - 1.0,
        "damping of the actuator lead": MIN_LEAD_DAMPING / gains["ACT_LEAD_Z"] - 1.0,
    }


def open_loops(vehicle: DesignModel, gains: Gains) -> dict[str, ComplexArray]:
    """Return the loop opened at the rudder and at the heading error."""
    return loop_transfer.heading_loops(vehicle.yaw, gains)


def analyse(vehicle: DesignModel, gains: Gains) -> PlaneAnalysis:
    """Return the margins at both cuts, and the modes of the heading loop."""
    closed = loop_state_space.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, gains)
    return constraints.analyse(open_loops(vehicle, gains), closed, "heading")
