"""Waveforms of test signals: spectra, means, peaks and parameters."""

import math
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from autopilot.control import waveforms

LENGTH_S, STEP_S = 120.0, 0.02
TIMES_S = np.arange(0.0, LENGTH_S, STEP_S)


def comb_signal(
    part: int, parts: int, start_hz: float = 0.02, stop_hz: float = 0.5
) -> NDArray[np.float64]:
    tones = waveforms.comb(start_hz, stop_hz, LENGTH_S, part, parts)
    return np.array([waveforms.multisine(float(t), tones, LENGTH_S) for t in TIMES_S])


def harmonics_with_power(signal: NDArray[np.float64]) -> set[int]:
    """Return the harmonics with power, by an FFT."""
    power = np.abs(np.fft.rfft(signal)) ** 2
    return set(np.flatnonzero(power > 1e-9 * power.max()).tolist())


def test_chirp_ends_at_stop_frequency() -> None:
    assert math.isclose(waveforms.chirp(100.0, 0.02, 0.5, 100.0)[1], 0.5, rel_tol=1e-9)


@given(t_s=st.floats(0.1, 99.0))
def test_chirp_phase_rate_equals_reported_frequency(t_s: float) -> None:
    """Reference: sin' = 2 pi f cos, by central differences where the sweep is smooth."""
    start_hz, stop_hz, duration_s, h = 0.05, 0.5, 100.0, 1e-5
    lead_s = 2.0 / start_hz
    if abs(t_s - lead_s) < 0.01:
        return
    after, before = (
        waveforms.chirp(t, start_hz, stop_hz, duration_s)[0] for t in (t_s + h, t_s - h)
    )
    sine, frequency = waveforms.chirp(t_s, start_hz, stop_hz, duration_s)
    amplitude = 2.0 * math.pi * frequency
    slope = (after - before) / (2 * h)
    assert math.isclose(slope * slope + (amplitude * sine) ** 2, amplitude**2, rel_tol=1e-3)


def test_multisine_has_equal_tones_in_band_only() -> None:
    """A band of 0.02 to 0.5 Hz in 120 s holds 2.4 to 60 cycles."""
    signal = comb_signal(0, 1)
    assert harmonics_with_power(signal) == set(range(3, 61))
    power = np.abs(np.fft.rfft(signal)[3:61]) ** 2
    assert power.max() / power.min() < 1.0 + 1e-9


def test_multisines_of_two_axes_are_orthogonal_at_any_shift() -> None:
    rudder, elevator = comb_signal(0, 2), comb_signal(1, 2)
    assert harmonics_with_power(rudder) == set(range(3, 61, 2))
    assert harmonics_with_power(elevator) == set(range(4, 61, 2))
    correlation = np.fft.irfft(np.fft.rfft(rudder) * np.conj(np.fft.rfft(elevator)))
    assert np.abs(correlation).max() < 1e-9 * len(TIMES_S)


@pytest.mark.parametrize(("part", "parts"), [(0, 1), (0, 2), (1, 2)])
def test_multisine_has_zero_mean_and_low_crest_factor(part: int, parts: int) -> None:
    """N tones in phase have a crest factor of sqrt(2 N), here 10; a sine has 1.4."""
    signal = comb_signal(part, parts)
    assert abs(signal.mean()) < 1e-12
    assert np.abs(signal).max() <= 1.0
    assert 1.0 / signal.std() < 2.1, "the size that is asked for is used"


def test_comb_wide_band_is_decimated_evenly() -> None:
    tones = waveforms.comb(0.02, 2.0, LENGTH_S, 0, 1)
    assert len(tones.amplitudes) <= waveforms.MAX_TONES
    cycles = sorted(harmonics_with_power(comb_signal(0, 1, stop_hz=2.0)))
    assert set(np.diff(cycles)) == {4}
    assert cycles[0] == 3
    assert 240 - cycles[-1] < 4


@given(
    start_hz=st.floats(0.01, 1.0),
    ratio=st.floats(1.0, 20.0),
    duration_s=st.floats(1.0, 300.0),
    part=st.sampled_from([0, 1]),
    t=st.floats(0.0, 1.0),
)
def test_multisine_any_band_stays_within_one(
    start_hz: float, ratio: float, duration_s: float, part: int, t: float
) -> None:
    tones = waveforms.comb(start_hz, start_hz * ratio, duration_s, part, 2)
    assert abs(waveforms.multisine(t * duration_s, tones, duration_s)) <= 1.0 + 1e-9


@given(count=st.integers(1, waveforms.MAX_TONES))
def test_multisine_between_grid_points_stays_within_bound(
    count: int,
) -> None:
    """Modulus of the sum of the tones on a grid 16 times as fine."""
    tones = waveforms.comb(1.0, float(count), 1.0, 0, 1)
    phasors = np.exp(2j * np.pi * np.arange(256 * count) / (256 * count))
    assert len(tones.amplitudes) == count
    assert np.abs(np.polyval(np.array(tones.amplitudes), phasors)).max() <= 1.0 + 1e-12


@pytest.mark.parametrize("order", range(2, 14))
def test_shift_register_passes_all_states(order: int) -> None:
    """Golomb's first two postulates: one more +1 than -1; half of the runs have length 1, a quarter
    length 2 and so on.
    """
    bits = np.array(waveforms.maximal_sequence(order, 0))
    assert len(bits) == 2**order - 1
    assert abs(bits.sum()) == 1.0
    start = int(np.flatnonzero(bits != bits[-1])[0])
    lengths = [len(list(group)) for _, group in groupby(np.roll(bits, -start))]
    assert len(lengths) == 2 ** (order - 1)
    assert lengths.count(1) == max(1, 2 ** (order - 2)) or order == 2
    assert max(lengths) == order


@given(order=st.integers(3, 9), seed=st.integers(0, 2**24 - 1))
def test_prbs_full_period_has_flat_spectrum(order: int, seed: int) -> None:
    """Golomb's third postulate: the periodic autocorrelation is N at shift 0 and -1 elsewhere."""
    bits = np.array(waveforms.maximal_sequence(order, seed))
    power = np.abs(np.fft.fft(bits)) ** 2
    assert power[0] == pytest.approx(1.0)
    assert power[1:] == pytest.approx(len(bits) + 1.0)


def test_prbs_changes_with_clock_over_full_period() -> None:
    """31 bits of 2 s at ticks of 0.02 s: each lasts 100 ticks in spite of rounding of t * clock."""
    samples = [waveforms.prbs(0.02 * k, 0.5, 62.0, 5) for k in range(3100)]
    runs = [len(list(group)) for _, group in groupby(samples)]
    assert all(run % 100 == 0 for run in runs)
    assert samples[::100] == list(waveforms.maximal_sequence(5, 5))


@given(ticks=st.integers(5, 100), seed=st.integers(0, 30))
def test_prbs_bit_of_whole_ticks_keeps_length(ticks: int, seed: int) -> None:
    clock_hz, bits = 50.0 / ticks, waveforms.maximal_sequence(5, seed)
    samples = [
        waveforms.prbs(20_000 * k / 1_000_000, clock_hz, 0.02 * 31 * ticks, seed)
        for k in range(31 * ticks)
    ]
    assert samples == [bit for bit in bits for _ in range(ticks)]


def test_prbs_same_seed_same_sequence() -> None:
    played = [
        tuple(waveforms.prbs(0.5 * k, 1.0, 60.0, seed) for k in range(120)) for seed in (1, 2, 3, 1)
    ]
    assert played[0] == played[3]
    assert len(set(played)) == 3


def test_square_3211_has_its_intervals() -> None:
    samples = [waveforms.square(0.5 * k, waveforms.THREE_TWO_ONE_ONE, 7.0) for k in range(14)]
    assert samples == [1.0] * 6 + [-1.0] * 4 + [1.0] * 2 + [-1.0] * 2


@given(runs=st.lists(st.integers(1, 9), min_size=1, max_size=14), unit_ticks=st.integers(1, 20))
def test_square_changes_sign_after_each_interval(runs: list[int], unit_ticks: int) -> None:
    ticks = unit_ticks * sum(runs)
    samples = [waveforms.square(0.02 * k, tuple(runs), 0.02 * ticks) for k in range(ticks)]
    wanted = [(-1.0) ** n for n, length in enumerate(runs) for _ in range(length * unit_ticks)]
    assert samples == wanted


@given(fade_s=st.floats(0.1, 10.0), t_s=st.floats(0.0, 20.0))
def test_fade_is_symmetric_and_within_bounds(fade_s: float, t_s: float) -> None:
    rising = waveforms.fade(t_s, 20.0, fade_s)
    assert 0.0 <= rising <= 1.0
    assert math.isclose(rising, waveforms.fade(20.0 - t_s, 20.0, fade_s), abs_tol=1e-9)
