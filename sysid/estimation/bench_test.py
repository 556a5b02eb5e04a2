"""A bench session of the tailcone: from its log to frequency responses, the actuator's model and
its rate limits.

The paper's own test ("Tailcone dynamics modeling", figure 4): sinusoids over frequency and
amplitude, one axis at a time, the duct's angle measured from outside or by its encoder."""

import math
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from sysid.data.dataset import Log
from sysid.data.segments import RATE_HZ, TestInterval, intervals_of_tests
from sysid.models import actuator
from sysid.models.actuator import ActuatorFit, AxisParameters, BenchRecord
from sysid.models.model_file import ParameterEstimate

Array = NDArray[np.float64]
AxisName = Literal["rudder", "elevator"]

AXES: dict[int, AxisName] = {12: "rudder", 11: "elevator"}
"""SID_AXIS of the excitation."""
TRANSIENT_S = 3.0
"""Start of a test that is left out of its frequency response: delay, and the lag's own motion dying
out."""
TEST_EDGE_S = 0.1
"""How late the log may say that a test began or ended."""
HALF_POWER = 1.0 / math.sqrt(2.0)
PAPER_LIMITS_HZ = {30.0: 0.25, 10.0: 0.75}
"""Peak to peak amplitude in degrees, and the highest frequency that the paper lets pass
unattenuated."""
_STARTS = (actuator.PAPER, actuator.PAPER._replace(natural_frequency_radps=10.0, delay_s=0.1))


class BenchError(RuntimeError):
    """The log holds no bench test that can be used; the message says what is missing."""


class FrequencyPoint(NamedTuple):
    """The duct's answer to one sinusoid: first harmonic over first harmonic."""

    amplitude_deg: float
    """Peak to peak, as commanded."""
    frequency_hz: float
    gain: float
    gain_sd: float
    phase_deg: float
    phase_sd_deg: float
    model_gain: float
    """Of the fitted model, driven by the same commands."""
    model_phase_deg: float


class Limit(NamedTuple):
    """How fast the duct can be swung to and fro at one amplitude."""

    amplitude_deg: float
    """Peak to peak."""
    triangle_hz: ParameterEstimate
    """Where a triangle's slope meets the rate limit: the paper's arithmetic."""
    sine_hz: ParameterEstimate
    """Where a sine's steepest slope meets it, if nothing else held the duct back."""
    half_power_hz: float | None
    """Where the measured first harmonic has fallen by 3 dB; null where the sweep does not reach
    that far."""
    paper_hz: float | None


class AxisBench(NamedTuple):
    """All that a session tells of one axis."""

    points: tuple[FrequencyPoint, ...]
    model: ActuatorFit
    limits: tuple[Limit, ...]


def analyse(log: Log) -> dict[AxisName, AxisBench]:
    """What a bench session tells of each axis that was swept. Raises BenchError."""
    if log.duct.time_s.size == 0:
        raise BenchError(
            f"{log.name}: holds no duct angles; the bench needs a vehicle or a rig with an encoder"
        )
    tests = [span for span in intervals_of_tests(log) if span.axis in AXES and span.wave == "chirp"]
    cut_short = [span for span in tests if span.stop_reason]
    if cut_short or not tests:
        reason = (
            f"a test ended early: {cut_short[0].stop_reason}" if cut_short else "holds no sweeps"
        )
        raise BenchError(f"{log.name}: {reason}")
    return {
        name: _axis(_record(log, name, swept), swept)
        for number, name in AXES.items()
        if (swept := [span for span in tests if span.axis == number])
    }


def _record(log: Log, name: AxisName, tests: list[TestInterval]) -> BenchRecord:
    """One axis from shortly before its first test to its last."""
    commands, duct = log.actuators, log.duct
    start_s, stop_s = tests[0].start_s - TRANSIENT_S, tests[-1].stop_s
    grid_s = start_s + np.arange(math.ceil((stop_s - start_s) * RATE_HZ)) / RATE_HZ
    latest = np.searchsorted(commands.time_s, grid_s + 1e-6, side="right") - 1
    held = getattr(commands, f"{name}_rad")[np.clip(latest, 0, None)]
    measured = (duct.time_s >= start_s) & (duct.time_s <= stop_s)
    travel_rad = math.radians(log.parameters.get("ACT_TRAVEL_DEG", 15.0))
    periods = tuple((test.start_s, test.stop_s) for test in tests)
    angles_rad = getattr(duct, f"{name}_rad")[measured]
    return BenchRecord(start_s, held, duct.time_s[measured], angles_rad, periods, travel_rad)


def _axis(record: BenchRecord, tests: list[TestInterval]) -> AxisBench:
    model = actuator.fit(record, _STARTS)
    simulated = actuator.duct_angles(record, model.axis)
    points = tuple(sorted(_point(record, simulated, model.axis, test) for test in tests))
    return AxisBench(
        points, model, tuple(_limit(points, model, size) for size in sorted(_amplitudes(points)))
    )


def _amplitudes(points: tuple[FrequencyPoint, ...]) -> set[float]:
    return {point.amplitude_deg for point in points} | set(PAPER_LIMITS_HZ)


def linear_response(axis: AxisParameters, frequency_hz: float) -> complex:
    """Duct over command for small motion: delay and second-order lag."""
    s = 2j * math.pi * frequency_hz
    wn = axis.natural_frequency_radps
    lag = s * s / (wn * wn) + 2.0 * axis.damping_ratio * s / wn + 1.0
    return complex(axis.gain * np.exp(-axis.delay_s * s) / lag)


def _point(
    record: BenchRecord, simulated: Array, axis: AxisParameters, test: TestInterval
) -> FrequencyPoint:
    command_s = record.start_s + np.arange(record.command_rad.size) / RATE_HZ
    told = _in_interval(command_s, test.start_s + TEST_EDGE_S, test.stop_s - TEST_EDGE_S)
    hz = frequency_hz(command_s[told], record.command_rad[told])
    last_s = test.stop_s - TEST_EDGE_S
    first_s = last_s - max(1, math.floor((last_s - test.start_s - TRANSIENT_S) * hz)) / hz
    told, seen = (
        _in_interval(command_s, first_s, last_s),
        _in_interval(record.time_s, first_s, last_s),
    )
    # A command is held over its sample: on average it is half a sample old.
    command, _ = _first_harmonic(command_s[told] + 0.5 / RATE_HZ, record.command_rad[told], hz)
    duct, duct_sd = _first_harmonic(record.time_s[seen], record.angle_rad[seen], hz)
    model, _ = _first_harmonic(record.time_s[seen], simulated[seen], hz)
    nominal = linear_response(axis, hz)
    return FrequencyPoint(
        amplitude_deg=round(2.0 * abs(test.magnitude_deg), 2),
        frequency_hz=round(hz, 4),
        gain=abs(duct / command),
        gain_sd=duct_sd / abs(command),
        phase_deg=_phase_deg(duct / command, hz, axis, nominal),
        phase_sd_deg=math.degrees(duct_sd / abs(duct)),
        model_gain=abs(model / command),
        model_phase_deg=_phase_deg(model / command, hz, axis, nominal),
    )


def _in_interval(time_s: Array, first_s: float, last_s: float) -> NDArray[np.bool_]:
    return (time_s > first_s) & (time_s <= last_s)


def _phase_deg(response: complex, hz: float, axis: AxisParameters, nominal: complex) -> float:
    """Phase counted on from zero frequency: the turn is chosen that lies nearest to the linear
    model's."""
    wn, w = axis.natural_frequency_radps, 2.0 * math.pi * hz
    lag = -math.atan2(2.0 * axis.damping_ratio * w / wn, 1.0 - (w / wn) ** 2)
    expected = lag - axis.delay_s * w
    return math.degrees(expected + float(np.angle(response / nominal)))


def frequency_hz(time_s: Array, signal: Array) -> float:
    """Of the sinusoid in a signal: its spectrum's peak, refined by least squares."""
    even = np.arange(time_s[0], time_s[-1], 1.0 / RATE_HZ)
    centred = np.interp(even, time_s, signal) - np.mean(signal)
    padded = 8 * even.size
    peak = float(
        np.fft.rfftfreq(padded, 1.0 / RATE_HZ)[np.argmax(np.abs(np.fft.rfft(centred, padded)))]
    )
    width = RATE_HZ / even.size

    def unexplained(hz: float) -> float:
        return float(np.sum(_fit_sinusoid(even, centred, hz)[1] ** 2))

    found = minimize_scalar(
        unexplained,
        bounds=(max(0.2 * peak, peak - width), peak + width),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(found.x)


def _fit_sinusoid(time_s: Array, signal: Array, hz: float) -> tuple[Array, Array]:
    """Coefficients of (1, cos, sin), and what they leave over."""
    turn = 2.0 * math.pi * hz * time_s
    basis = np.column_stack([np.ones_like(turn), np.cos(turn), np.sin(turn)])
    coefficients = np.linalg.lstsq(basis, signal, rcond=None)[0]
    return coefficients, signal - basis @ coefficients


def _first_harmonic(time_s: Array, signal: Array, hz: float) -> tuple[complex, float]:
    """First harmonic of a signal as a phasor, and one standard deviation of each of its parts."""
    (_, cosine, sine), rest = _fit_sinusoid(time_s, signal, hz)
    variance = float(np.sum(rest**2)) / max(1, rest.size - 3)
    return complex(cosine, -sine), math.sqrt(2.0 * variance / rest.size)


def _limit(points: tuple[FrequencyPoint, ...], model: ActuatorFit, amplitude_deg: float) -> Limit:
    rate_degps, peak_to_peak = math.degrees(model.rate_radps.value), amplitude_deg
    sd = None if model.rate_radps.sd is None else math.degrees(model.rate_radps.sd)
    triangle, sine = (
        ParameterEstimate(rate_degps / way_deg, None if sd is None else sd / way_deg)
        for way_deg in (2.0 * peak_to_peak, math.pi * peak_to_peak)
    )
    swept = [point for point in points if point.amplitude_deg == amplitude_deg]
    return Limit(
        amplitude_deg, triangle, sine, half_power_hz(swept), PAPER_LIMITS_HZ.get(amplitude_deg)
    )


def half_power_hz(points: list[FrequencyPoint]) -> float | None:
    """Where the gain falls through 3 dB below one, between two points on logarithmic scales; None
    if it never does."""
    ordered = sorted(points, key=lambda point: point.frequency_hz)
    for low, high in pairwise(ordered):
        if low.gain >= HALF_POWER > high.gain:
            share = math.log(low.gain / HALF_POWER) / math.log(low.gain / high.gain)
            return float(low.frequency_hz * (high.frequency_hz / low.frequency_hz) ** share)
    return None
