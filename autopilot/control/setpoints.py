"""What she is to keep to: set-points of the loops, ways over ground, and what is streamed from
outside."""

from typing import NamedTuple


class Setpoint(NamedTuple):
    """What the loops are asked for."""

    depth_m: float = 0.0
    heading_rad: float = 0.0
    thrust: float = 0.0
    """Fraction of full thrust."""
    pitch_rad: float | None = None
    """Given only where the depth loop is open and the pitch loop closed."""


class TrackLine(NamedTuple):
    """A straight way over ground. Places are north + i east from home, in metres."""

    from_m: complex
    to_m: complex
    integral: float = 0.0
    """Of line-of-sight guidance."""


class Circle(NamedTuple):
    """A way round a place."""

    centre_m: complex
    radius_m: float
    clockwise: bool = True
    since_us: int | None = None
    """When the rim was reached; None before that."""
    swept_rad: float = 0.0
    """The way round since then."""
    bearing_rad: float = 0.0
    """Of the vehicle from the centre."""
    integral: float = 0.0


Path = TrackLine | Circle


class AttitudeTarget(NamedTuple):
    """What SET_ATTITUDE_TARGET asks for: an angle, or else a rate."""

    pitch_rad: float | None = None
    heading_rad: float | None = None
    pitch_rate_radps: float = 0.0
    heading_rate_radps: float = 0.0
    thrust: float | None = None
    """Fraction of full."""


class MotionTarget(NamedTuple):
    """What SET_POSITION_TARGET_* asks for. None keeps what is in force."""

    position_m: complex | None = None
    """North + i east from home."""
    depth_m: float | None = None
    velocity_mps: complex | None = None
    """Over ground, north + i east."""
    depth_rate_mps: float | None = None
    speed_mps: float | None = None
    """Through the water, ahead."""
    heading_rad: float | None = None
    heading_rate_radps: float | None = None


class Targets(NamedTuple):
    """What is streamed from outside."""

    attitude: AttitudeTarget | None = None
    motion: MotionTarget | None = None
