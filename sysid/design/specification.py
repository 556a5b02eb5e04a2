"""Specification of a design, and the result of a design."""

from pathlib import Path
from typing import NamedTuple

from mavlink_io.errors import ErrorCode, OperationError
from mavlink_io.user_data_dir import write_output
from sysid.control_analysis.margins import Analysis
from sysid.models.json_record import JsonRecord
from sysid.monitor.performance_spec import PerformanceBaseline, encode

OPERATING_DEPTH_M = 3.0
"""Default of ``Spec.operating_depth_m``."""


RELAXED_LIMITS: tuple[dict[str, float], ...] = (
    {
        "damping": 0.5,
        "gm_db": 7.0,
        "pm_deg": 45.0,
        "max_sensitivity": 1.9,
        "robust_gm_db": 5.0,
        "robust_pm_deg": 37.0,
    },
    {
        "damping": 0.4,
        "gm_db": 6.0,
        "pm_deg": 38.0,
        "max_sensitivity": 2.2,
        "robust_gm_db": 4.0,
        "robust_pm_deg": 30.0,
    },
)
"""Limits that are tried in this order after those of the specification.

They are used where no gains meet the stricter ones, or where those that do hold heading or depth
worse than the first gains. An unstable hull or a slow tailcone bounds the margins that any gains
reach."""


class DesignInfeasibleError(OperationError):
    """No gains meet the specification on this model; the message names the worst limit."""

    code = ErrorCode.DESIGN_INFEASIBLE


class Spec(JsonRecord, frozen=True):
    """Limits of a design; every field can be set by the user."""

    damping: float = 0.6
    """Minimum damping ratio of every pole pair that is visible in the motion."""
    gm_db: float = 8.0
    """Minimum gain margin of the nominal model (dB)."""
    pm_deg: float = 55.0
    """Minimum phase margin of the nominal model (deg)."""
    max_sensitivity: float = 1.6
    """Maximum sensitivity of the nominal model.

    Margins and sensitivity apply at every cut for which they are reported: rudder, heading error,
    elevator, depth error and, with PID, pitch error.
    """
    robust_gm_db: float = 6.0
    """Minimum gain margin of the sampled vehicles at the same cuts (dB)."""
    robust_pm_deg: float = 45.0
    """Minimum phase margin of the sampled vehicles (deg); `damping` applies to them as well."""
    robust_fraction: float = 0.5
    """Minimum share of sampled vehicles that meet these limits; below it a design is infeasible."""
    integral_settling_s: float = 30.0
    """Time (s) after which a constant load must be compensated."""
    integral_residual: float = 0.15
    """Maximum residual error after `integral_settling_s`, as a share of its largest value."""
    impulse_overshoot: float = 0.2
    """Maximum overshoot of the heading after an impulsive moment, as a share of its maximum."""
    heading_step_deg: float = 20.0
    """Change of heading (deg) in which the rudder must stay within the travel left by its bias."""
    travel_deg: float = 15.0
    """Travel of the tailcone to either side (deg)."""
    rate_degps: float = 15.0
    """Rate limit of the tailcone (deg/s)."""
    depth_step_m: float = 3.0
    """Change of depth (m) for which the overshoot is limited."""
    depth_overshoot: float = 0.04
    """Maximum overshoot of changes by one and by two `depth_step_m`, as a share of it."""
    operating_depth_m: float = OPERATING_DEPTH_M
    """Depth (m) for which waves are predicted, if the tests show their pressure."""
    assumed_wave_depth_m: float = 0.0
    """Least pressure of waves at `operating_depth_m` that the depth loop is designed for.

    It is the rms of the measured depth (m), as `NoiseModel.wave_depth_m`, for a mission in swell
    after tests in quiet water. Predictions contain only the waves that the tests show.
    """
    assumed_wave_ratio: float = 0.5
    """The same, relative to the depth rms under disturbance with the initial gains.

    Tests may show no swell because they are deep, or by their course. A ratio suits vehicles of
    every size.
    """
    pitch_rms_ratio: float = 1.25
    """Maximum pitch rms under disturbance, relative to the initial gains."""
    pitch_per_metre_deg: float = 18.0
    """Maximum pitch command per metre of depth error (deg/m).

    Small-signal analysis cannot distinguish a large pitch command with a weak pitch loop from the
    reverse, but the pitch limit of the vehicle can.
    """
    command_noise_deg: float = 0.5
    """Maximum standard deviation of the command caused by gyro noise (deg).

    It limits how far the lag of the tailcone is compensated.
    """

    def lower_limits(self) -> str:
        """Return the advice to ask for less; tests do not change what a vehicle permits."""
        options = " ".join(
            f"--{name.replace('_', '-')} {value:g}" for name, value in RELAXED_LIMITS[0].items()
        )
        return (
            f"ask for less, as a campaign would: {options}, or give constant loads more time:"
            f" --integral-settling-s {2.0 * self.integral_settling_s:g}"
        )


class Response(JsonRecord, frozen=True):
    """Predicted response to the identified disturbance, one standard deviation of each signal."""

    heading_deg: float
    pitch_deg: float
    depth_m: float
    rudder_deg: float
    elevator_deg: float


class MinimumVariance(JsonRecord, frozen=True):
    """Least standard deviations of any linear controller under the identified disturbance.

    Same delay, tailcone and sensors as the model, without limits of margins, travel and rate.
    """

    heading_deg: float
    pitch_deg: float
    depth_m: float
    same_rudder_heading_deg: float
    """Heading, if the rms of the rudder's command is that of the design."""
    same_elevator_depth_m: float
    """Depth, if the rms of the elevator's command is that of the design."""


class DesignRobustness(JsonRecord, frozen=True):
    """Shares of the sampled vehicles that meet the limits."""

    specification: float
    """Share that meets the robust limits of the specification."""
    relaxed: float
    """Share with damping 0.5, gain margin 5 dB and phase margin 40 deg."""
    worst: str
    """Constraint that most of the other vehicles violate; empty if all meet the limits."""
    vehicles: int
    """Number of sampled vehicles."""


class Design(NamedTuple):
    """Result of a PID redesign."""

    gains: dict[str, float]
    """Parameters by name."""
    reasons: dict[str, str]
    """Reason for each parameter, one line each."""
    analysis: Analysis
    predicted: Response
    initial: Response
    """Predicted response of the initial gains on the same model."""
    minimum: MinimumVariance | None
    """Lower bound of the errors; None if it has no numerical solution."""
    initial_analysis: Analysis
    spec: Spec
    robustness: DesignRobustness | None
    """Robustness over the model's posterior; None for a model without covariance."""
    baseline: PerformanceBaseline
    """Performance baseline for monitoring."""

    def write_params(self, path: str | Path) -> None:
        """Write the parameter file: ``NAME,VALUE  # reason``.

        Parameters
        ----------
        path : str or Path
            File to write; its header holds the performance baseline
            (`sysid.monitor.performance_spec`).
        """
        write_output(path, encode(self.baseline, self.gains, self.reasons))


class Loads(NamedTuple):
    """Constant loads that the integrators must compensate."""

    level_pitch_rad: float
    """Pitch of level flight, positive nose up (rad)."""
    rudder_rad: float
    """Upper bound of the rudder bias (rad)."""
    elevator_rad: float
    """Uncertainty of the elevator trim (rad)."""
