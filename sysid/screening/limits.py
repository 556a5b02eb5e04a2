"""Limits of the screening rules."""

from typing import NamedTuple


class ScreeningLimits(NamedTuple):
    """Limits for a run that may be fitted.

    Most of them are the lower bound of a limit that is computed from the other runs. The paper
    states the rules in words ("little pitch and depth response").
    """

    gap_s: float = 0.2
    """Largest gap between samples of attitude or commands, s."""
    depth_gap_s: float = 0.5
    """Largest gap between samples of depth, s: depth is an integral and changes slowly."""
    shortest_s: float = 3.0
    """Minimum duration of a test, s.

    A shorter test holds only delay, actuator lag and the start of the response.
    """
    saturated_share: float = 0.05
    """Largest share of a run with a surface at its stops."""
    travel_deg: float | None = None
    """Travel of a surface to either side, deg; None for that of the run."""
    start_sds: float = 3.0
    """Largest distance of the mean motion before a test from the median of the other runs.

    Unit: standard deviations of such means.
    """
    mean_rate_degps: float = 1.0
    """Limit of the mean rate before a test if there are too few other runs, deg/s."""
    start_depth_rate_mps: float = 0.15
    """Limit of the mean depth rate before a test if there are too few other runs, m/s."""
    rate_floor_degps: float = 0.4
    """Mean rate before a test that is always accepted, deg/s: it does not disturb the fit."""
    depth_rate_floor_mps: float = 0.05
    """Mean depth rate before a test that is always accepted, m/s."""
    thrust_step: float = 0.03
    """Largest change of thrust during a run, fraction of full thrust."""
    cross_pitch_deg: float = 3.0
    """Pitch excursion during a rudder test that is always accepted, deg."""
    cross_depth_m: float = 0.5
    """Depth excursion during a rudder test that is always accepted, m."""
    cross_heading_deg: float = 5.0
    """Heading excursion during an elevator test that is always accepted, deg."""
    cross_coherence: float = 0.3
    """Coherence of the other plane's rate with the tested surface that is always accepted, 0 to 1.
    """
    cross_share: float = 0.2
    """Coherent rate of the other plane that is always accepted, over the rate of the tested plane.
    """
    roll_deg: float = 20.0
    """Largest roll during a run, deg."""
    rough_factor: float = 3.0
    """Largest rate standard deviation before a test, in units of the median over the plane's runs.
    """
    rough_floor_degps: float = 0.5
    """Rate standard deviation before a test that is always accepted, deg/s."""
    clock_drift_s: float = 0.05
    """Largest drift between log time and vehicle time during a run, s."""
    angle_rms_deg: float = 1.0
    """Difference of an angle and its integrated rate that is always accepted, deg rms.

    Noise and filter lag cause a fraction of it.
    """
    angle_share: float = 0.05
    """Accepted difference over the excursion of the angle, because filter lag grows with it."""
    rate_bias_degps: float = 1.0
    """Largest mean difference of a rate and the derivative of its angle, deg/s."""
    depth_rms_m: float = 0.5
    """Accepted difference of depth and the depth computed from speed and pitch, m rms."""
    depth_share: float = 0.25
    """Accepted difference over the depth excursion.

    Speed falls and heave arises in a pitch manoeuvre.
    """
