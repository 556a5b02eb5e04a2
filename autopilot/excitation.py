"""Open-loop test signals: each waveform is a function of the time since the test began."""

import math

from autopilot.types import Excitation

ELEVATOR_AXIS, RUDDER_AXIS = 11, 12
"""SID_AXIS: mixer pitch, mixer yaw."""
AXES = {ELEVATOR_AXIS: "elevator", RUDDER_AXIS: "rudder"}

CHIRP, STEP, DOUBLET = 0, 1, 2
WAVES = {CHIRP: "chirp", STEP: "step", DOUBLET: "doublet"}
"""SID_WAVE."""

CHIRP_LEAD_CYCLES = 2.0
"""Cycles at the first frequency before the sweep, so that the start-up transient is behind it."""


def value(test: Excitation, t_s: float) -> tuple[float, float]:
    """Deflection from trim in radians and, for a chirp, the frequency in hertz, ``t_s`` into the test."""
    if test.wave == STEP:
        shape, frequency = 1.0, 0.0
    elif test.wave == DOUBLET:
        shape, frequency = (1.0 if t_s < 0.5 * test.duration_s else -1.0), 0.0
    else:
        shape, frequency = chirp(t_s, test.start_hz, test.stop_hz, test.duration_s)
    return test.magnitude_rad * fade(t_s, test.duration_s, test.fade_s) * shape, frequency


def chirp(t_s: float, start_hz: float, stop_hz: float, duration_s: float) -> tuple[float, float]:
    """A sine whose frequency grows exponentially after a lead of whole cycles: its value and its frequency."""
    lead_s = min(CHIRP_LEAD_CYCLES / start_hz, 0.5 * duration_s)
    if t_s < lead_s or stop_hz == start_hz:
        return math.sin(2.0 * math.pi * start_hz * t_s), start_hz
    growth = math.log(stop_hz / start_hz) / (duration_s - lead_s)
    frequency = start_hz * math.exp(growth * (t_s - lead_s))
    cycles = start_hz * lead_s + (frequency - start_hz) / growth
    return math.sin(2.0 * math.pi * cycles), frequency


def fade(t_s: float, duration_s: float, fade_s: float) -> float:
    """Half-cosine rise and fall at the ends of a test."""
    edge = min(t_s, duration_s - t_s)
    if fade_s <= 0.0 or edge >= fade_s:
        return 1.0
    return 0.5 - 0.5 * math.cos(math.pi * max(0.0, edge) / fade_s)


def check(test: Excitation, travel_deg: float) -> str:
    """What is wrong with a test; empty when it may be played."""
    if test.axis not in AXES:
        return f"axis {test.axis}: must be 11 (elevator) or 12 (rudder)"
    if test.wave not in WAVES:
        return f"wave {test.wave}: must be 0 (chirp), 1 (step) or 2 (doublet)"
    if not 0.0 < abs(math.degrees(test.magnitude_rad)) <= travel_deg:
        return f"magnitude {math.degrees(test.magnitude_rad):g} deg: must be within {travel_deg:g} deg, and not 0"
    if not test.duration_s > 0.0:
        return f"duration {test.duration_s:g} s: must be above 0"
    if not 0.0 <= test.fade_s <= 0.5 * test.duration_s:
        return f"fade {test.fade_s:g} s: must be 0 to half the duration"
    if test.wave == CHIRP and not 0.0 < test.start_hz <= test.stop_hz:
        return f"chirp {test.start_hz:g} to {test.stop_hz:g} Hz: must rise from above 0"
    return ""
