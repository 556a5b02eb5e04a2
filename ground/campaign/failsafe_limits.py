"""What a campaign changes after a failsafe: smaller tests, less pitch, slower turns."""

from collections.abc import Iterator, Mapping

from ground.client.dive_symptoms import Symptom, SymptomKind
from mavlink_io.errors import ErrorCode, OperationError

MAX_REPETITIONS, SMALLER_TESTS = 3, 0.6
"""Number of repetitions of an identification dive that ends with a failsafe, and the factor on the
size of its tests and on the pitch that ends them. The flown vehicle can turn more tightly than the
one of the vehicle file; an unstable one reaches the largest pitch with a test of any size."""
PITCH_LIMIT, PITCH_LIMIT_DEG = "SID_PITCH_MAX", 35.0
"""Parameter of the pitch that ends a test, and its default in the autopilot (deg)."""
DIVE_PITCH, DIVE_PITCH_DEG, MIN_DIVE_PITCH_DEG = "PTCH_LIM_DEG", 20.0, 8.0
"""Parameter of the largest pitch set-point, its default in the autopilot, and the smallest value in
a repetition (deg): at a lower one a buoyant vehicle may not leave the surface."""
DIVE_RATE = "DPT_REF_RATE"
"""Parameter of the largest rate of the depth reference, which needs a pitch in proportion."""
TURN_RATE, MIN_TURN_RATE_DEGPS = "HDG_REF_RATE", 3.0
"""Parameter of the largest rate of the heading reference, and its smallest value in a repetition
(deg/s): a turn of 80 deg then takes half of the shortest legs."""
SIMULATED_REDUCTIONS = ((1, 0), (2, 0), (1, 1))
"""Number of reductions of the rate of turns, and of pitch, that are tried one after the other for a
vehicle whose simulated missions end with a failsafe."""
LIMIT_REASONS = {
    DIVE_PITCH: "with a larger one a dive of the campaign ended with a failsafe",
    DIVE_RATE: f"slower in proportion to the smaller {DIVE_PITCH}",
    TURN_RATE: "at a larger one the rudder did not end a turn of a mission of the campaign",
}
"""Reasons, in `gains.param`, of the parameters that failsafes have changed."""


class FailsafeError(OperationError):
    """A dive ended with a failsafe."""

    code = ErrorCode.FAILSAFE

    def __init__(self, message: str, symptom: Symptom | None = None) -> None:
        super().__init__(message)
        self._turns = (
            symptom is not None
            and symptom.axis == "heading"
            and symptom.kind in (SymptomKind.REVERSED, SymptomKind.STUCK)
        )

    @property
    def parameter(self) -> str:
        """Parameter that is reduced in a repetition."""
        return TURN_RATE if self._turns else DIVE_PITCH

    def limit(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return the parameters of a repetition of the mission."""
        return _limit_turns(parameters) if self._turns else limit_dives(parameters, 1)


class AfloatError(FailsafeError):
    """The vehicle did not leave the surface in a dive, which a failsafe or its legs ended."""

    code = ErrorCode.AFLOAT

    def __init__(self, message: str, *, at_full_thrust: bool) -> None:
        super().__init__(message)
        self.at_full_thrust = at_full_thrust
        """Whether the mission began with a descent at full thrust."""


def limit_pitch(parameters: Mapping[str, float], repetition: int) -> dict[str, float]:
    """Return the parameters of a repetition: smaller pitch of tests and of depth changes."""
    return limit_tests(limit_dives(parameters, repetition), repetition)


def limit_tests(parameters: Mapping[str, float], repetition: int) -> dict[str, float]:
    """Return parameters with a smaller pitch that ends a test."""
    if repetition == 0:
        return dict(parameters)
    limit_deg = parameters.get(PITCH_LIMIT, PITCH_LIMIT_DEG) * SMALLER_TESTS**repetition
    return {**parameters, PITCH_LIMIT: round(limit_deg, 1)}


def limit_dives(parameters: Mapping[str, float], repetition: int) -> dict[str, float]:
    """Return parameters with a smaller largest pitch set-point, and depth changes as much slower.

    A change of depth can need the elevator at its limits; a vehicle that is nearly unstable in
    pitch may then turn its nose down too far.
    """
    if repetition == 0:
        return dict(parameters)
    first_deg = parameters.get(DIVE_PITCH, DIVE_PITCH_DEG)
    smaller_deg = max(MIN_DIVE_PITCH_DEG, first_deg * SMALLER_TESTS**repetition)
    limited = {**parameters, DIVE_PITCH: round(min(first_deg, smaller_deg), 1)}
    if DIVE_RATE in limited:
        limited[DIVE_RATE] *= limited[DIVE_PITCH] / first_deg
    return limited


def with_reductions(parameters: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Yield the parameters of a first dive, then those with slower turns and less pitch."""
    yield dict(parameters)
    for turns, pitch in SIMULATED_REDUCTIONS:
        reduced = limit_dives(parameters, pitch)
        for _ in range(turns):
            reduced = _limit_turns(reduced)
        yield reduced


def _limit_turns(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with a slower heading reference, if they limit it.

    The flown vehicle can turn on against its rudder, hard over, from a rate that the vehicle of the
    file could leave.
    """
    if TURN_RATE not in parameters:
        return dict(parameters)
    first_degps = parameters[TURN_RATE]
    slower_degps = max(MIN_TURN_RATE_DEGPS, SMALLER_TESTS * first_degps)
    return {**parameters, TURN_RATE: round(min(first_degps, slower_degps), 1)}
