"""Ways that can be followed: of a set-point within the loop's reach, and of a deflection within the
tailcone's."""

from typing import NamedTuple

from autopilot.control.pid import Gains

LEAD_DAMPING = 0.7
"""Of the lag that the tailcone is to seem to have."""


class ReferenceState(NamedTuple):
    """Where something that moves smoothly is, and how fast it goes."""

    value: float
    rate: float = 0.0


class ActuatorLead(NamedTuple):
    """The tailcone as it is, and as it is to seem: both second-order lags."""

    lag_radps: float
    lag_damping: float
    lead_radps: float
    rate_radps: float
    travel_rad: float


def step_reference(
    to_go: float, way: ReferenceState, bandwidth_radps: float, fastest: float, dt_s: float
) -> ReferenceState:
    """The next point on the way of a reference model: critically damped, and never faster than
    ``fastest``.

    ``to_go`` is the distance from ``way.value`` to the goal, in its unit; ``fastest`` per second.
    """
    w = bandwidth_radps
    rate = min(fastest, max(-fastest, way.rate + (w * w * to_go - 2.0 * w * way.rate) * dt_s))
    return ReferenceState(way.value + rate * dt_s, rate)


def follow_reference(
    to_go: float, way: ReferenceState, gains: Gains, dt_s: float
) -> ReferenceState:
    """The next point of what set-point weighting follows, ``to_go`` from ``way.value`` to the
    set-point.

    P (b r - y) + I integral(r - y), with b the weight, is the plain law on the set-point b r + (1 -
    b) x, where x goes to r at I/P (Astrom and Hagglund 2006, section 3.4). The form with x needs no
    turn of heading to be counted."""
    share = gains.i * dt_s / gains.p if gains.p else 1.0
    return ReferenceState(way.value + min(1.0, share) * to_go)


def lead(
    wanted_rad: float, way: ReferenceState | None, servo: ActuatorLead, dt_s: float
) -> tuple[float, ReferenceState]:
    """The command under which the duct moves to ``wanted_rad`` as through the faster lag, and its
    way there.

    A model of the faster lag moves within the tailcone's travel and rate; the command is the
    tailcone's lag undone on that motion, angle + 2 zeta/w rate + acceleration/w^2. Where the
    command would leave the travel the model holds back, so that what is asked for can be followed.
    Starts at rest where ``way`` is None."""
    angle, rate = way or ReferenceState(wanted_rad)
    travel, w, wanted_w = servo.travel_rad, servo.lag_radps, servo.lead_radps
    wanted_rad = min(travel, max(-travel, wanted_rad))
    faster = wanted_w * wanted_w * (wanted_rad - angle) - 2.0 * LEAD_DAMPING * wanted_w * rate
    moving = angle + 2.0 * servo.lag_damping / w * rate
    command = min(travel, max(-travel, moving + faster / (w * w)))
    rate = min(servo.rate_radps, max(-servo.rate_radps, rate + (command - moving) * w * w * dt_s))
    angle = min(travel, max(-travel, angle + rate * dt_s))
    return command, ReferenceState(angle, rate)
