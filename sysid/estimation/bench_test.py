"""Bench test of the tailcone: frequency responses, actuator model and rate limits from its log.

The test is that of the paper ("Tailcone dynamics modeling", figure 4): sinusoids over frequency and
amplitude, one axis at a time. The duct angle is measured from outside or by its encoder.
"""

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from mavlink_io.errors import ErrorCode, OperationError
from sysid.data.dataset import Log
from sysid.data.events import TestAxis, TestWave
from sysid.data.runs import RATE_HZ
from sysid.data.segments import TestInterval, intervals_of_tests
from sysid.models import actuator
from sysid.models.actuator import ActuatorFit, AxisParameters, BenchRecord
from sysid.models.bench_priors import AxisName
from sysid.models.model_file import ParameterEstimate

Array = NDArray[np.float64]

AXES: dict[TestAxis, AxisName] = {TestAxis.RUDDER: "rudder", TestAxis.ELEVATOR: "elevator"}
"""Name by axis of the test."""
TRANSIENT_S = 3.0
"""Start of a sinusoid that its frequency response leaves out, s: delay and transient of the lag."""
TEST_EDGE_S = 0.1
"""Largest delay with which the log reports the start or end of a test, s."""
HALF_POWER = 1.0 / math.sqrt(2.0)
"""Gain at half power, -3 dB."""
PAPER_LIMITS_HZ = {30.0: 0.25, 10.0: 0.75}
"""Highest unattenuated frequency of the paper, Hz, by peak-to-peak amplitude in deg."""
_STARTS = (actuator.PAPER, actuator.PAPER._replace(natural_frequency_radps=10.0, delay_s=0.1))


class BenchError(OperationError):
    """The log contains no usable bench test; the message names what is missing."""

    code = ErrorCode.BENCH_TEST


class FrequencyPoint(NamedTuple):
    """Frequency response of the duct to one sinusoid: ratio of the first harmonics."""

    amplitude_deg: float
    """Commanded peak-to-peak amplitude."""
    frequency_hz: float
    gain: float
    """Measured duct angle over command."""
    gain_sd: float
    phase_deg: float
    """Measured phase, continuous from zero frequency."""
    phase_sd_deg: float
    model_gain: float
    """Gain of the fitted model for the same commands."""
    model_phase_deg: float


class Limit(NamedTuple):
    """Highest frequency that the duct follows at one amplitude."""

    amplitude_deg: float
    """Peak-to-peak amplitude A."""
    triangle_hz: ParameterEstimate
    """Frequency at which the slope of a triangle wave equals the rate limit, rate / (2 A)."""
    sine_hz: ParameterEstimate
    """Frequency at which the largest slope of a sine equals the rate limit, rate / (pi A)."""
    half_power_hz: float | None
    """Frequency at which the measured gain has fallen by 3 dB.

    Null if the sweep does not reach it.
    """
    paper_hz: float | None
    """Value of the paper for this amplitude; null if it gives none."""


class AxisBench(NamedTuple):
    """Results of one axis."""

    points: tuple[FrequencyPoint, ...]
    """Frequency responses, sorted by amplitude and frequency."""
    model: ActuatorFit
    """Fitted actuator model."""
    limits: tuple[Limit, ...]
    """Limits for each amplitude."""


def analyse(log: Log, tests: Iterable[TestInterval] | None = None) -> dict[AxisName, AxisBench]:
    """Analyse the bench test of each axis that was swept.

    Parameters
    ----------
    log : Log
        Log with duct angles.
    tests : Iterable of TestInterval, optional
        Sinusoids in the order of time; the default is the tests that the log's events mark.

    Returns
    -------
    dict
        Results by axis, 'rudder' and 'elevator'.

    Raises
    ------
    BenchError
        The log has no duct angles or no sweeps, or a test ended early.
    """
    if log.duct.time_s.size == 0:
        raise BenchError(
            f"{log.name}: holds no duct angles; the bench needs a vehicle or a rig with an encoder"
        )
    sweeps = [
        test
        for test in (intervals_of_tests(log) if tests is None else tests)
        if test.axis in AXES and test.wave == TestWave.CHIRP
    ]
    aborted = [sweep for sweep in sweeps if sweep.stop_reason]
    if aborted or not sweeps:
        reason = f"a test ended early: {aborted[0].stop_detail}" if aborted else "holds no sweeps"
        raise BenchError(f"{log.name}: {reason}")
    for test in sweeps:
        first_s, last_s = test.start_s + TEST_EDGE_S, test.stop_s - TEST_EDGE_S
        if not np.any(_in_interval(log.duct.time_s, first_s, last_s)):
            raise BenchError(f"{log.name}: no duct angles between {first_s:.1f} and {last_s:.1f} s")
    return {
        axis: _axis(_record(log, axis, axis_tests), axis_tests)
        for number, axis in AXES.items()
        if (axis_tests := [sweep for sweep in sweeps if sweep.axis == number])
    }


def _record(log: Log, name: AxisName, tests: list[TestInterval]) -> BenchRecord:
    """Cut one axis from shortly before its first test to the end of its last."""
    commands, duct = log.actuators, log.duct
    start_s, stop_s = tests[0].start_s - TRANSIENT_S, tests[-1].stop_s
    grid_s = start_s + np.arange(math.ceil((stop_s - start_s) * RATE_HZ)) / RATE_HZ
    command_index = np.searchsorted(commands.time_s, grid_s + 1e-6, side="right") - 1
    commands_rad = getattr(commands, f"{name}_rad")[np.clip(command_index, 0, None)]
    in_record = (duct.time_s >= start_s) & (duct.time_s <= stop_s)
    travel_rad = math.radians(log.parameters.get("ACT_TRAVEL_DEG", 15.0))
    periods = tuple((test.start_s, test.stop_s) for test in tests)
    angles_rad = getattr(duct, f"{name}_rad")[in_record]
    return BenchRecord(
        start_s=start_s,
        command_rad=commands_rad,
        time_s=duct.time_s[in_record],
        angle_rad=angles_rad,
        spans_s=periods,
        travel_rad=travel_rad,
    )


def _axis(record: BenchRecord, tests: list[TestInterval]) -> AxisBench:
    """Fit the actuator model of an axis and compute its frequency responses and limits."""
    model = actuator.fit(record, _STARTS)
    simulated = actuator.duct_angles(record, model.axis)
    points = tuple(sorted(_point(record, simulated, model.axis, test) for test in tests))
    return AxisBench(
        points, model, tuple(_limit(points, model, size) for size in sorted(_amplitudes(points)))
    )


def _amplitudes(points: tuple[FrequencyPoint, ...]) -> set[float]:
    """Return the peak-to-peak amplitudes of the measured points and of the paper, deg."""
    return {point.amplitude_deg for point in points} | set(PAPER_LIMITS_HZ)


def linear_response(axis: AxisParameters, frequency_hz: float) -> complex:
    """Return the small-signal response of the duct to its command.

    Parameters
    ----------
    axis : AxisParameters
        Fitted actuator model: gain, delay (s), natural frequency (rad/s), damping ratio.
    frequency_hz : float
        Frequency, Hz.

    Returns
    -------
    complex
        Gain and phase, gain e^(-tau s) / (s^2/wn^2 + 2 zeta s/wn + 1) at s = j 2 pi f.
    """
    s = 2j * math.pi * frequency_hz
    wn = axis.natural_frequency_radps
    lag = s * s / (wn * wn) + 2.0 * axis.damping_ratio * s / wn + 1.0
    return complex(axis.gain * np.exp(-axis.delay_s * s) / lag)


def _point(
    record: BenchRecord, simulated: Array, axis: AxisParameters, test: TestInterval
) -> FrequencyPoint:
    """Compute the frequency response of one test.

    The response is the ratio of the first harmonics over the last whole periods of the test.
    """
    # C and D first harmonics of command and duct angle (rad) at the frequency f of the command:
    #     response = D / C,   sd(gain) = sd(D) / |C|,   sd(phase) = sd(D) / |D|
    # (Ljung 1999, sec. 6.2).
    command_s = record.start_s + np.arange(record.command_rad.size) / RATE_HZ
    in_test = _in_interval(command_s, test.start_s + TEST_EDGE_S, test.stop_s - TEST_EDGE_S)
    frequency = frequency_hz(command_s[in_test], record.command_rad[in_test])
    last_s = test.stop_s - TEST_EDGE_S
    first_s = (
        last_s - max(1, math.floor((last_s - test.start_s - TRANSIENT_S) * frequency)) / frequency
    )
    in_test = _in_interval(command_s, first_s, last_s)
    in_duct = _in_interval(record.time_s, first_s, last_s)
    # The command is held over its sample: its effective time is half a sample later.
    command_phasor, _ = _first_harmonic(
        command_s[in_test] + 0.5 / RATE_HZ, record.command_rad[in_test], frequency
    )
    duct_phasor, duct_sd = _first_harmonic(
        record.time_s[in_duct], record.angle_rad[in_duct], frequency
    )
    model_phasor, _ = _first_harmonic(record.time_s[in_duct], simulated[in_duct], frequency)
    linear = linear_response(axis, frequency)
    return FrequencyPoint(
        amplitude_deg=round(2.0 * abs(test.magnitude_deg), 2),
        frequency_hz=round(frequency, 4),
        gain=abs(duct_phasor / command_phasor),
        gain_sd=duct_sd / abs(command_phasor),
        phase_deg=_phase_deg(duct_phasor / command_phasor, frequency, axis, linear),
        phase_sd_deg=math.degrees(duct_sd / abs(duct_phasor)),
        model_gain=abs(model_phasor / command_phasor),
        model_phase_deg=_phase_deg(model_phasor / command_phasor, frequency, axis, linear),
    )


def _in_interval(time_s: Array, first_s: float, last_s: float) -> NDArray[np.bool_]:
    """Return the mask of the times in (first_s, last_s]."""
    return (time_s > first_s) & (time_s <= last_s)


def _phase_deg(response: complex, hz: float, axis: AxisParameters, nominal: complex) -> float:
    """Return the phase, continuous from zero frequency: the branch nearest the linear model's."""
    wn, w = axis.natural_frequency_radps, 2.0 * math.pi * hz
    lag_phase = -math.atan2(2.0 * axis.damping_ratio * w / wn, 1.0 - (w / wn) ** 2)
    expected = lag_phase - axis.delay_s * w
    return math.degrees(expected + float(np.angle(response / nominal)))


def frequency_hz(time_s: Array, signal: Array) -> float:
    """Return the frequency of the sinusoid in a signal, Hz."""
    # Peak of the discrete Fourier transform, padded eight times; then the f of least residual
    # |signal - a - b cos(2 pi f t) - c sin(2 pi f t)|^2 within one bin of it.
    grid_s = np.arange(time_s[0], time_s[-1], 1.0 / RATE_HZ)
    centred = np.interp(grid_s, time_s, signal) - np.mean(signal)
    padded = 8 * grid_s.size
    peak = float(
        np.fft.rfftfreq(padded, 1.0 / RATE_HZ)[np.argmax(np.abs(np.fft.rfft(centred, padded)))]
    )
    width = RATE_HZ / grid_s.size

    def residual_power(hz: float) -> float:
        return float(np.sum(_fit_sinusoid(grid_s, centred, hz)[1] ** 2))

    refined = minimize_scalar(
        residual_power,
        bounds=(max(0.2 * peak, peak - width), peak + width),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(refined.x)


def _fit_sinusoid(time_s: Array, signal: Array, hz: float) -> tuple[Array, Array]:
    """Return the least-squares coefficients of (1, cos, sin), and the residual."""
    phase = 2.0 * math.pi * hz * time_s
    basis = np.column_stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
    coefficients = np.linalg.lstsq(basis, signal, rcond=None)[0]
    return coefficients, signal - basis @ coefficients


def _first_harmonic(time_s: Array, signal: Array, hz: float) -> tuple[complex, float]:
    """Return the first harmonic of a signal as a phasor, and the standard deviation of its parts.

    For n samples with residual variance s^2 the latter is sqrt(2 s^2 / n).
    """
    (_, cosine, sine), residual = _fit_sinusoid(time_s, signal, hz)
    variance = float(np.sum(residual**2)) / max(1, residual.size - 3)
    return complex(cosine, -sine), math.sqrt(2.0 * variance / residual.size)


def _limit(points: tuple[FrequencyPoint, ...], model: ActuatorFit, amplitude_deg: float) -> Limit:
    """Return the frequency limits at one peak-to-peak amplitude."""
    rate_degps, peak_to_peak = math.degrees(model.rate_radps.value), amplitude_deg
    sd = None if model.rate_radps.sd is None else math.degrees(model.rate_radps.sd)
    triangle, sine = (
        ParameterEstimate(rate_degps / path_deg, None if sd is None else sd / path_deg)
        for path_deg in (2.0 * peak_to_peak, math.pi * peak_to_peak)
    )
    amplitude_points = [point for point in points if point.amplitude_deg == amplitude_deg]
    return Limit(
        amplitude_deg=amplitude_deg,
        triangle_hz=triangle,
        sine_hz=sine,
        half_power_hz=half_power_hz(amplitude_points),
        paper_hz=PAPER_LIMITS_HZ.get(amplitude_deg),
    )


def half_power_hz(points: list[FrequencyPoint]) -> float | None:
    """Return the frequency (Hz) at which the gain falls below -3 dB; None if it never does.

    It is interpolated on logarithmic scales.
    """
    ordered = sorted(points, key=lambda point: point.frequency_hz)
    for low, high in pairwise(ordered):
        if low.gain >= HALF_POWER > high.gain:
            weight = math.log(low.gain / HALF_POWER) / math.log(low.gain / high.gain)
            return float(low.frequency_hz * (high.frequency_hz / low.frequency_hz) ** weight)
    return None
