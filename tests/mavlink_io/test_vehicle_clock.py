"""Vehicle time: wraps, impossible single times, restarts."""

import pytest

from mavlink_io.vehicle_clock import WRAP_US, VehicleClock, unwrap_us

DAY_US = 86_400 * 10**6


@pytest.mark.parametrize(
    ("time_us", "latest_us", "unwrapped_us"),
    [
        (20_000, WRAP_US - 10_000, WRAP_US + 20_000),
        (WRAP_US - 10_000, WRAP_US + 20_000, WRAP_US - 10_000),
        (5_000, 3 * WRAP_US - 5_000, 3 * WRAP_US + 5_000),
        (20_000, 40 * DAY_US, 20_000),
    ],
    ids=["wrap", "late sample", "third wrap", "restart"],
)
def test_wraps_count_near_the_latest_time(time_us: int, latest_us: int, unwrapped_us: int) -> None:
    assert unwrap_us(time_us, latest_us) == unwrapped_us


@pytest.mark.parametrize("impossible_us", [0, 4_000_000, WRAP_US - 1000, 10 * DAY_US])
def test_single_impossible_time_is_not_valid(impossible_us: int) -> None:
    clock = VehicleClock()
    readings = [
        clock.read(t) for t in (10_000_000, 10_100_000, impossible_us, 10_200_000, impossible_us)
    ]
    assert [reading.valid for reading in readings] == [True, True, False, True, False]
    assert not any(reading.restarted for reading in readings)


def test_three_times_that_agree_are_a_restart() -> None:
    clock = VehicleClock()
    readings = [clock.read(t) for t in (10_000_000, 100_000, 200_000, 300_000, 400_000)]
    assert [reading.restarted for reading in readings] == [False, False, False, True, False]
    assert [reading.valid for reading in readings] == [True, False, False, True, True]


def test_time_without_telemetry_for_an_hour_is_no_restart() -> None:
    clock = VehicleClock()
    readings = [clock.read(t) for t in (0, 3_600_000_000, 3_600_100_000, 3_600_200_000)]
    assert [reading.valid for reading in readings] == [True, False, False, True]
    assert not readings[-1].restarted
