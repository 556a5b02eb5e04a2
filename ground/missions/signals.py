"""Identification tests in a mission script, and their encoding in MAV_CMD_USER_1."""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import msgspec

from ground.errors import out_of_range
from mavlink_io.mission_items import LOOP_ON

SIGNALS = {"chirp": 0, "step": 1, "doublet": 2, "prbs": 3, "multisine": 4, "3211": 5, "square": 6}
"""Value of SID_WAVE by name of the signal."""
AXES = {"rudder": 12, "elevator": 11}
"""Value of SID_AXIS by surface: the yaw and pitch inputs of the mixer."""
_MORE_AXES = {"thrust": 13, "both": 23}
"""Value of SID_AXIS for thrust, and for rudder and elevator at the same time."""
MAX_HZ = 25.0
"""Half of the autopilot's control rate of 50 Hz."""
MAX_TRAVEL_DEG = 45.0
"""Largest travel of surfaces that the autopilot knows; a vehicle refuses more than its own."""
MAX_CLOCK_HZ = 10.0
"""Maximum clock frequency of a PRBS."""
_DIGITS = 7
"""Number of intervals of a square wave that one parameter encodes, one decimal digit each."""

_OWN_KEYS = {"clock_hz": "prbs", "seed": "prbs", "runs": "square"}
"""Signal that takes a key, for keys that only one signal takes."""


class TestSignal(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A signal on one surface, on both surfaces, or on the thrust."""

    signal: Literal["chirp", "step", "doublet", "prbs", "multisine", "3211", "square"]
    """Wave form."""
    axis: Literal["rudder", "elevator", "thrust", "both"]
    """What is moved; ``both`` takes ``multisine`` only."""
    duration_s: int
    """Duration of the signal."""
    magnitude_deg: float | None = None
    """Amplitude on a surface."""
    magnitude_pct: float | None = None
    """Amplitude of thrust, as a percentage of full thrust."""
    f_start_hz: float = 0.0
    """First frequency of a chirp, lowest of a multisine."""
    f_stop_hz: float = 0.0
    """Last frequency of a chirp, highest of a multisine."""
    fade_s: float = 0.0
    """Time of fading in and out."""
    clock_hz: float | None = None
    """Clock frequency of a PRBS."""
    seed: int | None = None
    """Seed of a PRBS."""
    runs: tuple[int, ...] | None = None
    """Relative lengths of the intervals between the switches of a square wave."""
    loop_on: bool = False
    """Whether the control loops stay on and the signal is added to their commands."""


class SignalParameters(NamedTuple):
    """The parameters of MAV_CMD_USER_1."""

    axis: int
    magnitude: float
    p3: float
    p4: float
    duration_s: int
    wave: int
    fade_s: float


def command_parameters(test: TestSignal) -> SignalParameters:
    """Return the parameters of MAV_CMD_USER_1 for a valid test."""
    axis = (AXES | _MORE_AXES)[test.axis] + (LOOP_ON if test.loop_on else 0)
    magnitude = (test.magnitude_pct if test.axis == "thrust" else test.magnitude_deg) or 0.0
    return SignalParameters(
        axis,
        magnitude,
        *_signal_parameters(test),
        test.duration_s,
        SIGNALS[test.signal],
        test.fade_s,
    )


def _signal_parameters(test: TestSignal) -> tuple[float, float]:
    """Return the third and fourth parameter, whose meaning depends on the signal."""
    if test.signal == "prbs":
        return float(test.seed or 0), test.clock_hz or 0.0
    if test.signal == "square":
        digits = "".join(map(str, test.runs or ()))
        return float(digits[:_DIGITS] or 0), float(digits[_DIGITS:] or 0)
    return test.f_start_hz, test.f_stop_hz


def signal_fault(test: TestSignal) -> str:
    """Return the first error of a test; empty if it is valid."""
    return next((fault for fault in _faults(test) if fault), "")


def _faults(test: TestSignal) -> Iterator[str]:
    """Yield an error text, or an empty text, for each check of a test."""
    size, other = (
        ("magnitude_pct", "magnitude_deg")
        if test.axis == "thrust"
        else ("magnitude_deg", "magnitude_pct")
    )
    magnitude = getattr(test, size)
    if magnitude is None or getattr(test, other) is not None:
        yield (
            f"test.{size}: is missing"
            if magnitude is None
            else f"test.{other}: {test.axis} takes {size}"
        )
    if magnitude == 0.0:
        yield f"test.{size} = 0: must not be 0"
    if test.axis == "both" and test.signal != "multisine":
        yield f"test.signal = {test.signal}: must be multisine with axis = both"
    if test.axis == "thrust" and test.loop_on:
        yield "test.loop_on = true: thrust has no loop"
    for key, signal in _OWN_KEYS.items():
        if test.signal != signal and getattr(test, key) is not None:
            yield f"test.{key}: only {signal} takes it"
    yield _band_fault(test) if test.signal in ("chirp", "multisine") else ""
    yield _intervals_fault(test.runs) if test.signal == "square" else ""
    if test.signal == "prbs" and test.clock_hz is None:
        yield "test.clock_hz: is missing"
    max_magnitude = 100.0 if test.axis == "thrust" else MAX_TRAVEL_DEG
    yield out_of_range(f"test.{size}", magnitude, -max_magnitude, max_magnitude)
    yield out_of_range("test.duration_s", float(test.duration_s), 1.0, 600.0)
    yield out_of_range("test.f_start_hz", test.f_start_hz, 0.0, MAX_HZ)
    yield out_of_range("test.f_stop_hz", test.f_stop_hz, 0.0, MAX_HZ)
    yield out_of_range("test.fade_s", test.fade_s, 0.0, test.duration_s / 2)
    yield out_of_range("test.clock_hz", test.clock_hz, 0.001, MAX_CLOCK_HZ)
    yield out_of_range("test.seed", test.seed, 0, 2**24 - 1)


def _band_fault(test: TestSignal) -> str:
    """Return an error if the frequencies are not in rising order; otherwise an empty text."""
    if 0.0 < test.f_start_hz <= test.f_stop_hz:
        return ""
    return (
        f"test.f_start_hz = {test.f_start_hz:g}: a {test.signal} must rise from above 0 to"
        " f_stop_hz"
    )


def _intervals_fault(runs: tuple[int, ...] | None) -> str:
    """Return an error of the intervals of a square wave; otherwise an empty text."""
    if runs and len(runs) <= 2 * _DIGITS and all(1 <= run <= 9 for run in runs):
        return ""
    return f"test.runs = {list(runs or ())}: must be 1 to {2 * _DIGITS} whole numbers from 1 to 9"
