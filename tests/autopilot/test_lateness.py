"""Lateness of ticks from wall times and time stamps."""

import random
import tracemalloc

import pytest

from autopilot import lateness
from autopilot.lateness import WINDOW_S, Lateness, LatenessMeter
from tests.helpers.fake_hil import Harness, texts

INTERVAL_S = 0.02


def measure(
    monkeypatch: pytest.MonkeyPatch, delays_s: list[float], speed: float = 1.0, drift: float = 0.0
) -> list[Lateness]:
    """Return the results of answers with these delays; the sensors' clock may drift."""
    clock = iter(k * INTERVAL_S / speed * (1.0 + drift) + delay for k, delay in enumerate(delays_s))
    monkeypatch.setattr(lateness, "wall_s", lambda: next(clock))
    meter = LatenessMeter()
    results = (meter.record(round(k * INTERVAL_S * 1e6)) for k in range(len(delays_s)))
    return [result for result in results if result]


@pytest.mark.parametrize("drift", [0.0, 5e-5])
def test_lateness_percentiles_and_overruns(monkeypatch: pytest.MonkeyPatch, drift: float) -> None:
    count = round(WINDOW_S / INTERVAL_S) + 20
    rng = random.Random(1)
    delays_s = [0.001 + 0.002 * rng.random() for _ in range(count)]
    for k in (50, 100, 150):
        delays_s[k] = 0.03
    (result,) = measure(monkeypatch, delays_s, drift=drift)
    drift_ms = 1e3 * drift * WINDOW_S  # the clocks move apart by this within the window
    assert result.p50_ms == pytest.approx(1.0, abs=0.2 + drift_ms)
    assert result.p99_ms == pytest.approx(2.0, abs=0.2 + drift_ms)
    assert result.max_ms == pytest.approx(29.0, abs=0.2 + drift_ms)
    assert (result.overruns, result.new_overruns) == (3, 3)
    assert result.interval_ms == pytest.approx(20.0)


@pytest.mark.parametrize("speed", [0.5, 0.9, 20.0])
def test_other_speed_has_no_lateness(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    assert measure(monkeypatch, [0.0] * round(2.5 * speed * WINDOW_S / INTERVAL_S), speed) == []


def test_a_fast_simulation_takes_no_more_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lateness, "wall_s", lambda: 0.0)
    meter = LatenessMeter()
    times_us = range(0, 2_000_000_000, 20_000)  # 100,000 samples in no time
    tracemalloc.start()
    for time_us in times_us:
        meter.record(time_us)
    largest_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest_bytes < 200_000


def test_overruns_add_up_over_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    delays_s = [0.0] * round(2.2 * WINDOW_S / INTERVAL_S)
    delays_s[100] = delays_s[800] = 0.05
    assert [r.overruns for r in measure(monkeypatch, delays_s)] == [1, 2]


def test_lateness_is_sent_and_overruns_are_reported() -> None:
    harness = Harness()
    harness.tick(3)
    harness.station.pop_received()
    harness.server.publish_lateness(Lateness(0.5, 3.0, 31.0, 7, 2, 20.0))
    harness.tick()
    received = harness.station.pop_received()
    values = {m.name: m.value for m in received if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert values == {"LATE_P50": 0.5, "LATE_P99": 3.0, "LATE_MAX": 31.0, "LATE_OVR": 7.0}
    assert texts(received) == ["2 ticks late by more than 20 ms; p99 3, at most 31 ms"]
