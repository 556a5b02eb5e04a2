"""What a run may show and still be fitted."""

from typing import NamedTuple


class ScreeningLimits(NamedTuple):
    """The paper's own rules ("little pitch and depth response") in numbers; most are the floor of a
    statistic."""

    gap_s: float = 0.2
    shortest_s: float = 3.0
    """Delay, lag and the start of the answer; shorter tests hold nothing else."""
    saturated_share: float = 0.05
    travel_deg: float = 15.0
    start_sds: float = 3.0
    """How far the mean motion before a test may lie from the others', in what the sea makes of such
    means."""
    mean_rate_degps: float = 1.0
    start_depth_rate_mps: float = 0.15
    """Both for want of other runs to tell the sea from."""
    rate_floor_degps: float = 0.4
    depth_rate_floor_mps: float = 0.05
    """Motion that no fit minds, however calm the sea."""
    thrust_step: float = 0.03
    cross_pitch_deg: float = 3.0
    cross_depth_m: float = 0.5
    cross_heading_deg: float = 5.0
    """Excursions of the other plane that its sea must explain; smaller ones leave the tested plane
    as it is."""
    cross_coherence: float = 0.3
    cross_share: float = 0.2
    """Of the tested plane's own rate: coherent motion of the other that is too little to matter."""
    roll_deg: float = 20.0
    rough_factor: float = 3.0
    """A pre-roll this much rougher than the median of its plane met something the others did
    not."""
    rough_floor_degps: float = 0.5
    clock_drift_s: float = 0.05
    angle_rms_deg: float = 1.0
    """Between an angle and its integrated rate; noise and the filter's lag leave a fraction of
    it."""
    angle_share: float = 0.05
    """Of the angle's excursion, which a filter's lag grows with."""
    rate_bias_degps: float = 1.0
    depth_rms_m: float = 0.5
    depth_share: float = 0.25
    """Of the depth's excursion: speed falls while the vehicle pitches, and she slips."""
