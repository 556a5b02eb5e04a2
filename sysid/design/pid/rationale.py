"""Reason for each designed parameter, one line per parameter."""

from sysid.control_analysis.margins import Analysis, damping
from sysid.design.pid import reference_models
from sysid.design.specification import Response, Spec
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane


def explain(
    model: IdentifiedModel,
    gains: dict[str, float],
    analysis: Analysis,
    initial: Response,
    predicted: Response,
    spec: Spec,
) -> dict[str, str]:
    """Return the reason for each parameter in `gains`, for the parameter file."""

    def cut(name: str) -> str:
        """Return the margins at one cut as text."""
        margins = analysis.margins[name]
        return (
            f"GM {margins.gm_db:.1f} dB, PM {margins.pm_deg:.0f} deg,"
            f" Ms {margins.max_sensitivity:.2f} at the"
            f" {name}"
        )

    rudder_bias_deg = model.planes[Plane.YAW].actuator_bias_deg.value
    level_pitch_deg = model.vehicle.level_pitch_deg
    integral_reason = (
        f"a constant load leaves {100 * spec.integral_residual:.0f} % of its largest error after"
        f" {spec.integral_settling_s:g} s"
    )
    texts = {
        "HDG_P": (
            f"heading {initial.heading_deg:.2f} -> {predicted.heading_deg:.2f} deg rms predicted;"
            f" {cut('rudder')}"
        ),
        "HDG_D": f"damping {damping(analysis.visible['heading']):.2f}",
        "HDG_I": integral_reason,
        "HDG_IMAX": (
            f"the rudder bias of {rudder_bias_deg:.1f} deg, its uncertainty and 1 deg, in case the"
            " trim is lost"
        ),
        "PTCH_P": (
            f"pitch {initial.pitch_deg:.2f} -> {predicted.pitch_deg:.2f} deg rms predicted;"
            f" {cut('elevator')}"
        ),
        "PTCH_D": f"damping {damping(analysis.visible['depth']):.2f}",
        "PTCH_I": "the depth integrator compensates the constant load",
        "PTCH_IMAX": "no pitch integrator",
        "DPT_P": (
            f"depth {100 * initial.depth_m:.1f} -> {100 * predicted.depth_m:.1f} cm rms predicted;"
            f" {cut('depth')}"
        ),
        "DPT_D": "lead for the depth loop from the estimated depth rate",
        "DPT_I": integral_reason,
        "DPT_IMAX": (
            f"the level-flight pitch of {level_pitch_deg:.1f} deg and a fourth, and the uncertainty"
            " of the elevator trim"
        ),
        "TRIM_PIT_DEG": "the identified pitch of level flight; the depth integrator does the rest",
        "ACT_LAG_W": "the identified lag of the tailcone",
        "ACT_LAG_Z": "the identified lag of the tailcone",
        "ACT_LEAD_W": (
            f"the lag compensated as far as {spec.command_noise_deg:g} deg of command noise allow"
        ),
        "ACT_LEAD_Z": "little phase lag below ACT_LEAD_W, little gain for gyro noise above it",
        **{
            f"{prefix}_PEAK_{name}": "more gain in the band of the waves within the same margins"
            for prefix in ("HDG", "PTCH")
            for name in ("W", "Z", "GAIN")
        },
        "ACT_RATE_DEGPS": "rate limit of the tailcone",
        "GAIN_SPD_MPS": "speed of the tests: at a higher one the loops keep their bandwidth",
        "HDG_REF_W": (
            f"a heading change of {spec.heading_step_deg:g} deg within the travel left by the bias"
        ),
        "DPT_REF_W": (
            f"depth changes of {spec.depth_step_m:g} and {2 * spec.depth_step_m:g} m within"
            f" {100 * spec.depth_overshoot * spec.depth_step_m:.0f} cm of overshoot settle soonest,"
            " simulated"
        ),
        "EST_DPT_TIME": "the depth rate follows the pressure, not the heave of the water in waves",
        **reference_models.REASONS,
    }
    return {name: texts[name] for name in gains}
