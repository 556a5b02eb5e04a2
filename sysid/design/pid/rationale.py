"""Why each parameter is what it is, in a line each."""

from sysid.control_analysis.margins import Analysis, damping
from sysid.design.specification import Response, Spec
from sysid.models.model_file import IdentifiedModel


def explain(
    model: IdentifiedModel,
    gains: dict[str, float],
    judged: Analysis,
    before: Response,
    after: Response,
    spec: Spec,
) -> dict[str, str]:
    def cut(name: str) -> str:
        m = judged.margins[name]
        return f"GM {m.gm_db:.1f} dB, PM {m.pm_deg:.0f} deg, Ms {m.ms:.2f} at the {name}"

    bias, level = model.planes["yaw"].actuator_bias_deg.value, model.vehicle.level_pitch_deg
    done = (
        f"a constant load is gone but for {100 * spec.finish_left:.0f} % after {spec.finish_s:g} s"
    )
    texts = {
        "HDG_P": (
            f"heading {before.heading_deg:.2f} -> {after.heading_deg:.2f} deg rms predicted;"
            f" {cut('rudder')}"
        ),
        "HDG_D": f"damping {damping(judged.shown['heading']):.2f}",
        "HDG_I": done,
        "HDG_IMAX": (
            f"the rudder bias of {bias:.1f} deg, its uncertainty and 1 deg, should the trim be lost"
        ),
        "PTCH_P": (
            f"pitch {before.pitch_deg:.2f} -> {after.pitch_deg:.2f} deg rms predicted;"
            f" {cut('elevator')}"
        ),
        "PTCH_D": f"damping {damping(judged.shown['depth']):.2f}",
        "PTCH_I": "the depth integrator carries the constant load",
        "PTCH_IMAX": "no pitch integrator",
        "DPT_P": (
            f"depth {100 * before.depth_m:.1f} -> {100 * after.depth_m:.1f} cm rms predicted;"
            f" {cut('depth')}"
        ),
        "DPT_D": "lead for the depth loop from the estimated depth rate",
        "DPT_I": done,
        "DPT_IMAX": (
            f"the level-flight pitch of {level:.1f} deg and a fourth, and the elevator trim's"
            " uncertainty"
        ),
        "ACT_LAG_W": "the identified lag of the tailcone",
        "ACT_LAG_Z": "the identified lag of the tailcone",
        "ACT_LEAD_W": (
            f"the lag undone as far as {spec.command_noise_deg:g} deg of noise in the command allow"
        ),
        "ACT_RATE_DEGPS": "rate limit of the tailcone",
        "HDG_REF_W": (
            f"{spec.heading_step_deg:g} deg to a new heading within the travel that the bias leaves"
        ),
        "HDG_REF_RATE": "share of the rate of turn that the free travel holds",
        "DPT_REF_W": (
            f"{spec.depth_step_m:g} m to a new depth within {100 * spec.depth_overshoot:.0f} % of"
            " overshoot"
        ),
        "DPT_REF_RATE": "share of the speed",
        "PTCH_FF": "elevator that holds the pitch of a steady climb against the righting moment",
    }
    return {name: texts[name] for name in gains}
