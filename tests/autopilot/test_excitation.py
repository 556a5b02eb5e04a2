"""Test signals: sizes, lengths, fades, and the frequency a chirp claims."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.excitation import CHIRP, DOUBLET, RUDDER_AXIS, STEP, check, chirp, value
from autopilot.types import Excitation


def a_test(**changes: object) -> Excitation:
    fields = {
        "axis": RUDDER_AXIS, "magnitude_rad": 0.1, "start_hz": 0.02, "stop_hz": 0.5, "duration_s": 100.0, "wave": STEP,
        "fade_s": 0.0, "started_us": 0, "heading_rad": 0.0, "depth_m": 5.0,
    }  # fmt: skip
    return Excitation(**{**fields, **changes})  # type: ignore[arg-type]


@given(t_s=st.floats(0.0, 100.0), wave=st.sampled_from([CHIRP, STEP, DOUBLET]), fade_s=st.floats(0.0, 50.0))
def test_no_signal_exceeds_its_magnitude(t_s: float, wave: int, fade_s: float) -> None:
    deflection, _ = value(a_test(wave=wave, fade_s=fade_s), t_s)
    assert abs(deflection) <= 0.1 * (1.0 + 1e-12)


def test_step_is_there_from_its_first_instant_to_its_last() -> None:
    assert value(a_test(), 0.0)[0] == value(a_test(), 99.99)[0] == 0.1


def test_doublet_changes_sign_in_the_middle_and_has_no_mean() -> None:
    samples = [value(a_test(wave=DOUBLET), 0.02 * k)[0] for k in range(5000)]
    assert samples[0] == 0.1
    assert samples[-1] == -0.1
    assert abs(sum(samples)) < 1e-9


def test_fade_starts_and_ends_at_zero() -> None:
    faded = a_test(fade_s=5.0)
    assert value(faded, 0.0)[0] == value(faded, 100.0)[0] == 0.0
    assert math.isclose(value(faded, 2.5)[0], 0.05)
    assert value(faded, 50.0)[0] == 0.1


@given(t_s=st.floats(0.1, 99.0))
def test_chirp_phase_turns_at_the_frequency_it_reports(t_s: float) -> None:
    """sin' = 2 pi f cos, by central differences, wherever the sweep is smooth."""
    start_hz, stop_hz, duration_s, h = 0.05, 0.5, 100.0, 1e-5
    lead_s = 2.0 / start_hz
    if abs(t_s - lead_s) < 0.01:
        return
    slope = (chirp(t_s + h, start_hz, stop_hz, duration_s)[0] - chirp(t_s - h, start_hz, stop_hz, duration_s)[0]) / (
        2 * h
    )
    sine, frequency = chirp(t_s, start_hz, stop_hz, duration_s)
    amplitude = 2.0 * math.pi * frequency
    assert math.isclose(slope * slope + (amplitude * sine) ** 2, amplitude**2, rel_tol=1e-3)


def test_chirp_ends_at_its_last_frequency() -> None:
    assert math.isclose(chirp(100.0, 0.02, 0.5, 100.0)[1], 0.5, rel_tol=1e-9)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"axis": 9}, "axis 9"),
        ({"wave": 4}, "wave 4"),
        ({"magnitude_rad": 0.0}, "magnitude"),
        ({"magnitude_rad": 0.3}, "magnitude"),
        ({"magnitude_rad": math.nan}, "magnitude"),
        ({"duration_s": 0.0}, "duration"),
        ({"fade_s": 60.0}, "fade"),
        ({"wave": CHIRP, "start_hz": 0.0}, "chirp"),
        ({"wave": CHIRP, "stop_hz": 0.01}, "chirp"),
    ],
)
def test_an_impossible_test_is_refused_with_its_reason(changes: dict[str, object], word: str) -> None:
    assert word in check(a_test(**changes), 15.0)


def test_a_possible_test_is_not_refused() -> None:
    assert check(a_test(), 15.0) == ""
