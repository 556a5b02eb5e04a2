"""Test signals: amplitudes on each axis, fades, and rejected requests."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import requests
from autopilot.control.excitation import (
    AXES,
    BOTH_AXIS,
    ELEVATOR_AXIS,
    RUDDER_AXIS,
    THRUST_AXIS,
    WAVES,
    Wave,
    check,
    describe,
    from_config,
    from_numbers,
    precompute,
    sample,
    switch_intervals,
)
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState, Excitation
from mavlink_io.mission_items import LOOP_ON

SIZE_DEG = 6.0
SIZE_RAD = math.radians(SIZE_DEG)
OWN_NUMBERS = {
    Wave.CHIRP: (0.02, 0.5),
    Wave.STEP: (0.0, 0.0),
    Wave.DOUBLET: (0.0, 0.0),
    Wave.PRBS: (7, 0.5),
    Wave.MULTISINE: (0.02, 0.5),
    Wave.THREE_TWO_ONE_ONE: (0.0, 0.0),
    Wave.SQUARE: (3214, 52),
}


def a_test(
    axis: int = RUDDER_AXIS,
    wave: int = Wave.STEP,
    *,
    size: float = SIZE_DEG,
    p3: float | None = None,
    p4: float | None = None,
    duration_s: float = 100.0,
    fade_s: float = 0.0,
    elevator_pct: float = 50.0,
) -> Excitation:
    own = OWN_NUMBERS[Wave(wave)] if wave in WAVES else (0.0, 0.0)
    request = from_numbers(
        axis,
        size,
        own[0] if p3 is None else p3,
        own[1] if p4 is None else p4,
        duration_s,
        wave,
        fade_s,
    )
    return precompute(request, AutopilotState(), Config(sid_elevator_pct=elevator_pct))


def rudder(test: Excitation, t_s: float) -> float:
    return sample(test, t_s).rudder_rad


@given(
    t_s=st.floats(0.0, 100.0),
    wave=st.sampled_from(Wave),
    fade_s=st.floats(0.0, 50.0),
    axis=st.sampled_from([*AXES]),
)
def test_sample_any_wave_stays_within_amplitude(
    t_s: float, wave: Wave, fade_s: float, axis: int
) -> None:
    test = a_test(axis, wave, fade_s=fade_s)
    if check(test, 15.0):
        assert axis % LOOP_ON == BOTH_AXIS
        assert wave != Wave.MULTISINE
        return
    played = sample(test, t_s)
    assert abs(played.rudder_rad) <= SIZE_RAD * (1.0 + 1e-9)
    assert abs(played.elevator_rad) <= SIZE_RAD * (1.0 + 1e-9)
    assert abs(played.thrust) <= 0.01 * SIZE_DEG * (1.0 + 1e-9)


def test_step_is_constant_over_the_duration() -> None:
    assert rudder(a_test(), 0.0) == rudder(a_test(), 99.99) == SIZE_RAD


def test_doublet_changes_sign_in_the_middle_with_zero_mean() -> None:
    samples = [rudder(a_test(wave=Wave.DOUBLET), 0.02 * k) for k in range(5000)]
    assert samples[0] == SIZE_RAD
    assert samples[-1] == -SIZE_RAD
    assert abs(sum(samples)) < 1e-9


@pytest.mark.parametrize("wave", Wave)
def test_fade_any_wave_starts_and_ends_at_zero(wave: Wave) -> None:
    faded, plain = a_test(wave=wave, fade_s=5.0), a_test(wave=wave)
    assert rudder(faded, 0.0) == rudder(faded, 100.0) == 0.0
    assert math.isclose(rudder(faded, 2.5), 0.5 * rudder(plain, 2.5))
    assert rudder(faded, 50.0) == rudder(plain, 50.0)


def test_fade_thrust_starts_and_ends_at_zero() -> None:
    assert sample(a_test(THRUST_AXIS, fade_s=5.0), 2.5).thrust == pytest.approx(0.03)


def test_frequency_is_reported_for_chirp_only() -> None:
    assert [sample(a_test(wave=wave), 0.0).frequency_hz for wave in Wave] == [0.02] + [0.0] * (
        len(Wave) - 1
    )


@pytest.mark.parametrize(
    ("axis", "sizes"),
    [
        (ELEVATOR_AXIS, (0.0, SIZE_RAD, 0.0)),
        (RUDDER_AXIS, (SIZE_RAD, 0.0, 0.0)),
        (THRUST_AXIS, (0.0, 0.0, 0.06)),
        (LOOP_ON + ELEVATOR_AXIS, (0.0, SIZE_RAD, 0.0)),
        (LOOP_ON + RUDDER_AXIS, (SIZE_RAD, 0.0, 0.0)),
    ],
)
def test_axis_excites_its_actuators_only(axis: int, sizes: tuple[float, float, float]) -> None:
    assert sample(a_test(axis), 1.0)[:3] == pytest.approx(sizes)


def test_both_axes_have_multisines_of_their_amplitudes() -> None:
    both = a_test(BOTH_AXIS, Wave.MULTISINE, elevator_pct=25.0)
    played = [sample(both, 0.02 * k) for k in range(5000)]
    product = sum(p.rudder_rad * p.elevator_rad for p in played)
    power = sum(p.rudder_rad**2 for p in played)
    assert abs(product) < 1e-9 * power
    assert sum(p.elevator_rad**2 for p in played) / power == pytest.approx(0.0625, rel=0.2)


def test_seed_and_intervals_from_command_and_parameters() -> None:
    prbs, square = a_test(wave=Wave.PRBS), a_test(wave=Wave.SQUARE)
    assert (prbs.seed, prbs.stop_hz, square.switch_intervals) == (7, 0.5, (3, 2, 1, 4, 5, 2))
    set_up = Config(
        sid_axis=12,
        sid_magnitude=6.0,
        sid_record_s=100.0,
        sid_wave=6,
        sid_runs_1=3214,
        sid_runs_2=52,
    )
    by_parameters = precompute(from_config(set_up), AutopilotState(), set_up)
    assert [rudder(by_parameters, t) for t in range(100)] == [rudder(square, t) for t in range(100)]
    seeded = Config(
        sid_axis=12, sid_magnitude=6.0, sid_record_s=100.0, sid_wave=3, sid_stop_hz=0.5, sid_seed=7
    )
    assert [
        rudder(precompute(from_config(seeded), AutopilotState(), seeded), t) for t in range(100)
    ] == [rudder(prbs, t) for t in range(100)]


def test_3211_without_intervals_is_valid() -> None:
    test = a_test(wave=Wave.THREE_TWO_ONE_ONE, duration_s=7.0)
    assert [rudder(test, t + 0.5) / SIZE_RAD for t in range(7)] == [1, 1, 1, -1, -1, 1, -1]


@pytest.mark.parametrize("wave", Wave)
@pytest.mark.parametrize("axis", AXES)
def test_describe_is_parsed_by_log_reader(axis: int, wave: Wave) -> None:
    said = describe(a_test(axis, wave))
    assert said.startswith(f"axis={axis} wave={WAVES[wave]} magnitude=6.00")
    assert ("elevator=3.00" in said) == (axis % LOOP_ON == BOTH_AXIS)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"axis": 9}, "axis 9"),
        ({"wave": 7}, "wave 7"),
        ({"size": 0.0}, "magnitude"),
        ({"size": 17.0}, "magnitude"),
        ({"size": math.nan}, "magnitude"),
        ({"axis": THRUST_AXIS, "size": 101.0}, "magnitude 101 %"),
        ({"axis": BOTH_AXIS}, "both axes"),
        ({"duration_s": 0.0}, "duration"),
        ({"fade_s": 60.0}, "fade"),
        ({"wave": Wave.CHIRP, "p3": 0.0}, "chirp"),
        ({"wave": Wave.CHIRP, "p4": 0.01}, "chirp"),
        ({"wave": Wave.PRBS, "p4": 0.0}, "clock"),
        ({"wave": Wave.PRBS, "p4": math.nan}, "clock"),
        ({"wave": Wave.PRBS, "p3": -1.0}, "seed"),
        ({"wave": Wave.PRBS, "p4": 10.0, "duration_s": 900.0}, "bits"),
        ({"wave": Wave.MULTISINE, "p3": 0.0}, "multisine"),
        ({"wave": Wave.MULTISINE, "p4": 11.0}, "multisine"),
        ({"wave": Wave.MULTISINE, "p3": 0.011, "p4": 0.019}, "whole number of cycles"),
        (
            {"wave": Wave.MULTISINE, "axis": BOTH_AXIS, "p3": 0.02, "p4": 0.02},
            "whole number of cycles",
        ),
        ({"wave": Wave.SQUARE, "p3": 0.0, "p4": 0.0}, "runs"),
        ({"wave": Wave.SQUARE, "p3": 301.0}, "runs"),
        ({"wave": Wave.SQUARE, "p3": -3.0}, "runs"),
    ],
)
def test_check_invalid_test_returns_reason(changes: dict[str, float], word: str) -> None:
    assert word in check(a_test(**changes), 15.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("wave", Wave)
def test_check_valid_test_returns_empty(wave: Wave) -> None:
    assert check(a_test(wave=wave), 15.0) == ""


@given(*[st.floats(width=32)] * 3, st.integers(-200, 200), st.integers(-1, 9))
def test_any_command_is_rejected_or_can_be_sampled(
    size: float, p3: float, p4: float, axis: int, wave: int
) -> None:
    test = precompute(
        requests.StartTest(*from_numbers(axis, size, p3, p4, 30.0, wave, 0.0)),
        AutopilotState(),
        Config(),
    )
    if check(test, 15.0) == "":
        assert all(math.isfinite(number) for t in (0.0, 7.7, 30.0) for number in sample(test, t))


@given(st.floats(), st.floats())
def test_switch_intervals_are_digits_or_invalid(first: float, second: float) -> None:
    assert all(0 <= run <= 9 for run in switch_intervals(first, second))
