"""Test signals for system identification: axis, amplitude, duration and value in a tick. Pure."""

import math
from enum import IntEnum
from typing import NamedTuple

from autopilot.control import requests, waveforms
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState, Excitation
from mavlink_io.mission_items import LOOP_ON


class ExcitationAxis(NamedTuple):
    """Actuators that a test axis (SID_AXIS) excites, and the loops that it opens."""

    name: str
    rudder: bool = False
    elevator: bool = False
    thrust: bool = False
    opens_heading: bool = False
    opens_depth: bool = False


ELEVATOR_AXIS, RUDDER_AXIS, THRUST_AXIS = 11, 12, 13
"""Values of SID_AXIS: mixer pitch, mixer yaw and mixer thrust, as in ArduPilot."""
BOTH_AXIS = ELEVATOR_AXIS + RUDDER_AXIS

AXES = {
    ELEVATOR_AXIS: ExcitationAxis("elevator", elevator=True, opens_depth=True),
    RUDDER_AXIS: ExcitationAxis("rudder", rudder=True, opens_heading=True),
    THRUST_AXIS: ExcitationAxis("thrust", thrust=True),
    BOTH_AXIS: ExcitationAxis(
        "both", rudder=True, elevator=True, opens_heading=True, opens_depth=True
    ),
    LOOP_ON + ELEVATOR_AXIS: ExcitationAxis("elevator, loop on", elevator=True),
    LOOP_ON + RUDDER_AXIS: ExcitationAxis("rudder, loop on", rudder=True),
    LOOP_ON + BOTH_AXIS: ExcitationAxis("both, loops on", rudder=True, elevator=True),
}
NO_AXIS = ExcitationAxis("none")


class Wave(IntEnum):
    """SID_WAVE."""

    CHIRP = 0
    STEP = 1
    DOUBLET = 2
    PRBS = 3
    MULTISINE = 4
    THREE_TWO_ONE_ONE = 5
    SQUARE = 6


WAVES = {wave.value: wave.name.lower() for wave in Wave} | {Wave.THREE_TWO_ONE_ONE.value: "3211"}

MAX_FREQUENCY_HZ = 10.0
"""Maximum frequency of a PRBS clock or a tone: the tick samples at 50 Hz."""
_MAX_SEED = 2**24 - 1
"""Maximum seed: a REAL32 holds all integers up to it."""
_MAX_INTERVALS_NUMBER = 9_999_999
"""Maximum number whose digits are switch intervals: a REAL32 holds it exactly."""


class ExcitationOutput(NamedTuple):
    """Test signal of one tick, added to the actuator commands."""

    rudder_rad: float
    elevator_rad: float
    thrust: float
    """Fraction of full."""
    frequency_hz: float
    """Momentary frequency of a chirp, else 0."""


NO_SIGNAL = ExcitationOutput(0.0, 0.0, 0.0, 0.0)


def from_numbers(
    axis: int, magnitude: float, p3: float, p4: float, duration_s: float, wave: int, fade_s: float
) -> requests.StartTest:
    """Return the test that the parameters of MAV_CMD_USER_1 request.

    Parameters
    ----------
    axis : int
        As SID_AXIS.
    magnitude : float
        Amplitude, degrees of rudder or elevator, percent of thrust.
    p3, p4 : float
        Start and stop frequency (Hz); PRBS: seed and clock (Hz); square wave: switch
        intervals as digits.
    duration_s : float
        Duration.
    wave : int
        As SID_WAVE.
    fade_s : float
        Fade time at both ends.
    """
    if wave == Wave.PRBS:
        return requests.StartTest(
            axis=axis,
            magnitude=magnitude,
            start_hz=0.0,
            stop_hz=p4,
            duration_s=duration_s,
            wave=wave,
            fade_s=fade_s,
            seed=_to_integer(p3),
        )
    if wave == Wave.SQUARE:
        return requests.StartTest(
            axis=axis,
            magnitude=magnitude,
            start_hz=0.0,
            stop_hz=0.0,
            duration_s=duration_s,
            wave=wave,
            fade_s=fade_s,
            switch_intervals=switch_intervals(p3, p4),
        )
    return requests.StartTest(
        axis=axis,
        magnitude=magnitude,
        start_hz=p3,
        stop_hz=p4,
        duration_s=duration_s,
        wave=wave,
        fade_s=fade_s,
    )


def from_config(config: Config) -> requests.StartTest:
    """Return the test that the SID_* parameters request."""
    return requests.StartTest(
        axis=config.sid_axis,
        magnitude=config.sid_magnitude,
        start_hz=config.sid_start_hz,
        stop_hz=config.sid_stop_hz,
        duration_s=config.sid_record_s,
        wave=config.sid_wave,
        fade_s=config.sid_fade_in_s,
        seed=config.sid_seed,
        switch_intervals=switch_intervals(config.sid_runs_1, config.sid_runs_2),
    )


def switch_intervals(*numbers: float) -> tuple[int, ...]:
    """Return the switch intervals of a square wave from the digits of numbers.

    3211 is (3, 2, 1, 1). NaN and 0 are skipped. A result with a 0 is invalid: a number is not a
    positive integer up to 9,999,999 or contains the digit 0.
    """
    valid = [n for n in numbers if not math.isnan(n) and n != 0.0]
    if any(not 0.0 < n <= _MAX_INTERVALS_NUMBER or n != int(n) for n in valid):
        return (0,)
    return tuple(int(digit) for n in valid for digit in str(int(n)))


def _to_integer(value: float) -> int:
    """Return the integer part; 0 for NaN and infinity."""
    return int(value) if math.isfinite(value) else 0


def precompute(request: requests.StartTest, state: AutopilotState, config: Config) -> Excitation:
    """Return the test that a request starts now.

    Parameters
    ----------
    request : StartTest
        Requested test. If both axes are tested, the amplitude is that of the rudder, and
        the elevator has SID_ELE_PCT of it.
    state : AutopilotState
        State with the start time and the set-points.
    config : Config
        Parameters.
    """
    axis = AXES.get(request.axis, NO_AXIS)
    amplitude_rad = math.radians(request.magnitude)
    share = config.sid_elevator_pct / 100.0 if axis.rudder else 1.0
    return Excitation(
        axis=request.axis,
        rudder_rad=amplitude_rad if axis.rudder else 0.0,
        elevator_rad=share * amplitude_rad if axis.elevator else 0.0,
        thrust=request.magnitude / 100.0 if axis.thrust else 0.0,
        start_hz=request.start_hz,
        stop_hz=request.stop_hz,
        duration_s=request.duration_s,
        wave=request.wave,
        fade_s=request.fade_s,
        started_us=state.time_us,
        heading_rad=state.setpoint.heading_rad,
        depth_m=state.setpoint.depth_m,
        seed=request.seed,
        switch_intervals=waveforms.THREE_TWO_ONE_ONE
        if request.wave == Wave.THREE_TWO_ONE_ONE
        else request.switch_intervals,
    )


def describe(test: Excitation) -> str:
    """Return the text of a test for STATUSTEXT, which log readers parse.

    Amplitudes are in degrees, of thrust in percent.
    """
    axis, rudder_deg, elevator_deg = (
        AXES[test.axis],
        math.degrees(test.rudder_rad),
        math.degrees(test.elevator_rad),
    )
    amplitude = 100.0 * test.thrust if axis.thrust else rudder_deg if axis.rudder else elevator_deg
    elevator = f" elevator={elevator_deg:.2f}" if axis.rudder and axis.elevator else ""
    return f"axis={test.axis} wave={WAVES[test.wave]} magnitude={amplitude:.2f}{elevator}"


def sample(test: Excitation, t_s: float) -> ExcitationOutput:
    """Return the test signal, with fade.

    Parameters
    ----------
    test : Excitation
        Test.
    t_s : float
        Time since its start.

    Returns
    -------
    ExcitationOutput
        Signal of each actuator.
    """
    fade = waveforms.fade(t_s, test.duration_s, test.fade_s)
    value, frequency_hz = _waveform_value(test, t_s)
    elevator_value = (
        _multisine_tones(test, t_s, part=1) if test.rudder_rad and test.elevator_rad else value
    )
    return ExcitationOutput(
        rudder_rad=test.rudder_rad * fade * value if test.rudder_rad else 0.0,
        elevator_rad=test.elevator_rad * fade * elevator_value if test.elevator_rad else 0.0,
        thrust=test.thrust * fade * value if test.thrust else 0.0,
        frequency_hz=frequency_hz,
    )


def _waveform_value(test: Excitation, t_s: float) -> tuple[float, float]:
    """Return the value of the waveform in [-1, 1], and the frequency of a chirp."""
    match test.wave:
        case Wave.CHIRP:
            return waveforms.chirp(t_s, test.start_hz, test.stop_hz, test.duration_s)
        case Wave.DOUBLET:
            return waveforms.doublet(t_s, test.duration_s), 0.0
        case Wave.PRBS:
            return waveforms.prbs(t_s, test.stop_hz, test.duration_s, test.seed), 0.0
        case Wave.MULTISINE:
            return _multisine_tones(test, t_s, part=0), 0.0
        case Wave.THREE_TWO_ONE_ONE | Wave.SQUARE:
            return waveforms.square(t_s, test.switch_intervals, test.duration_s), 0.0
    return 1.0, 0.0


def _multisine_tones(test: Excitation, t_s: float, part: int) -> float:
    """Return a multisine with all tones of the band, or every second if both axes are tested."""
    return waveforms.multisine(t_s, _multisine_frequencies(test, part), test.duration_s)


def _multisine_frequencies(test: Excitation, part: int) -> waveforms.Comb:
    """Return the tones of an axis: part 0 is the rudder, 1 the elevator if both are tested."""
    parts = 2 if test.rudder_rad and test.elevator_rad else 1
    return waveforms.comb(test.start_hz, test.stop_hz, test.duration_s, part, parts)


def check(test: Excitation, travel_deg: float) -> str:
    """Check a test.

    Parameters
    ----------
    test : Excitation
        Test to check.
    travel_deg : float
        Maximum angle of the duct, which limits the amplitude.

    Returns
    -------
    str
        What is wrong, with value and limit; empty if the test is valid.
    """
    if test.axis not in AXES:
        known = ", ".join(f"{number} ({axis.name})" for number, axis in AXES.items())
        return f"axis {test.axis}: must be one of {known}"
    if test.wave not in WAVES:
        return f"wave {test.wave}: must be one of " + ", ".join(
            f"{number} ({name})" for number, name in WAVES.items()
        )
    if fault := _amplitude_fault(test, AXES[test.axis], travel_deg):
        return fault
    if not 0.0 < test.duration_s < math.inf:
        return f"duration {test.duration_s:g} s: must be above 0"
    if not 0.0 <= test.fade_s <= 0.5 * test.duration_s:
        return f"fade {test.fade_s:g} s: must be 0 to half the duration"
    return _wave_fault(test)


def _amplitude_fault(test: Excitation, axis: ExcitationAxis, travel_deg: float) -> str:
    """Return what is wrong with the amplitude, or with a wave on both axes; empty if valid."""
    if axis.thrust:
        size, limit, unit = 100.0 * test.thrust, 100.0, "%"
    else:
        size, limit, unit = (
            math.degrees(test.rudder_rad if axis.rudder else test.elevator_rad),
            travel_deg,
            "deg",
        )
    if not 0.0 < abs(size) <= limit:
        return f"magnitude {size:g} {unit}: must be within {limit:g} {unit}, and not 0"
    if axis.rudder and axis.elevator and test.wave != Wave.MULTISINE:
        return (
            f"wave {test.wave} ({WAVES[test.wave]}) on both axes: must be {Wave.MULTISINE:d}"
            " (multisine)"
        )
    return ""


def _wave_fault(test: Excitation) -> str:
    """Return what is wrong with the parameters of a waveform; empty if valid."""
    match test.wave:
        case Wave.CHIRP if not 0.0 < test.start_hz <= test.stop_hz:
            return f"chirp {test.start_hz:g} to {test.stop_hz:g} Hz: must rise from above 0"
        case Wave.PRBS:
            return _prbs_fault(test)
        case Wave.MULTISINE:
            return _multisine_fault(test)
        case Wave.SQUARE if not test.switch_intervals or not all(test.switch_intervals):
            return (
                "square wave: runs must be whole numbers of digits 1 to 9, to"
                f" {_MAX_INTERVALS_NUMBER:g} each, as 3211"
            )
    return ""


def _prbs_fault(test: Excitation) -> str:
    """Return what is wrong with clock, seed or length of a PRBS; empty if valid."""
    if not 0.0 < test.stop_hz <= MAX_FREQUENCY_HZ:
        return f"prbs clock {test.stop_hz:g} Hz: must be above 0, to {MAX_FREQUENCY_HZ:g} Hz"
    if not 0 <= test.seed <= _MAX_SEED:
        return f"prbs seed {test.seed}: must be 0 to {_MAX_SEED}"
    if (bits := waveforms.bits_of(test.stop_hz, test.duration_s)) > waveforms.MAX_BITS:
        return f"prbs of {bits} bits: must be {waveforms.MAX_BITS} or less"
    return ""


def _multisine_fault(test: Excitation) -> str:
    """Return what is wrong with the band of a multisine; empty if valid."""
    band = f"multisine {test.start_hz:g} to {test.stop_hz:g} Hz"
    if not 0.0 < test.start_hz <= test.stop_hz <= MAX_FREQUENCY_HZ:
        return f"{band}: must rise from above 0, to {MAX_FREQUENCY_HZ:g} Hz"
    axis = AXES[test.axis]
    if any(
        not _multisine_frequencies(test, part).amplitudes
        for part in range(2 if axis.rudder and axis.elevator else 1)
    ):
        return (
            f"{band} in {test.duration_s:g} s: must hold a whole number of cycles, another for each"
            " axis"
        )
    return ""
