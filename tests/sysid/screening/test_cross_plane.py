"""The plane that is not tested: what it may do by itself, and what it may not do with the
surface."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from sitl.vehicle import config
from sysid.data.segments import RATE_HZ, Run
from sysid.screening import screen
from sysid.screening.cross_plane import band, coherence, significant
from tests.sysid import sea


@pytest.fixture(scope="module")
def run(field: config.VehicleConfig) -> Run:
    pulses = ((1, 7.5), (-1, 5.0), (1, 2.5), (-1, 2.5), (1, 7.5), (-1, 5.0), (1, 2.5), (-1, 2.5))
    wave = np.concatenate([sea.step(sign * 6.0, seconds) for sign, seconds in pulses])
    return sea.fly(
        field, "yaw", wave, wave="3-2-1-1", level=sea.CALM, trim_rad=(math.radians(6.0), 0.0)
    )


def coupled(run: Run) -> list[str]:
    (screening,) = screen([run])
    return [reason for reason in screening.reasons if reason.startswith("cross-plane coupling: ")]


def coloured(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Rates of a vehicle in a sea: slow, not white."""
    b, a = signal.butter(1, 0.3, fs=RATE_HZ)
    return signal.lfilter(b, a, rng.standard_normal(samples + 500))[500:]


def test_unrelated_rates_are_coherent_once_in_a_hundred(run: Run) -> None:
    rng, alarms, draws = np.random.default_rng(1), 0, 150
    for _ in range(draws):
        found, bins = coherence(run, coloured(rng, run.time_s.size))
        alarms += found > significant(bins)
    assert alarms <= 0.01 * draws + 3.0 * math.sqrt(0.01 * draws)


def test_a_pitch_rate_that_follows_the_rudder_is_found(run: Run) -> None:
    assert coupled(run) == []
    follows = replace(run, q_radps=run.q_radps + 0.4 * run.r_radps, pitch_rad=run.pitch_rad)
    assert ["pitch rate follows the surface" in reason for reason in coupled(follows)] == [True]
    little = replace(run, q_radps=run.q_radps + 0.05 * run.r_radps)
    assert coupled(little) == []


def test_a_test_of_both_surfaces_moves_both_planes(run: Run) -> None:
    follows = replace(run, q_radps=run.q_radps + 0.4 * run.r_radps, both=True)
    assert coupled(follows) == []
    assert coupled(replace(follows, roll_rad=np.full_like(run.roll_rad, 0.5)))


def test_a_sea_leaves_its_band_once_in_a_hundred_runs(run: Run) -> None:
    """Rice's formula against draws of a sea that swings the vehicle at 0.15 Hz."""
    rng, beyond, draws = np.random.default_rng(2), 0, 200
    b, a = signal.iirpeak(0.15, 2.0, fs=RATE_HZ)
    for _ in range(draws):
        swings = [
            signal.lfilter(b, a, rng.standard_normal(run.time_s.size + 2000))[2000:]
            for _ in range(12)
        ]
        beyond += float(np.max(np.abs(swings[0]))) > band([run] * 12, swings, run)
    assert beyond <= 0.01 * draws + 3.0 * math.sqrt(0.01 * draws)


def test_the_band_of_a_rough_sea_is_wider(run: Run) -> None:
    """Five degrees of pitch are the sea's where it makes four before tests, and not in a calm."""
    swing = math.radians(5.0) * np.sin(0.7 * run.time_s)
    after = replace(run, pitch_rad=run.pitch_rad + swing * ~run.preroll)
    always = replace(run, pitch_rad=run.pitch_rad + swing)
    assert any("pitch moved" in reason for reason in coupled(after))
    assert not any("pitch moved" in reason for reason in coupled(always))
