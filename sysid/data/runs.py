"""Record of one identification test: commands and motion on a uniform grid."""

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import DEFAULT_TRAVEL_DEG, VelocitySource
from sysid.data.events import StopReason
from sysid.planes import PLANES, Plane
from sysid.signal_processing import smooth

Array = NDArray[np.float64]

RATE_HZ = 50.0
"""Sample rate of a run: the autopilot's tick."""
STEADY_S = 5.0
"""Last part of the pre-roll, which must be steady."""
END_S = 0.1
"""Last part of a test, in which the loop may already move the surface, s.

A loop that takes over often moves the surface to its stop at once. The times of events and rows are
accurate to a few samples.
"""
SMOOTHING = 101
"""Samples (2 s) over which slow motion is smoothed; a closed loop changes it slowly."""


class PlaneSignals(NamedTuple):
    """Signals of a run in one plane."""

    command_rad: Array
    """Command of the surface including trim."""
    trim_rad: float
    angle_rad: Array
    """Heading, unwrapped, or pitch."""
    rate_radps: Array


class SlowMotion(NamedTuple):
    """Smoothed motion on the grid of a run: linear fits over a moving window."""

    pitch_rad: Array
    q_radps: Array
    roll_rad: Array
    depth_rate_mps: Array


@dataclass(frozen=True)
class Run:
    """One test on a uniform grid of ``RATE_HZ`` in MAVLink's axes (FRD, NED).

    All arrays have equal length.
    """

    name: str
    plane: Plane
    wave: str
    magnitude_deg: float
    time_s: Array
    """Time since the start of the test; negative in the pre-roll."""
    rudder_rad: Array
    """Commanded rudder including trim; positive turns the nose to starboard."""
    elevator_rad: Array
    """Commanded elevator including trim; positive turns the nose up."""
    thrust: Array
    """Fraction of full thrust, -1..1."""
    p_radps: Array
    q_radps: Array
    r_radps: Array
    roll_rad: Array
    pitch_rad: Array
    heading_rad: Array
    """Unwrapped."""
    depth_m: Array
    stop_reason: StopReason
    longest_gap_s: float
    """Largest interval between two received samples of attitude or actuators."""
    rudder_trim_rad: float
    elevator_trim_rad: float
    clock_back: str = ""
    """Message name and size of a backward step of time stamps; empty without such a step."""
    clock_drift_s: float = 0.0
    """Change of recorder time minus vehicle time from the first to the last quarter of the run."""
    both: bool = False
    """True if the other surface was under test at the same time; this run is for one plane."""
    earlier_rad: tuple[Array, Array] = (np.empty(0), np.empty(0))
    """Known rudder and elevator commands before the first sample, for the delay of the duct."""
    stop_detail: str = ""
    """Reason of an early end with value and limit; empty for a complete test."""
    travel_rad: float = math.radians(DEFAULT_TRAVEL_DEG)
    """Travel of a surface to either side."""
    has_elevator: bool = True
    """False if no output is an elevator."""
    longest_depth_gap_s: float = 0.0
    """Largest interval between two received samples of depth."""
    forward_mps: Array = field(default_factory=lambda: np.empty(0))
    """Forward velocity from the log (``velocity_source``); as the next five, empty if the log has
    none, NaN far from a sample (``segments.MAX_VELOCITY_AGE_S``)."""
    starboard_mps: Array = field(default_factory=lambda: np.empty(0))
    down_mps: Array = field(default_factory=lambda: np.empty(0))
    specific_force_x_mps2: Array = field(default_factory=lambda: np.empty(0))
    """Accelerometer in FRD: acceleration minus gravity."""
    specific_force_y_mps2: Array = field(default_factory=lambda: np.empty(0))
    specific_force_z_mps2: Array = field(default_factory=lambda: np.empty(0))
    velocity_source: VelocitySource = VelocitySource.NONE
    delay_sd_s: float = 0.0
    """Standard deviation of the delay, because the log does not show when a command changed, or for
    how long the autopilot held it."""
    straight_speed_mps: float = math.nan
    """Measured speed of straight flight with the thrust of the run; NaN if it is not measured."""

    def in_plane(self, plane: Plane) -> PlaneSignals:
        """Return the signals of one plane.

        Parameters
        ----------
        plane : Plane
            Yaw or pitch.

        Returns
        -------
        PlaneSignals
            Rudder and yaw, or elevator and pitch.
        """
        if PLANES[plane].is_yaw:
            return PlaneSignals(
                command_rad=self.rudder_rad,
                trim_rad=self.rudder_trim_rad,
                angle_rad=self.heading_rad,
                rate_radps=self.r_radps,
            )
        return PlaneSignals(
            command_rad=self.elevator_rad,
            trim_rad=self.elevator_trim_rad,
            angle_rad=self.pitch_rad,
            rate_radps=self.q_radps,
        )

    @property
    def command_rad(self) -> Array:
        """Return the command of the surface under test."""
        return self.in_plane(self.plane).command_rad

    @property
    def rate_radps(self) -> Array:
        """Return the rate in the plane under test."""
        return self.in_plane(self.plane).rate_radps

    @property
    def trim_rad(self) -> float:
        """Return the trim of the surface under test."""
        return self.in_plane(self.plane).trim_rad

    @property
    def angle_rad(self) -> Array:
        """Return the angle in the plane under test."""
        return self.in_plane(self.plane).angle_rad

    @cached_property
    def slow_motion(self) -> "SlowMotion":
        """Return the motion smoothed over SMOOTHING samples."""
        window = min(SMOOTHING, (self.time_s.size - 1) // 2 * 2 + 1)
        pitch, q, roll = (
            smooth(x, window).value for x in (self.pitch_rad, self.q_radps, self.roll_rad)
        )
        return SlowMotion(
            pitch_rad=pitch,
            q_radps=q,
            roll_rad=roll,
            depth_rate_mps=smooth(self.depth_m, window).slope * RATE_HZ,
        )

    @cached_property
    def relative_speed(self) -> Array | None:
        """Return the measured forward speed over that of straight flight, smoothed.

        None if it was not measured throughout, or is only an estimate of the autopilot.
        """
        forward = self.forward_mps
        if math.isnan(self.straight_speed_mps) or not np.all(forward > 0.0):  # NaN: not measured
            return None
        window = min(SMOOTHING, (self.time_s.size - 1) // 2 * 2 + 1)
        return smooth(forward, window).value / self.straight_speed_mps

    @property
    def preroll(self) -> NDArray[np.bool_]:
        """Return a mask of the samples before the test."""
        return self.time_s < 0.0

    @property
    def under_test(self) -> NDArray[np.bool_]:
        """Return a mask of the samples of the test without its last END_S; at least the first."""
        last_s = max(float(self.time_s[-1]) - END_S, 0.0)
        return (self.time_s >= 0.0) & (self.time_s <= last_s)

    @property
    def approach(self) -> NDArray[np.bool_]:
        """Return a mask of the last STEADY_S before the test."""
        return (self.time_s < 0.0) & (self.time_s >= -STEADY_S)

    def history_rad(self, plane: Plane) -> Array:
        """Return the commands of a plane's surface, including those before the first sample.

        Parameters
        ----------
        plane : Plane
            Plane; yaw has the rudder, pitch the elevator.

        Returns
        -------
        ndarray
            Surface command at RATE_HZ, in radians; its last samples belong to ``time_s``.
        """
        return np.concatenate(
            [self.earlier_rad[PLANES[plane].index], self.in_plane(plane).command_rad]
        )

    def since(self, start_s: float) -> "Run":
        """Return the run from ``start_s`` on; ``earlier_rad`` holds the commands before it.

        Parameters
        ----------
        start_s : float
            First vehicle time, in seconds.

        Returns
        -------
        Run
            Samples from ``start_s`` on.
        """
        first = int(np.searchsorted(self.time_s, start_s - 1e-9))
        rudder, elevator = self.history_rad(Plane.YAW), self.history_rad(Plane.PITCH)
        end = rudder.size - self.time_s.size + first
        remaining = {name: getattr(self, name)[first:] for name in _SERIES}
        return replace(self, **remaining, earlier_rad=(rudder[:end], elevator[:end]))

    def until(self, stop_s: float) -> "Run":
        """Return the run up to ``stop_s``.

        Parameters
        ----------
        stop_s : float
            Last vehicle time, in seconds.

        Returns
        -------
        Run
            Samples up to ``stop_s``, which is included.
        """
        end = int(np.searchsorted(self.time_s, stop_s + 1e-9))
        return replace(self, **{name: getattr(self, name)[:end] for name in _SERIES})


_SERIES = tuple(field.name for field in fields(Run) if field.type is Array)
"""Names of the arrays of a run."""
