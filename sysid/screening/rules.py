"""Hard rules: what no estimate can make good, judged from the log alone and never by how well a
model explains it."""

import math

import numpy as np

from sysid.data import kinematics
from sysid.data.kinematics import AngleRateMismatch
from sysid.data.segments import Run
from sysid.screening import preroll
from sysid.screening.limits import ScreeningLimits
from sysid.screening.preroll import UsualPreroll


def gap(run: Run, limits: ScreeningLimits) -> str:
    longest = run.longest_gap_s
    return (
        f"gap: {longest:.2f} s without data, at most {limits.gap_s:g}"
        if longest > limits.gap_s
        else ""
    )


def clock(run: Run, limits: ScreeningLimits) -> str:
    if run.clock_back:
        return f"clock: {run.clock_back}"
    if abs(run.clock_drift_s) <= limits.clock_drift_s:
        return ""
    return (
        f"clock: the log's gained {run.clock_drift_s:+.2f} s on the vehicle's during the run, "
        f"at most {limits.clock_drift_s:g}"
    )


def too_short(run: Run, limits: ScreeningLimits) -> str:
    lasted = float(run.time_s[-1])
    if lasted >= limits.shortest_s:
        return ""
    return (
        f"aborted too soon: {lasted:.1f} s of at least {limits.shortest_s:g}"
        f" ({run.stop_reason or 'as planned'})"
    )


def saturation(run: Run, limits: ScreeningLimits) -> str:
    """The other surface at its stops has let go of its plane; the tested one at its stops was
    clipped by them."""
    other = run.elevator_rad if run.plane == "yaw" else run.rudder_rad
    wanted_deg = abs(math.degrees(run.trim_rad)) + abs(run.magnitude_deg)
    surfaces = [other] if wanted_deg >= limits.travel_deg else [other, run.command_rad]
    share = max(
        float(np.mean(np.abs(s) >= math.radians(limits.travel_deg) - 1e-4)) for s in surfaces
    )
    if share <= limits.saturated_share:
        return ""
    return (
        f"saturation: a surface at its stops in {share:.0%} of the run, at most"
        f" {limits.saturated_share:.0%}"
    )


def unsteady_start(run: Run, calm: UsualPreroll) -> str:
    """The last seconds before the test against what the sea does to the vehicle before all
    tests."""
    start = preroll.last_window(run)
    if start is None:
        return "unsteady start: less than 1 s of motion before the test"
    rate, allowed = (
        math.degrees(abs(start.rate_radps - calm.rate_radps)),
        math.degrees(calm.rate_allowed_radps),
    )
    if rate > allowed:
        return (
            f"unsteady start: mean rate {rate:.2f} deg/s before the test, at most {allowed:.2f} in"
            " this sea"
        )
    climb = abs(start.climb_mps)
    if climb > calm.climb_allowed_mps:
        return (
            f"unsteady start: depth changing at {climb:.2f} m/s, at most"
            f" {calm.climb_allowed_mps:.2f} in this sea"
        )
    return ""


def disturbance(run: Run, limits: ScreeningLimits, typical_radps: float) -> str:
    rough = preroll.roughness_radps(run)
    floor = math.radians(limits.rough_floor_degps)
    if rough <= max(limits.rough_factor * typical_radps, floor):
        return ""
    return (
        f"disturbance: rate {math.degrees(rough):.2f} deg/s rms before the test, "
        f"{math.degrees(typical_radps):.2f} in the plane's other runs"
    )


def thrust_change(run: Run, limits: ScreeningLimits) -> str:
    """Thrust, which sets the speed, is known; what speed itself did is asked of the fit
    (`sysid.screening.anomaly_models`)."""
    spread = float(np.ptp(run.thrust))
    if spread <= limits.thrust_step:
        return ""
    return (
        f"speed off: thrust changed by {100 * spread:.0f} % of full, at most"
        f" {100 * limits.thrust_step:.0f}"
    )


def attitude_rate_mismatch(run: Run, limits: ScreeningLimits) -> str:
    """Heading and pitch must be what the rates make of them."""
    heading = kinematics.heading_mismatch(run)
    wrong = _mismatch_reason(heading, "heading and yaw rate", limits) if heading else ""
    return wrong or _mismatch_reason(kinematics.pitch_mismatch(run), "pitch and pitch rate", limits)


def _mismatch_reason(found: AngleRateMismatch, what: str, limits: ScreeningLimits) -> str:
    rms, bias = math.degrees(found.rms_rad), math.degrees(found.bias_radps)
    allowed = max(limits.angle_rms_deg, limits.angle_share * math.degrees(found.excursion_rad))
    if rms > allowed:
        return f"kinematics: {what} disagree by {rms:.1f} deg rms, at most {allowed:.1f}"
    if abs(bias) > limits.rate_bias_degps:
        return (
            f"kinematics: {what} disagree by {bias:+.1f} deg/s, at most {limits.rate_bias_degps:g}"
        )
    return ""


def depth_pitch_mismatch(run: Run, limits: ScreeningLimits) -> str:
    """Depth must be what speed and pitch make of it."""
    found = kinematics.depth_mismatch(run)
    if found is None:
        return ""
    allowed = max(limits.depth_rms_m, limits.depth_share * found.excursion_m)
    if found.rms_m > allowed:
        return (
            f"kinematics: depth and pitch disagree by {found.rms_m:.2f} m rms, at most"
            f" {allowed:.2f}"
        )
    if found.speed_mps < 0.0 and found.excursion_m > limits.depth_rms_m:
        return "kinematics: depth grows where the nose is up, or pitch has the wrong sign"
    return ""
