"""Screening of the plane that is not tested: excursions and coherence with the tested surface."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from sitl.vehicle import config
from sysid.data.runs import RATE_HZ, Run
from sysid.planes import Plane
from sysid.screening import screen
from sysid.screening.cross_plane import band, coherence, significant, stationary_motion
from tests.sysid import sea


@pytest.fixture(scope="module")
def run(field: config.VehicleConfig) -> Run:
    pulses = ((1, 7.5), (-1, 5.0), (1, 2.5), (-1, 2.5), (1, 7.5), (-1, 5.0), (1, 2.5), (-1, 2.5))
    wave = np.concatenate([sea.step(sign * 6.0, seconds) for sign, seconds in pulses])
    return sea.fly(
        field, Plane.YAW, wave, wave="3-2-1-1", level=sea.CALM, trim_rad=(math.radians(6.0), 0.0)
    )


def coupled(run: Run) -> list[str]:
    (screening,) = screen([run])
    return [reason for reason in screening.reasons if reason.startswith("cross-plane coupling: ")]


def coloured(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Low-pass filtered noise, like the rate of a disturbed vehicle."""
    b, a = signal.butter(1, 0.3, fs=RATE_HZ)
    return np.asarray(signal.lfilter(b, a, rng.standard_normal(samples + 500))[500:])


def test_coherence_unrelated_rates_rarely_significant(run: Run) -> None:
    rng, alarms, draws = np.random.default_rng(1), 0, 150
    for _ in range(draws):
        largest, bins = coherence(run, coloured(rng, run.time_s.size))
        alarms += largest > significant(bins)
    assert alarms <= 0.01 * draws + 3.0 * math.sqrt(0.01 * draws)


def test_screen_coherent_pitch_rate_is_rejected(run: Run) -> None:
    assert coupled(run) == []
    strongly_coupled = replace(
        run, q_radps=run.q_radps + 0.4 * run.r_radps, pitch_rad=run.pitch_rad
    )
    assert ["pitch rate follows the surface" in reason for reason in coupled(strongly_coupled)] == [
        True
    ]
    weakly_coupled = replace(run, q_radps=run.q_radps + 0.05 * run.r_radps)
    assert coupled(weakly_coupled) == []


def test_screen_dual_test_is_rejected_for_roll_only(run: Run) -> None:
    follows = replace(run, q_radps=run.q_radps + 0.4 * run.r_radps, both=True)
    assert coupled(follows) == []
    assert coupled(replace(follows, roll_rad=np.full_like(run.roll_rad, 0.5)))


def test_band_is_exceeded_in_one_percent_of_runs(run: Run) -> None:
    """Rice's formula against samples of a narrow-band motion at 0.15 Hz."""
    rng, exceedances, draws = np.random.default_rng(2), 0, 200
    b, a = signal.iirpeak(0.15, 2.0, fs=RATE_HZ)
    for _ in range(draws):
        motions = [
            signal.lfilter(b, a, rng.standard_normal(run.time_s.size + 2000))[2000:]
            for _ in range(12)
        ]
        before = stationary_motion([values[run.preroll] for values in motions])
        exceedances += float(np.max(np.abs(motions[0]))) > band(before, run)
    assert exceedances <= 0.01 * draws + 3.0 * math.sqrt(0.01 * draws)


def test_screen_excursion_limit_follows_preroll_motion(run: Run) -> None:
    """An excursion of five degrees is accepted if the motion before the tests is similar."""
    swing = math.radians(5.0) * np.sin(0.7 * run.time_s)
    after = replace(run, pitch_rad=run.pitch_rad + swing * ~run.preroll)
    always = replace(run, pitch_rad=run.pitch_rad + swing)
    assert any("pitch moved" in reason for reason in coupled(after))
    assert not any("pitch moved" in reason for reason in coupled(always))
