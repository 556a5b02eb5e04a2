"""Bench and inclining tests against simulated actuators, first harmonics and the paper's limits."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.core import tailcone
from sitl.vehicle import config
from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, LogEvent, Setpoints
from sysid.data.events import Armed, StopReason, TestAxis, TestEnded, TestStarted, TestWave
from sysid.data.runs import RATE_HZ
from sysid.estimation import bench_test, inclining_test
from sysid.estimation.inclining_test import WeightPeriod

TRAVEL_RAD = math.radians(15.0)
NOISE_RAD, RESOLUTION_RAD = math.radians(0.06), math.radians(0.0219)
PAPER: dict[str, float] = {
    "natural_frequency_radps": 3.0,
    "damping": 0.6,
    "delay_s": 0.3,
    "rate_limit_radps": math.radians(15.0),
    "bias_rad": 0.0,
}
WORN = PAPER | {
    "bias_rad": math.radians(-6.0),
    "step_rad": math.radians(0.05),
    "backlash_rad": math.radians(0.3),
    "lost_step_chance": 0.002,
    "lost_step_above_radps": math.radians(8.0),
}
BRISK = PAPER | {
    "natural_frequency_radps": 8.0,
    "damping": 0.85,
    "delay_s": 0.12,
    "rate_limit_radps": math.radians(30.0),
    "backlash_rad": math.radians(0.8),
}
SLUGGISH = PAPER | {
    "natural_frequency_radps": 1.8,
    "damping": 0.4,
    "delay_s": 0.5,
    "backlash_rad": math.radians(0.1),
}
NOTHING = np.empty(0)


def session(
    servo: dict[str, float],
    seed: int,
    amplitudes_deg: tuple[float, ...] = (5.0, 10.0, 30.0),
    frequencies_hz: tuple[float, ...] = (0.05, 0.12, 0.25, 0.5, 0.75, 1.0),
) -> Log:
    """Simulate a rudder session as the log of a vehicle with an encoder."""
    axis = tailcone.discretise(travel_rad=TRAVEL_RAD, substep_s=0.25 / RATE_HZ, **servo)
    commands, events = [np.zeros(200)], []
    for size in amplitudes_deg:
        for hz in frequencies_hz:
            start_s, duration_s = sum(map(len, commands)) / RATE_HZ, 3.3 + max(7.0, 2.0 / hz)
            t = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
            commands += [math.radians(size / 2.0) * np.sin(2.0 * math.pi * hz * t), np.zeros(40)]
            events.append(
                LogEvent(start_s, TestStarted(TestAxis.RUDDER, TestWave.CHIRP, size / 2.0))
            )
            events.append(LogEvent(start_s + duration_s, TestEnded(StopReason.COMPLETE)))
    command = np.concatenate(commands)
    time_s = np.arange(command.size) / RATE_HZ
    state = tailcone.at_rest(axis)
    substeps = np.empty(4)
    angles = []
    rng = np.random.default_rng(seed)
    for value in command:
        angles.append(tailcone.duct_angle_rad(axis, state))
        losses = rng.random(4) if axis.lost_step_chance > 0.0 else None
        tailcone.advance(axis, state, value, substeps, losses)
    seen = slice(0, None, 5)
    read = np.array(angles)[seen] + NOISE_RAD * rng.standard_normal(time_s[seen].size)
    duct = DuctAngles(time_s[seen], np.round(read / RESOLUTION_RAD) * RESOLUTION_RAD, 0.0 * read)
    return log_of(
        actuators=Actuators(time_s, command, 0.0 * command, 0.0 * command),
        duct=duct,
        events=tuple(events),
    )


def log_of(**given: Any) -> Log:
    empty: dict[str, Any] = {
        "name": "bench.mcap",
        "sha256": "",
        "attitude": Attitude(*(NOTHING,) * 7),
        "actuators": Actuators(*(NOTHING,) * 4),
        "depth": Depth(*(NOTHING,) * 3),
        "setpoints": Setpoints(*(NOTHING,) * 5),
        "events": (),
        "parameters": {},
        "duct": DuctAngles(*(NOTHING,) * 3),
    }
    return Log(**empty | given)


@pytest.mark.parametrize(
    "servo", [PAPER, WORN, BRISK, SLUGGISH], ids=["paper", "worn", "brisk", "sluggish"]
)
def test_analyse_recovers_simulated_actuator(servo: dict[str, float]) -> None:
    model = bench_test.analyse(session(servo, seed=3))["rudder"].model
    simulated = {
        "gain": 1.0,
        "natural_frequency_radps": servo["natural_frequency_radps"],
        "damping_ratio": servo["damping"],
        "delay_s": servo["delay_s"],
        "rate_radps": servo["rate_limit_radps"],
        "backlash_rad": servo.get("backlash_rad", 0.0),
    }
    errors_sd = {
        name: (getattr(model, name).value - value) / getattr(model, name).sd
        for name, value in simulated.items()
    }
    assert all(abs(error_sd) < 3.0 for error_sd in errors_sd.values()), errors_sd
    assert math.sqrt(np.mean(np.square(list(errors_sd.values())))) < 1.7, errors_sd
    assert all(
        getattr(model, name).sd < 0.03 * max(value, 0.3) for name, value in simulated.items()
    )
    assert model.residual_rad < 1.3 * NOISE_RAD


def test_analyse_lost_steps_increase_bias_sd() -> None:
    losing = PAPER | {
        "bias_rad": math.radians(-6.0),
        "step_rad": math.radians(0.1),
        "lost_step_chance": 0.01,
    }
    steady = bench_test.analyse(session(losing | {"lost_step_chance": 0.0}, seed=1))["rudder"].model
    moving = bench_test.analyse(session(losing, seed=1))["rudder"].model
    assert steady.bias_rad.value == pytest.approx(math.radians(-6.0), abs=math.radians(0.02))
    assert abs(steady.bias_change_rad) < math.radians(0.03)
    assert steady.bias_rad.sd is not None
    assert moving.bias_rad.sd is not None
    assert moving.bias_rad.sd > 10.0 * steady.bias_rad.sd
    assert moving.delay_s.value == pytest.approx(0.3, abs=0.01)


def test_analyse_matches_lag_and_paper_limits() -> None:
    bench = bench_test.analyse(session(PAPER, seed=2, amplitudes_deg=(5.0, 10.0, 30.0)))["rudder"]
    small = [point for point in bench.points if point.amplitude_deg == 5.0]
    phase_errors_deg = []
    for point in small:
        s = 2j * math.pi * point.frequency_hz
        expected = np.exp(-0.3 * s) / (s * s / 9.0 + 0.4 * s + 1.0)
        assert point.gain == pytest.approx(abs(expected), abs=4.0 * point.gain_sd + 0.005)
        phase_error_deg = math.degrees(np.angle(expected)) - point.phase_deg
        phase_errors_deg.append((phase_error_deg + 180.0) % 360.0 - 180.0)
        assert phase_errors_deg[-1] == pytest.approx(0.0, abs=4.0 * point.phase_sd_deg)
    hz = np.array([point.frequency_hz for point in small])
    assert abs(phase_errors_deg @ hz) / (360.0 * hz @ hz) < 0.004, "common delay of all phases, s"
    assert sorted(point.phase_deg for point in small) == [point.phase_deg for point in small][::-1]
    limits = {limit.amplitude_deg: limit for limit in bench.limits}
    for size, limit_hz in ((30.0, 0.25), (10.0, 0.75)):
        assert limits[size].paper_hz == limit_hz
        assert limits[size].triangle_hz.value == pytest.approx(limit_hz, rel=0.005)
        assert limits[size].sine_hz.value == pytest.approx(limit_hz * 2.0 / math.pi, rel=0.005)
    # Small motion is limited by the lag alone; the largest amplitude by the rate limit.
    assert limits[5.0].half_power_hz == pytest.approx(0.548, abs=0.02)
    assert limits[30.0].half_power_hz is not None
    assert limits[30.0].half_power_hz < 0.3


@given(st.floats(0.03, 3.0), st.floats(0.0, 6.28), st.floats(-0.2, 0.2))
@settings(max_examples=40)
def test_frequency_hz_recovers_sinusoid(hz: float, phase: float, offset: float) -> None:
    t = np.arange(0.0, max(7.0, 2.0 / hz), 1.0 / RATE_HZ)
    assert bench_test.frequency_hz(
        t, offset + np.sin(2.0 * math.pi * hz * t + phase)
    ) == pytest.approx(hz, rel=2e-3)


def test_analyse_unreached_rate_limit_has_no_sd() -> None:
    log = session(PAPER | {"rate_limit_radps": math.radians(90.0)}, 1, (4.0,), (0.1, 0.3, 0.6))
    bench = bench_test.analyse(log)["rudder"]
    assert bench.model.rate_radps.sd is None
    assert all(limit.triangle_hz.sd is None for limit in bench.limits)


@pytest.mark.parametrize(
    ("replaced", "reason"),
    [
        ({"duct": DuctAngles(*(NOTHING,) * 3)}, "no duct angles"),
        ({"events": ()}, "no sweeps"),
        (
            {
                "events": (
                    LogEvent(4.0, TestStarted(TestAxis.RUDDER, TestWave.CHIRP, 5.0)),
                    LogEvent(9.0, TestEnded(StopReason.DEPTH, "depth 0.0 m above 1 m")),
                )
            },
            "ended early: depth 0.0 m above 1 m",
        ),
        (
            {
                "events": (
                    LogEvent(4000.0, TestStarted(TestAxis.RUDDER, TestWave.CHIRP, 5.0)),
                    LogEvent(4030.0, TestEnded(StopReason.COMPLETE, "")),
                )
            },
            "no duct angles between 4000.1 and 4029.9 s",
        ),
    ],
)
def test_analyse_unusable_log_is_rejected(replaced: dict[str, Any], reason: str) -> None:
    log = session(PAPER, 1, (10.0,), (0.5, 1.0))
    fields = {"actuators": log.actuators, "duct": log.duct, "events": log.events} | replaced
    with pytest.raises(bench_test.BenchError, match=reason):
        bench_test.analyse(log_of(**fields))


MOVES = [
    WeightPeriod(m, 60.0 * n, 60.0 * (n + 1))
    for n, m in enumerate((0.0, 0.2, 0.4, 0.0, -0.2, -0.4, 0.0))
]


def heeled(
    height_m: float,
    mass_kg: float,
    list_kgm: float,
    noise_deg: float,
    seed: int,
    moves: list[WeightPeriod],
) -> Log:
    """Log with the heel of the moment balance and noise with a correlation time of 5 s."""
    t = np.arange(0.0, moves[-1].until_s, 0.1)
    moment = np.array([next(m.moment_kgm for m in moves if time < m.until_s + 1e-9) for time in t])
    slow = np.repeat(np.random.default_rng(seed).standard_normal(t.size // 50 + 1), 50)[: t.size]
    roll = np.arctan((list_kgm - moment) / (mass_kg * height_m)) + math.radians(noise_deg) * slow
    zero = 0.0 * t
    attitude = Attitude(t + 5.0, roll, zero, zero, zero, zero, zero)
    return log_of(attitude=attitude, events=(LogEvent(5.0, Armed()),))


@given(st.floats(0.005, 0.08), st.floats(-0.05, 0.05), st.integers(0, 1000))
@settings(max_examples=30)
def test_inclining_recovers_height(height_m: float, list_kgm: float, seed: int) -> None:
    vehicle = config.load("caribou_nominal")
    mass_kg = vehicle.ballast.mass_kg
    result = inclining_test.analyse(
        heeled(height_m, mass_kg, list_kgm, 0.02, seed, MOVES), MOVES, vehicle
    )
    assert result.height_m.sd is not None
    # Student's t with five degrees of freedom goes beyond 7 standard deviations once in a thousand.
    assert abs(result.height_m.value - height_m) < 7.0 * result.height_m.sd + 1e-9
    assert result.height_m.sd < 0.05 * height_m + 2e-3 * (height_m / 0.02) ** 2
    assert result.z_cm_m.value == pytest.approx(vehicle.ballast.z_cb_m - result.height_m.value)


def test_inclining_unusable_log_is_rejected() -> None:
    vehicle = config.load("caribou_nominal")
    good = heeled(0.02, 640.0, 0.0, 0.0, 0, MOVES)
    with pytest.raises(inclining_test.InclineError, match="at least three moves"):
        inclining_test.analyse(good, [MOVES[0], MOVES[3]], vehicle)
    with pytest.raises(
        inclining_test.InclineError, match="does not hold the arming of the vehicle"
    ):
        inclining_test.analyse(log_of(attitude=good.attitude), MOVES, vehicle)
    with pytest.raises(inclining_test.InclineError, match="still rolling"):
        inclining_test.analyse(heeled(0.02, 640.0, 0.0, 3.0, 0, MOVES), MOVES, vehicle)
    with pytest.raises(inclining_test.InclineError, match="heels away"):
        inclining_test.analyse(
            good, [move._replace(moment_kgm=-move.moment_kgm) for move in MOVES], vehicle
        )
