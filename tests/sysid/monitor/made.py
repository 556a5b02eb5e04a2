"""Synthetic steady flight of coloured noise, with or without deviations from the baseline."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, LogEvent, Setpoints
from sysid.data.events import parse_text
from sysid.monitor.performance_spec import AVERAGED_S, PerformanceBaseline, PredictedStatistic

Array = NDArray[np.float64]

STEP_S, MEMORY_S = 0.1, 3.0
RMS = {
    "heading_deg": 0.4,
    "pitch_deg": 0.4,
    "depth_m": 0.03,
    "rudder_deg": 0.7,
    "elevator_deg": 0.7,
}
MEANS = {
    "heading_deg": 0.0,
    "pitch_deg": -1.9,
    "depth_m": 0.0,
    "rudder_deg": 6.0,
    "elevator_deg": 0.3,
}
UNSURE = {"pitch_deg": 0.1, "elevator_deg": 0.15, "rudder_deg": 0.04}
DEPTH_M, HEADING_RAD, THRUST = 5.0, 3.1, 0.58


def baseline() -> PerformanceBaseline:
    """Return a baseline of first-order noise with the matching rms in the band about 2 rad/s."""
    share = AVERAGED_S / MEMORY_S
    averaged = 2.0 / share * (1.0 - (1.0 - math.exp(-share)) / share)
    band = 0.5 * math.pi * 0.5 * 2.0 * (2.0 * MEMORY_S / (1.0 + (2.0 * MEMORY_S) ** 2)) / math.pi
    statistics = {name: _expected(name, rms, averaged) for name, rms in RMS.items()}
    resonances = {
        f"{plane}_resonance_deg": PredictedStatistic(
            0.0, 0.0, 0.4 * math.sqrt(band), 0.8 * math.sqrt(band), 1e-3, 5.0
        )
        for plane in ("heading", "pitch")
    }
    return PerformanceBaseline(
        "ab" * 32, "0", 1.3, THRUST, 2.0, 2.0, {}, {**statistics, **resonances}
    )


def _expected(name: str, rms: float, averaged: float) -> PredictedStatistic:
    """Return the predicted statistics of first-order noise."""
    return PredictedStatistic(
        MEANS[name], UNSURE.get(name, 0.0), rms, 1.96 * rms, rms * math.sqrt(averaged), MEMORY_S
    )


def noise(rng: np.random.Generator, count: int, rms: float) -> Array:
    """Return first-order noise."""
    keep = math.exp(-STEP_S / MEMORY_S)
    white = rng.normal(0.0, rms * math.sqrt(1.0 - keep**2), count)
    white[0] = rng.normal(0.0, rms)
    return np.asarray(lfilter([1.0], [1.0, -keep], white))


def flight(
    seconds: float,
    seed: int,
    shifts: Mapping[str, float] | None = None,
    noise_factor: float = 1.0,
    from_s: float = 0.0,
) -> Log:
    """Return a log of steady flight.

    `shifts` is added to the means from `from_s` (s) on; `noise_factor` scales the noise.
    """
    rng, t = np.random.default_rng(seed), STEP_S * np.arange(1.0, round(seconds / STEP_S) + 1.0)
    series = {
        name: MEANS[name]
        + (t >= from_s) * (shifts or {}).get(name, 0.0)
        + noise_factor * noise(rng, t.size, rms)
        for name, rms in RMS.items()
    }
    zero, nothing = np.zeros_like(t), np.empty(0)
    yaw = HEADING_RAD + np.radians(series["heading_deg"])
    steady = np.full_like(t, HEADING_RAD)
    return Log(
        name="made",
        sha256="",
        attitude=Attitude(t, zero, np.radians(series["pitch_deg"]), yaw, zero, zero, zero),
        actuators=Actuators(
            t, np.radians(series["rudder_deg"]), np.radians(series["elevator_deg"]), zero + THRUST
        ),
        depth=Depth(t, DEPTH_M + series["depth_m"], zero),
        setpoints=Setpoints(t, steady, zero, t, zero + DEPTH_M),
        events=(),
        parameters={},
        duct=DuctAngles(nothing, nothing, nothing),
    )


def event(time_s: float, text: str) -> LogEvent:
    """Return the event of a text."""
    return LogEvent(time_s, parse_text(6, text))
