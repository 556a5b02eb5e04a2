"""Set-points of the loops, paths over ground, and set-points streamed by a client.

Positions are complex numbers, north + i east from home (m); depth is positive down.
"""

import math
from typing import NamedTuple


class Setpoint(NamedTuple):
    """Set-points of the loops."""

    depth_m: float = 0.0
    heading_rad: float = 0.0
    thrust: float = 0.0
    """Fraction of full thrust."""
    pitch_rad: float = math.nan
    """Pitch set-point that replaces the depth loop; NaN: the depth loop is closed."""


class TrackLine(NamedTuple):
    """Straight path over ground."""

    from_m: complex
    to_m: complex
    integral: float = 0.0
    """Integral of line-of-sight guidance."""


class Circle(NamedTuple):
    """Circular path over ground."""

    centre_m: complex
    radius_m: float
    clockwise: bool = True
    since_us: int | None = None
    """Time at which the circle was reached; None before."""
    swept_rad: float = 0.0
    """Angle swept since then, positive in the direction of the circle."""
    bearing_rad: float = 0.0
    """Bearing of the vehicle from the centre."""
    integral: float = 0.0
    """Integral of line-of-sight guidance."""


Path = TrackLine | Circle


class AttitudeTarget(NamedTuple):
    """Content of SET_ATTITUDE_TARGET. An angle of None is replaced by the rate."""

    pitch_rad: float | None = None
    heading_rad: float | None = None
    pitch_rate_radps: float = 0.0
    heading_rate_radps: float = 0.0
    thrust: float | None = None
    """Fraction of full thrust; None keeps the present thrust."""


class MotionTarget(NamedTuple):
    """Content of SET_POSITION_TARGET_*. None keeps the present set-point."""

    position_m: complex | None = None
    depth_m: float | None = None
    velocity_mps: complex | None = None
    """Velocity over ground, north + i east."""
    depth_rate_mps: float | None = None
    speed_mps: float | None = None
    """Forward speed through the water."""
    heading_rad: float | None = None
    heading_rate_radps: float | None = None


class Targets(NamedTuple):
    """Latest target of each stream; None if there is none or it has timed out."""

    attitude: AttitudeTarget | None = None
    motion: MotionTarget | None = None
