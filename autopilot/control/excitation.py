"""Test signals for identification: on which axis, how large, how long, and what they ask of the
actuators in a tick."""

import math
from enum import IntEnum
from typing import NamedTuple

from autopilot.control import requests, waveforms
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState, Excitation


class ExcitationAxis(NamedTuple):
    """What a SID_AXIS moves, and which loops it opens."""

    name: str
    rudder: bool = False
    elevator: bool = False
    thrust: bool = False
    opens_heading: bool = False
    opens_depth: bool = False


ELEVATOR_AXIS, RUDDER_AXIS, THRUST_AXIS = 11, 12, 13
"""SID_AXIS: mixer pitch, mixer yaw and mixer thrust of ArduPilot's list."""
BOTH_AXIS = ELEVATOR_AXIS + RUDDER_AXIS
LOOP_ON = 100
"""Added to an axis: the loop of what is tested stays on, and the signal is added to what it asks
for."""

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
"""Of a clock or a tone: faster than that is lost between the ticks."""
_MAX_SEED = 2**24 - 1
"""The largest whole number that a REAL32 holds as well as all below it."""
_MAX_INTERVALS_NUMBER = 9_999_999


class ExcitationOutput(NamedTuple):
    """What a test adds to the actuators at a moment."""

    rudder_rad: float
    elevator_rad: float
    thrust: float
    """Fraction of full."""
    frequency_hz: float
    """Of a chirp, else 0."""


def from_numbers(
    axis: int, magnitude: float, p3: float, p4: float, duration_s: float, wave: int, fade_s: float
) -> requests.StartTest:
    """The test that the seven numbers of MAV_CMD_USER_1 ask for; the third and the fourth are the
    wave's own."""
    if wave == Wave.PRBS:
        return requests.StartTest(
            axis, magnitude, 0.0, p4, duration_s, wave, fade_s, seed=_is_integer(p3)
        )
    if wave == Wave.SQUARE:
        return requests.StartTest(
            axis,
            magnitude,
            0.0,
            0.0,
            duration_s,
            wave,
            fade_s,
            switch_intervals=switch_intervals(p3, p4),
        )
    return requests.StartTest(axis, magnitude, p3, p4, duration_s, wave, fade_s)


def from_config(config: Config) -> requests.StartTest:
    """The test that the SID_* parameters ask for."""
    return requests.StartTest(
        config.sid_axis,
        config.sid_magnitude,
        config.sid_start_hz,
        config.sid_stop_hz,
        config.sid_record_s,
        config.sid_wave,
        config.sid_fade_in_s,
        config.sid_seed,
        switch_intervals(config.sid_runs_1, config.sid_runs_2),
    )


def switch_intervals(*numbers: float) -> tuple[int, ...]:
    """A square wave's runs as the digits of numbers, first to last: 3211 is (3, 2, 1, 1). A 0 marks
    what is no such."""
    given = [n for n in numbers if not math.isnan(n) and n != 0.0]
    if any(not 0.0 < n <= _MAX_INTERVALS_NUMBER or n != int(n) for n in given):
        return (0,)
    return tuple(int(digit) for n in given for digit in str(int(n)))


def _is_integer(value: float) -> int:
    return int(value) if math.isfinite(value) else 0


def precompute(wish: requests.StartTest, state: AutopilotState, config: Config) -> Excitation:
    """The test as it is played from now on. One size serves both axes: the elevator gets its share
    of it."""
    axis = AXES.get(wish.axis, NO_AXIS)
    size_rad = math.radians(wish.magnitude)
    share = config.sid_elevator_pct / 100.0 if axis.rudder else 1.0
    return Excitation(
        axis=wish.axis,
        rudder_rad=size_rad if axis.rudder else 0.0,
        elevator_rad=share * size_rad if axis.elevator else 0.0,
        thrust=wish.magnitude / 100.0 if axis.thrust else 0.0,
        start_hz=wish.start_hz,
        stop_hz=wish.stop_hz,
        duration_s=wish.duration_s,
        wave=wish.wave,
        fade_s=wish.fade_s,
        started_us=state.time_us,
        heading_rad=state.setpoint.heading_rad,
        depth_m=state.setpoint.depth_m,
        seed=wish.seed,
        switch_intervals=waveforms.THREE_TWO_ONE_ONE
        if wish.wave == Wave.THREE_TWO_ONE_ONE
        else wish.switch_intervals,
    )


def describe(test: Excitation) -> str:
    """What is tested, in the words that a log's reader looks for; sizes in degrees or, of thrust,
    in percent."""
    axis, rudder_deg, elevator_deg = (
        AXES[test.axis],
        math.degrees(test.rudder_rad),
        math.degrees(test.elevator_rad),
    )
    size = 100.0 * test.thrust if axis.thrust else rudder_deg if axis.rudder else elevator_deg
    both = f" elevator={elevator_deg:.2f}" if axis.rudder and axis.elevator else ""
    return f"axis={test.axis} wave={WAVES[test.wave]} magnitude={size:.2f}{both}"


def sample(test: Excitation, t_s: float) -> ExcitationOutput:
    """What the test adds, ``t_s`` after it began."""
    fading = waveforms.fade(t_s, test.duration_s, test.fade_s)
    shape, frequency_hz = _waveform_value(test, t_s)
    other = _multisine_tones(test, t_s, part=1) if test.rudder_rad and test.elevator_rad else shape
    return ExcitationOutput(
        test.rudder_rad * fading * shape if test.rudder_rad else 0.0,
        test.elevator_rad * fading * other if test.elevator_rad else 0.0,
        test.thrust * fading * shape if test.thrust else 0.0,
        frequency_hz,
    )


def _waveform_value(test: Excitation, t_s: float) -> tuple[float, float]:
    """The wave in [-1, 1], and a chirp's frequency."""
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
    """A multisine: all tones of the band, or every second where the other axis has those
    between."""
    return waveforms.multisine(t_s, _multisine_frequencies(test, part), test.duration_s)


def _multisine_frequencies(test: Excitation, part: int) -> waveforms.Comb:
    parts = 2 if test.rudder_rad and test.elevator_rad else 1
    return waveforms.comb(test.start_hz, test.stop_hz, test.duration_s, part, parts)


def check(test: Excitation, travel_deg: float) -> str:
    """What is wrong with a test; empty when it may be played."""
    if test.axis not in AXES:
        known = ", ".join(f"{number} ({axis.name})" for number, axis in AXES.items())
        return f"axis {test.axis}: must be one of {known}"
    if test.wave not in WAVES:
        return f"wave {test.wave}: must be one of " + ", ".join(
            f"{number} ({name})" for number, name in WAVES.items()
        )
    if wrong := _size_fault(test, AXES[test.axis], travel_deg):
        return wrong
    if not 0.0 < test.duration_s < math.inf:
        return f"duration {test.duration_s:g} s: must be above 0"
    if not 0.0 <= test.fade_s <= 0.5 * test.duration_s:
        return f"fade {test.fade_s:g} s: must be 0 to half the duration"
    return _wave_fault(test)


def _size_fault(test: Excitation, axis: ExcitationAxis, travel_deg: float) -> str:
    if axis.thrust:
        size, most, unit = 100.0 * test.thrust, 100.0, "%"
    else:
        size, most, unit = (
            math.degrees(test.rudder_rad if axis.rudder else test.elevator_rad),
            travel_deg,
            "deg",
        )
    if not 0.0 < abs(size) <= most:
        return f"magnitude {size:g} {unit}: must be within {most:g} {unit}, and not 0"
    if axis.rudder and axis.elevator and test.wave != Wave.MULTISINE:
        return (
            f"wave {test.wave} ({WAVES[test.wave]}) on both axes: must be {Wave.MULTISINE:d}"
            " (multisine)"
        )
    return ""


def _wave_fault(test: Excitation) -> str:
    """What is wrong with the numbers that are a wave's own."""
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
    if not 0.0 < test.stop_hz <= MAX_FREQUENCY_HZ:
        return f"prbs clock {test.stop_hz:g} Hz: must be above 0, to {MAX_FREQUENCY_HZ:g} Hz"
    if not 0 <= test.seed <= _MAX_SEED:
        return f"prbs seed {test.seed}: must be 0 to {_MAX_SEED}"
    if (bits := waveforms.bits_of(test.stop_hz, test.duration_s)) > waveforms.MAX_BITS:
        return f"prbs of {bits} bits: must be {waveforms.MAX_BITS} or less"
    return ""


def _multisine_fault(test: Excitation) -> str:
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
