"""Screening rules for defects that no estimator can correct. They use the log alone, no model."""

import math

import numpy as np

from sysid.data import kinematics
from sysid.data.kinematics import AngleRateMismatch
from sysid.data.runs import Run
from sysid.planes import PLANES
from sysid.screening import preroll
from sysid.screening.preroll import STOP_TOLERANCE_RAD, UsualPreroll

MAX_SAMPLE_GAP_S, MAX_DEPTH_GAP_S = 0.2, 0.5
"""Largest gap between samples of attitude or commands, and of depth, s.

Depth is an integral and changes slowly.
"""
MIN_TEST_S = 3.0
"""Minimum duration of a test, s.

A shorter test holds only delay, actuator lag and the start of the response.
"""
MAX_SATURATED_SHARE = 0.05
"""Largest share of a run with a surface at its stops."""
MAX_THRUST_CHANGE = 0.03
"""Largest change of thrust during a run, fraction of full thrust."""
MAX_ROUGHNESS_RATIO = 3.0
"""Largest rate standard deviation before a test, in units of the median over the plane's runs."""
ROUGHNESS_FLOOR_DEGPS = 0.5
"""Rate standard deviation before a test that is always accepted, deg/s."""
MAX_CLOCK_DRIFT_S = 0.05
"""Largest drift between log time and vehicle time during a run, s."""
ANGLE_RMS_FLOOR_DEG = 1.0
"""Difference of an angle and its integrated rate that is always accepted, deg rms.

Noise and filter lag cause a fraction of it.
"""
MAX_ANGLE_SHARE = 0.05
"""Accepted difference over the excursion of the angle, because filter lag grows with it."""
MAX_RATE_BIAS_DEGPS = 1.0
"""Largest mean difference of a rate and the derivative of its angle, deg/s."""
DEPTH_RMS_FLOOR_M = 0.5
"""Accepted difference of depth and the depth computed from speed and pitch, m rms."""
MAX_DEPTH_SHARE = 0.25
"""Accepted difference over the depth excursion.

Speed falls and heave arises in a pitch manoeuvre.
"""
MIN_DEPTH_RATIO = 0.1
"""Smallest change of depth over the one that pitch gives at the vehicle's speed, both rms.

Tests of simulated vehicles of 1.2 and 6 m have 0.93 to 1.0. The speed of another vehicle's file is
not wrong by this factor, and the lag of heave behind pitch, a hull length over the speed, gives it
only for pitch that oscillates at ten times the inverse of that time.
"""
RATIO_TOLERANCE = 0.2
"""Relative tolerance of the ratios of `MISMATCH_CAUSES`."""
MAX_SPEED_MPS = 60.0
"""Speed that no vehicle exceeds; one from a depth in mm is 1000 times too high."""
MAX_SPEED_RATIO = 2.0
"""Largest speed by depth and pitch over the measured one; with a depth in feet it is 3.3."""
MISMATCH_CAUSES = {
    -1.0: "one of them has the wrong sign",
    math.degrees(1.0): "one of them is in the wrong unit (the angle changes 57 times as much): name"
    " a CSV column of an angle in degrees _deg, that of a rate in rad/s _radps",
    math.radians(1.0): "one of them is in the wrong unit (the rate changes 57 times as much): name"
    " a CSV column of a rate in deg/s _degps, that of an angle in rad _rad",
}
"""Cause of a mismatch by the change of the angle over that of the integrated rate."""
STAMP_RESOLUTION_S = 2e-3
"""Rounding of two time stamps to whole milliseconds."""


def gap(run: Run) -> str:
    """Reject a run with a long gap between samples.

    However time stamps are rounded, rows at 5 Hz are too slow and depths at 2 Hz are not.
    """
    if run.longest_gap_s > MAX_SAMPLE_GAP_S - STAMP_RESOLUTION_S:
        return f"gap: {run.longest_gap_s:.2f} s without data, less than {MAX_SAMPLE_GAP_S:g} needed"
    if run.longest_depth_gap_s > MAX_DEPTH_GAP_S + STAMP_RESOLUTION_S:
        return f"gap: {run.longest_depth_gap_s:.2f} s without depth, at most {MAX_DEPTH_GAP_S:g}"
    return ""


def clock(run: Run) -> str:
    """Reject a run whose clock jumps back or drifts against vehicle time."""
    if run.clock_back:
        return f"clock: {run.clock_back}"
    if abs(run.clock_drift_s) <= MAX_CLOCK_DRIFT_S:
        return ""
    return (
        f"clock: the log's gained {run.clock_drift_s:+.2f} s on the vehicle's during the run, "
        f"at most {MAX_CLOCK_DRIFT_S:g}"
    )


def no_depth(run: Run) -> str:
    """Reject a test of the elevator in a log without depth, which is zero throughout."""
    if not PLANES[run.plane].has_depth or np.any(run.depth_m):
        return ""
    return f"no depth: the log holds none, and a test of the {PLANES[run.plane].surface} needs it"


def too_short(run: Run) -> str:
    """Reject a test that ended too soon."""
    lasted = float(run.time_s[-1])
    if lasted >= MIN_TEST_S:
        return ""
    shown_s = math.floor(100.0 * lasted) / 100.0  # rounded, it may read as the limit
    return (
        f"aborted too soon: {shown_s:g} s of at least {MIN_TEST_S:g}"
        f" ({run.stop_detail or 'as planned'})"
    )


def saturation(run: Run) -> str:
    """Reject a run with a surface at its stops for too long.

    A surface at its stops cannot control the other plane. In the tested plane the stops clip the
    command, which matters only if the command was meant to stay within the travel.
    """
    travel_rad = run.travel_rad
    other_surface_rad = run.in_plane(PLANES[run.plane].other).command_rad
    intended_rad = abs(run.trim_rad) + abs(math.radians(run.magnitude_deg))
    surfaces = (
        [other_surface_rad] if intended_rad >= travel_rad else [other_surface_rad, run.command_rad]
    )
    share = max(
        float(np.mean(np.abs(surface) >= travel_rad - STOP_TOLERANCE_RAD)) for surface in surfaces
    )
    if share <= MAX_SATURATED_SHARE:
        return ""
    return (
        f"saturation: a surface at its stops ({math.degrees(travel_rad):.3g} deg) in {share:.0%} of"
        f" the run, at most {MAX_SATURATED_SHARE:.0%}"
    )


def unsteady_start(run: Run, usual: UsualPreroll) -> str:
    """Reject a run before which the vehicle was not held, or moved more than usually before tests.

    The usual motion is that before the other tests.
    """
    window = preroll.last_window(run)
    if window is None:
        return "unsteady start: less than 1 s of motion before the test"
    if preroll.is_at_stops(run):
        surface = PLANES[run.plane].surface
        return (
            f"unsteady start: the {surface} was at its stops ({math.degrees(run.travel_rad):.3g}"
            " deg) before the test; lower the gains that hold the vehicle between tests, or fly in"
            " a calmer sea"
        )
    rate_degps = math.degrees(abs(window.rate_radps - usual.rate_radps))
    allowed_degps = math.degrees(usual.rate_allowed_radps)
    if rate_degps > allowed_degps:
        return (
            f"unsteady start: mean rate {rate_degps:.2f} deg/s before the test, at most"
            f" {allowed_degps:.2f} in this sea"
        )
    depth_rate_mps = abs(window.depth_rate_mps)
    if depth_rate_mps > usual.depth_rate_allowed_mps:
        return (
            f"unsteady start: depth changing at {depth_rate_mps:.3g} m/s, at most"
            f" {usual.depth_rate_allowed_mps:.3g} in this sea"
        )
    return ""


def disturbance(run: Run, typical_radps: float) -> str:
    """Reject a run whose rate before the test is much rougher than in the plane's other runs."""
    roughness = preroll.roughness_radps(run)
    floor_radps = math.radians(ROUGHNESS_FLOOR_DEGPS)
    if roughness <= max(MAX_ROUGHNESS_RATIO * typical_radps, floor_radps):
        return ""
    return (
        f"disturbance: rate {math.degrees(roughness):.2f} deg/s rms before the test, "
        f"{math.degrees(typical_radps):.2f} in the plane's other runs"
    )


def thrust_change(run: Run) -> str:
    """Reject a run with a change of thrust, which sets the speed.

    Thrust is logged; a change of speed at constant thrust is tested by the fit
    (`sysid.screening.anomaly_models`).
    """
    spread = float(np.ptp(run.thrust))
    if spread <= MAX_THRUST_CHANGE:
        return ""
    return (
        f"speed off: thrust changed by {100 * spread:.0f} % of full, at most"
        f" {100 * MAX_THRUST_CHANGE:.0f}"
    )


def attitude_rate_mismatch(run: Run) -> str:
    """Reject a run whose heading or pitch is not the integral of the measured rate."""
    heading_error = kinematics.heading_mismatch(run)
    reason = _mismatch_reason(heading_error, "heading and yaw rate") if heading_error else ""
    return reason or _mismatch_reason(kinematics.pitch_mismatch(run), "pitch and pitch rate")


def _mismatch_reason(mismatch: AngleRateMismatch, description: str) -> str:
    """Return the reason if an angle and its rate disagree by more than the limits."""
    rms, bias = math.degrees(mismatch.rms_rad), math.degrees(mismatch.bias_radps)
    allowed = max(ANGLE_RMS_FLOOR_DEG, MAX_ANGLE_SHARE * math.degrees(mismatch.excursion_rad))
    if rms > allowed:
        return (
            f"kinematics: {description} disagree by {rms:.1f} deg rms, at most {allowed:.1f}"
            f"{_mismatch_cause(mismatch)}"
        )
    if abs(bias) > MAX_RATE_BIAS_DEGPS:
        return (
            f"kinematics: {description} disagree by {bias:+.1f} deg/s,"
            f" at most {MAX_RATE_BIAS_DEGPS:g}"
        )
    return ""


def _mismatch_cause(mismatch: AngleRateMismatch) -> str:
    """Return why an angle and its rate disagree, if their ratio shows it."""
    if mismatch.excursion_rad == 0.0:
        return "; the angle does not change"
    for ratio, cause in MISMATCH_CAUSES.items():
        if abs(mismatch.ratio / ratio - 1.0) < RATIO_TOLERANCE:
            return f"; {cause}"
    return ""


def depth_pitch_mismatch(run: Run) -> str:
    """Reject a run whose depth is not what speed and pitch give."""
    mismatch = kinematics.depth_mismatch(run)
    if mismatch is None:
        return ""
    allowed = max(DEPTH_RMS_FLOOR_M, MAX_DEPTH_SHARE * mismatch.excursion_m)
    if mismatch.rms_m > allowed:
        return (
            f"kinematics: depth and pitch disagree by {mismatch.rms_m:.2f} m rms, at most"
            f" {allowed:.2f}{_speed_cause(mismatch.speed_mps, run)}"
        )
    if cause := _speed_cause(mismatch.speed_mps, run):
        return f"kinematics: depth and pitch disagree{cause}"
    if mismatch.speed_mps < 0.0 and mismatch.excursion_m > DEPTH_RMS_FLOOR_M:
        return "kinematics: depth grows where the nose is up, or pitch has the wrong sign"
    return ""


def depth_without_pitch(run: Run, full_speed_mps: float) -> str:
    """Reject a test of the elevator whose depth does not change where the pitch says it must.

    Parameters
    ----------
    run : Run
        A test.
    full_speed_mps : float
        Speed of the vehicle with full thrust, to which the speed is proportional; NaN if it is not
        known. A speed that was measured is preferred.

    Returns
    -------
    str
        Reason; empty if the depth changes, or if the change would be too small to decide.
    """
    mismatch = kinematics.depth_mismatch(run)
    if mismatch is None or not PLANES[run.plane].has_depth or not np.any(run.depth_m):
        return ""
    speed_mps, source = run.straight_speed_mps, "as measured"
    if math.isnan(speed_mps):
        speed_mps, source = full_speed_mps * float(np.mean(run.thrust)), "by its file"
    is_decisive = speed_mps * mismatch.sine_range_s > DEPTH_RMS_FLOOR_M  # nan: not known
    ratio_limit_m = MIN_DEPTH_RATIO * speed_mps * mismatch.sine_rms_s
    if not is_decisive or mismatch.depth_rms_m >= ratio_limit_m:
        return ""
    return (
        f"kinematics: depth does not follow pitch: they give {abs(mismatch.speed_mps):.2f} m/s, and"
        f" the vehicle has {speed_mps:.2f} m/s {source}; log the depth by the pressure of the water"
    )


def _speed_cause(speed_mps: float, run: Run) -> str:
    """Return the cause if depth and pitch give a speed that no vehicle has, or that it had not."""
    measured = ""
    if abs(speed_mps) > MAX_SPEED_RATIO * run.straight_speed_mps:  # nan: it is not measured
        measured = f" where {run.straight_speed_mps:.1f} are measured"
    elif abs(speed_mps) <= MAX_SPEED_MPS:
        return ""
    return (
        f"; they give {abs(speed_mps):.1f} m/s{measured}: the depth is in the wrong unit, give"
        " metres"
    )
