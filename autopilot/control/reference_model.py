"""Reference model of a set-point, set-point weighting, and filters of the commands. Pure."""

import math
from typing import NamedTuple

from autopilot.control.pid import Gains
from mavlink_io.jit import numeric

START_SHARE = 0.5
"""Largest acceleration of a reference as a share of bandwidth times maximum rate."""


class ReferenceState(NamedTuple):
    """Value and rate of a reference (heading in rad, depth in m, or duct angle in rad)."""

    value: float
    rate: float = 0.0
    """Rate per second."""


NO_REFERENCE = ReferenceState(math.nan)
"""State of a reference that has not begun."""


class ActuatorLead(NamedTuple):
    """Second-order lag of the tailcone, and the faster lag that the lead gives it."""

    lag_radps: float
    """Natural frequency of the tailcone."""
    lag_damping: float
    """Damping ratio of the tailcone."""
    lead_radps: float
    """Natural frequency with lead."""
    lead_damping: float
    """Damping ratio with lead."""
    rate_radps: float
    """Rate limit of the tailcone."""
    travel_rad: float
    """Maximum angle of the duct."""


class PeakFilter(NamedTuple):
    """Second-order filter with a larger gain about one frequency, and a gain of 1 far from it."""

    frequency_radps: float
    """Frequency of the largest gain; 0 without a filter."""
    damping: float
    """Damping ratio of the poles."""
    gain: float
    """Gain at this frequency."""


@numeric
def begun(state: ReferenceState) -> bool:
    """Return whether a reference has begun: the state is not NO_REFERENCE."""
    return not math.isnan(state.value)


@numeric
def step_reference(
    to_go: float, state: ReferenceState, bandwidth_radps: float, max_rate: float, dt_s: float
) -> ReferenceState:
    """Advance a critically damped reference model with a rate limit by one tick.

    With r the set-point, x the reference and w the bandwidth, semi-implicit Euler::

        x'' = w^2 (r - x) - 2 w x',    |x'| <= max_rate,    |x''| <= w max_rate / 2

    The limit of x'' makes the reference begin to move as smoothly as it stops: without it the rate
    jumps to ``max_rate`` after a large change. Stopping from ``max_rate`` needs w max_rate / e.

    Parameters
    ----------
    to_go : float
        r - x, in the unit of ``state.value``; a heading difference is wrapped.
    state : ReferenceState
        Reference after the last tick.
    bandwidth_radps : float
        w.
    max_rate : float
        Limit of the rate, in units of ``state.value`` per second.
    dt_s : float
        Time since the last tick.

    Returns
    -------
    ReferenceState
        Reference of this tick.
    """
    w = bandwidth_radps
    limit = START_SHARE * w * max_rate
    acceleration = min(limit, max(-limit, w * w * to_go - 2.0 * w * state.rate))
    rate = min(max_rate, max(-max_rate, state.rate + acceleration * dt_s))
    return ReferenceState(state.value + rate * dt_s, rate)


@numeric
def follow_reference(
    to_go: float, state: ReferenceState, gains: Gains, dt_s: float
) -> ReferenceState:
    """Advance the filtered set-point of set-point weighting by one tick.

    With r the set-point, y the measurement and b the weight, P (b r - y) + K_i integral(r - y) is
    the plain controller with the set-point b r + (1 - b) x, where x' = (K_i / P) (r - x) (Astrom
    and Hagglund 2006, section 3.4). The form with x needs no unwrapping of a heading.

    ``to_go`` is r - x; ``state.value`` is x.
    """
    alpha = gains.i * dt_s / gains.p if gains.p else 1.0
    return ReferenceState(state.value + min(1.0, alpha) * to_go, 0.0)


@numeric
def lead(
    command_rad: float, state: ReferenceState, servo: ActuatorLead, dt_s: float
) -> tuple[float, ReferenceState]:
    """Compute the command under which the duct moves as through a faster lag.

    With c the command of the loops, a the angle of a model of the faster lag (natural frequency
    w2, damping z2), and w, z those of the tailcone::

        a'' = w2^2 (c - a) - 2 z2 w2 a'
        u   = a + (2 z / w) a' + a'' / w^2

    u is the inverse of the tailcone's lag for the motion a. The model moves within travel and
    rate of the tailcone. If u would exceed the travel, a'' is reduced so that the tailcone can
    follow the model.

    Parameters
    ----------
    command_rad : float
        c.
    state : ReferenceState
        a and a' after the last tick; NO_REFERENCE starts at rest at c.
    servo : ActuatorLead
        Parameters of both lags.
    dt_s : float
        Time since the last tick.

    Returns
    -------
    tuple[float, ReferenceState]
        u (rad), and the new state of the model.
    """
    angle, rate = state if begun(state) else ReferenceState(command_rad, 0.0)
    travel, w, lead_w = servo.travel_rad, servo.lag_radps, servo.lead_radps
    command_rad = min(travel, max(-travel, command_rad))
    drag = 2.0 * servo.lead_damping * lead_w
    acceleration = lead_w * lead_w * (command_rad - angle) - drag * rate
    moving = angle + 2.0 * servo.lag_damping / w * rate
    command = min(travel, max(-travel, moving + acceleration / (w * w)))
    rate = min(servo.rate_radps, max(-servo.rate_radps, rate + (command - moving) * w * w * dt_s))
    angle = min(travel, max(-travel, angle + rate * dt_s))
    return command, ReferenceState(angle, rate)


@numeric
def peak(
    command_rad: float, state: ReferenceState, shape: PeakFilter, dt_s: float
) -> tuple[float, ReferenceState]:
    """Compute the command behind a peak filter.

    With c the command, w the frequency, z the damping ratio and g the gain, the filter
    (s^2 + 2 z g w s + w^2) / (s^2 + 2 z w s + w^2) in semi-implicit Euler steps::

        a'' = w^2 (c - a) - 2 z w a'        u = c + (2 z (g - 1) / w) a'

    Its gain is 1 for constant commands, so that integrators and trims do not change.

    Parameters
    ----------
    command_rad : float
        c.
    state : ReferenceState
        a and a' after the last tick; NO_REFERENCE starts at rest at c.
    shape : PeakFilter
        Parameters; the frequency is not 0.
    dt_s : float
        Time since the last tick.

    Returns
    -------
    tuple[float, ReferenceState]
        u (rad), and the new state.
    """
    angle, rate = state if begun(state) else ReferenceState(command_rad, 0.0)
    w, drag = shape.frequency_radps, 2.0 * shape.damping * shape.frequency_radps
    rate = rate + (w * w * (command_rad - angle) - drag * rate) * dt_s
    command = command_rad + 2.0 * shape.damping * (shape.gain - 1.0) / w * rate
    return command, ReferenceState(angle + rate * dt_s, rate)
