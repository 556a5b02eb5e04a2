"""Which runs may be fitted, and why the others may not. Every rejection has a name; none rests on residual size."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid import kinematics
from sysid.kinematics import Disagreement
from sysid.runs import Array, Run


class Limits(NamedTuple):
    """What a run may show and still be fitted. The paper's own rules ("little pitch and depth response") in numbers."""

    gap_s: float = 0.2
    shortest_s: float = 3.0
    """Delay, lag and the start of the answer; shorter tests hold nothing else."""
    saturated_share: float = 0.05
    travel_deg: float = 15.0
    mean_rate_degps: float = 1.0
    start_depth_rate_mps: float = 0.15
    thrust_step: float = 0.03
    cross_pitch_deg: float = 8.0
    cross_depth_m: float = 1.0
    cross_heading_deg: float = 15.0
    roll_deg: float = 20.0
    rough_factor: float = 3.0
    """A pre-roll this much rougher than the median of its plane met something the others did not."""
    rough_floor_degps: float = 0.5
    clock_drift_s: float = 0.05
    angle_rms_deg: float = 1.0
    """Between an angle and its integrated rate; noise and the filter's lag leave a fraction of it."""
    angle_share: float = 0.05
    """Of the angle's excursion, which a filter's lag grows with."""
    rate_bias_degps: float = 1.0
    depth_rms_m: float = 0.5
    depth_share: float = 0.25
    """Of the depth's excursion: speed falls while the vehicle pitches, and she slips."""


class Screening(NamedTuple):
    run: Run
    kept: bool
    reasons: tuple[str, ...]
    """Each "name: figures"; empty for a kept run."""


def screen(runs: Sequence[Run], limits: Limits | None = None) -> list[Screening]:
    """Judge every run by what was commanded and how it began, never by how well a model explains it."""
    limits = limits or Limits()
    typical = {plane: _typical_roughness([r for r in runs if r.plane == plane]) for plane in ("yaw", "pitch")}
    screenings = []
    for run in runs:
        found = (
            _gap(run, limits),
            _clock(run, limits),
            _aborted(run, limits),
            _saturation(run, limits),
            _unsteady_start(run, limits),
            _speed_off(run, limits),
            _cross_plane(run, limits),
            _disturbance(run, limits, typical[run.plane]),
            _turning(run, limits),
            _sinking(run, limits),
        )
        reasons = tuple(reason for reason in found if reason)
        screenings.append(Screening(run, not reasons, reasons))
    return screenings


def _gap(run: Run, limits: Limits) -> str:
    gap = run.longest_gap_s
    return f"gap: {gap:.2f} s without data, at most {limits.gap_s:g}" if gap > limits.gap_s else ""


def _clock(run: Run, limits: Limits) -> str:
    if run.clock_back:
        return f"clock: {run.clock_back}"
    if abs(run.clock_drift_s) <= limits.clock_drift_s:
        return ""
    return (
        f"clock: the log's gained {run.clock_drift_s:+.2f} s on the vehicle's during the run, "
        f"at most {limits.clock_drift_s:g}"
    )


def _aborted(run: Run, limits: Limits) -> str:
    lasted = float(run.time_s[-1])
    if lasted >= limits.shortest_s:
        return ""
    return f"aborted too soon: {lasted:.1f} s of at least {limits.shortest_s:g} ({run.stop_reason or 'as planned'})"


def _saturation(run: Run, limits: Limits) -> str:
    """The other surface at its stops has let go of its plane; the tested one at its stops was clipped by them."""
    other = run.elevator_rad if run.plane == "yaw" else run.rudder_rad
    wanted_deg = abs(math.degrees(run.trim_rad)) + abs(run.magnitude_deg)
    surfaces = [other] if wanted_deg >= limits.travel_deg else [other, run.command_rad]
    share = max(float(np.mean(np.abs(s) >= math.radians(limits.travel_deg) - 1e-4)) for s in surfaces)
    if share <= limits.saturated_share:
        return ""
    return f"saturation: a surface at its stops in {share:.0%} of the run, at most {limits.saturated_share:.0%}"


def _unsteady_start(run: Run, limits: Limits) -> str:
    before = run.approach
    if np.count_nonzero(before) < 50:
        return "unsteady start: less than 1 s of motion before the test"
    rate = math.degrees(abs(float(np.mean(run.rate_radps[before]))))
    if rate > limits.mean_rate_degps:
        return f"unsteady start: mean rate {rate:.2f} deg/s before the test, at most {limits.mean_rate_degps:g}"
    climb = abs(float(np.polyfit(run.time_s[before], run.depth_m[before], 1)[0]))
    if climb > limits.start_depth_rate_mps:
        return f"unsteady start: depth changing at {climb:.2f} m/s, at most {limits.start_depth_rate_mps:g}"
    return ""


def _speed_off(run: Run, limits: Limits) -> str:
    """Speed is not measured under water without a Doppler log; thrust, which sets it, is known."""
    spread = float(np.ptp(run.thrust))
    if spread <= limits.thrust_step:
        return ""
    return f"speed off: thrust changed by {100 * spread:.0f} % of full, at most {100 * limits.thrust_step:.0f}"


def _cross_plane(run: Run, limits: Limits) -> str:
    roll = math.degrees(float(np.max(np.abs(run.roll_rad))))
    if roll > limits.roll_deg:
        return f"cross-plane coupling: roll reached {roll:.0f} deg, at most {limits.roll_deg:g}"
    if run.plane == "pitch":
        swing = math.degrees(_excursion(run, run.heading_rad))
        if swing > limits.cross_heading_deg:
            return f"cross-plane coupling: heading moved {swing:.1f} deg, at most {limits.cross_heading_deg:g}"
        return ""
    pitched, sunk = math.degrees(_excursion(run, run.pitch_rad)), _excursion(run, run.depth_m)
    if pitched > limits.cross_pitch_deg:
        return f"cross-plane coupling: pitch moved {pitched:.1f} deg, at most {limits.cross_pitch_deg:g}"
    if sunk > limits.cross_depth_m:
        return f"cross-plane coupling: depth moved {sunk:.2f} m, at most {limits.cross_depth_m:g}"
    return ""


def _excursion(run: Run, values: Array) -> float:
    """Largest departure from where the run began."""
    before = values[run.approach]
    return float(np.max(np.abs(values - (np.mean(before) if before.size else values[0]))))


def _disturbance(run: Run, limits: Limits, typical_radps: float) -> str:
    rough = _roughness(run)
    floor = math.radians(limits.rough_floor_degps)
    if rough <= max(limits.rough_factor * typical_radps, floor):
        return ""
    return (
        f"disturbance: rate {math.degrees(rough):.2f} deg/s rms before the test, "
        f"{math.degrees(typical_radps):.2f} in the plane's other runs"
    )


def _turning(run: Run, limits: Limits) -> str:
    """Heading and pitch must be what the rates make of them."""
    heading = kinematics.heading(run)
    wrong = _apart(heading, "heading and yaw rate", limits) if heading else ""
    return wrong or _apart(kinematics.pitch(run), "pitch and pitch rate", limits)


def _apart(found: Disagreement, what: str, limits: Limits) -> str:
    rms, bias = math.degrees(found.rms_rad), math.degrees(found.bias_radps)
    allowed = max(limits.angle_rms_deg, limits.angle_share * math.degrees(found.excursion_rad))
    if rms > allowed:
        return f"kinematics: {what} disagree by {rms:.1f} deg rms, at most {allowed:.1f}"
    if abs(bias) > limits.rate_bias_degps:
        return f"kinematics: {what} disagree by {bias:+.1f} deg/s, at most {limits.rate_bias_degps:g}"
    return ""


def _sinking(run: Run, limits: Limits) -> str:
    """Depth must be what speed and pitch make of it."""
    found = kinematics.sinking(run)
    if found is None:
        return ""
    allowed = max(limits.depth_rms_m, limits.depth_share * found.excursion_m)
    if found.rms_m > allowed:
        return f"kinematics: depth and pitch disagree by {found.rms_m:.2f} m rms, at most {allowed:.2f}"
    if found.speed_mps < 0.0 and found.excursion_m > limits.depth_rms_m:
        return "kinematics: depth grows where the nose is up, or pitch has the wrong sign"
    return ""


def _roughness(run: Run) -> float:
    return float(np.std(run.rate_radps[run.approach])) if run.approach.any() else 0.0


def _typical_roughness(runs: Sequence[Run]) -> float:
    return float(np.median([_roughness(run) for run in runs])) if runs else 0.0
