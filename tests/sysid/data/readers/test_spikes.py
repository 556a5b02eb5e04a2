"""Samples that their neighbours contradict are left out and reported."""

import numpy as np
import pytest

from sysid.data.readers.samples import MessageColumns, format_damage
from sysid.data.readers.spikes import Plausible, contradicted, drop_contradicted

NOISE_SD = 0.1
RNG = np.random.default_rng(5)
NOISE = NOISE_SD * RNG.standard_normal(2000)


@pytest.mark.parametrize("spike", [1.5, -1.5, 1e30, np.nan, np.inf])
def test_single_wrong_sample_is_found(spike: float) -> None:
    values = NOISE.copy()
    values[700] = values[699] + spike
    assert list(np.flatnonzero(contradicted(values, Plausible(0.01)))) == [700]


@pytest.mark.parametrize("end", [0, -1])
@pytest.mark.parametrize("wrong", [1.5, -1.5, 1e30, np.nan])
def test_wrong_sample_at_an_end_is_found(end: int, wrong: float) -> None:
    values = NOISE.copy()
    values[end] = wrong
    assert list(np.flatnonzero(contradicted(values, Plausible(0.01)))) == [end % 2000]


def test_time_of_an_outermost_sample_far_away_is_found() -> None:
    time_s = 0.02 * np.arange(50.0)
    time_s[-1] = 4.5e9
    kept, _ = drop_contradicted({"A": MessageColumns(time_s, {})}, {"A": {}})
    assert kept["A"].time_s.size == 49


def test_changes_near_the_ends_are_kept() -> None:
    late, early = np.zeros(2000), np.zeros(2000)
    late[-3:], early[:3] = 5.0, 5.0  # the outermost samples agree with their neighbours
    for values in (NOISE + late, NOISE + early, np.geomspace(1.0, 1e6, 2000)):
        assert not contradicted(values, Plausible(0.01)).any()


def test_noise_steps_and_ramps_are_kept() -> None:
    steps = np.where(np.arange(2000) // 100 % 2, 5.0, -5.0)
    for values in (NOISE, NOISE + steps, np.linspace(0.0, 900.0, 2000), steps, np.zeros(2000)):
        assert not contradicted(values, Plausible(0.01)).any()


def test_missing_values_throughout_are_kept() -> None:
    assert not contradicted(np.full(50, np.nan), Plausible(0.01)).any()


def test_angle_that_crosses_north_is_kept() -> None:
    values = np.full(40, 359.9)
    values[20] = 0.4
    assert not contradicted(values, Plausible(1.0, 360.0)).any()
    assert contradicted(values, Plausible(1.0)).any()


def test_dropped_samples_are_reported_with_their_time() -> None:
    time_s, values = 0.02 * np.arange(50.0), np.zeros(50)
    time_s[10], values[30] = 99.0, 7.0
    tables = {"A": MessageColumns(time_s, {"x": values}), "B": MessageColumns(time_s, {})}
    kept, damage = drop_contradicted(tables, {"A": {"x": Plausible(0.1)}, "C": {}})
    assert kept["A"].time_s == pytest.approx(np.delete(np.arange(50) * 0.02, [10, 30]))
    assert kept["B"] is tables["B"]
    assert format_damage(damage, kept["A"].time_s) == (
        "2 samples are contradicted by the ones around and left out, between 0.2 and 0.6 s"
    )


def test_displaced_time_of_one_sample_is_left_out() -> None:
    time_s = np.arange(50) * 0.1 + 0.001 * RNG.standard_normal(50)
    moved = time_s.copy()
    moved[20] += 0.033
    tables = {"A": MessageColumns(moved, {"x": np.zeros(50)})}
    left, damage = drop_contradicted(tables, {"A": {"x": Plausible(1.0)}})
    assert (left["A"].time_s.size, len(damage.contradicted_s)) == (49, 1)


def test_lost_and_jittering_samples_are_kept() -> None:
    """A gap is no displaced time, nor is jitter of 8 ms."""
    time_s = np.arange(200) * 0.1 + 0.008 * RNG.uniform(-1.0, 1.0, 200)
    time_s = np.delete(time_s, [50, 51, 120])
    tables = {"A": MessageColumns(time_s, {"x": np.zeros(197)})}
    left, _ = drop_contradicted(tables, {"A": {"x": Plausible(1.0)}})
    assert left["A"].time_s.size == 197


def test_last_sample_long_after_all_others_is_left_out() -> None:
    time_s = 0.1 * np.arange(50.0)
    late = np.array([*time_s, 5.5])
    tables = {
        "A": MessageColumns(late, {"x": np.zeros(51)}),
        "B": MessageColumns(time_s, {"x": np.zeros(50)}),
    }
    left, _ = drop_contradicted(tables, {"A": {"x": Plausible(1.0)}})
    assert left["A"].time_s.size == 50
