"""Each kind of sensor fault, applied to known readings: the value n / 1000 at tick n."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from mavlink_io.records import (
    SENSORS_ALL,
    Altimeter,
    Battery,
    DuctFeedback,
    Dvl,
    GpsFix,
    SensorFrame,
)
from sitl.core.sensors import Sensors
from sitl.faults import readings
from sitl.faults.catalogue import CATALOGUE, make
from sitl.faults.timeline import Running

TICK_US, TICK_S = 20_000, 0.02
FRESH = {"accelerometer": 0x07, "gyro": 0x38, "magnetometer": 0x1C0, "pressure": 0x1A00}
FIELD = {
    "gyro": "gyro_y_radps",
    "accelerometer": "accel_z_mps2",
    "magnetometer": "mag_x_gauss",
    "pressure": "pressure_hpa",
    "gps": "lat_deg",
    "dvl": "velocity_z_mps",
    "altimeter": "range_m",
    "battery": "voltage_v",
    "encoder": "elevator",
}
RECORD = {
    "gps": "gps",
    "dvl": "dvl",
    "altimeter": "altimeter",
    "battery": "battery",
    "encoder": "duct",
}
INSTRUMENTS = sorted(FIELD)


def output(tick: int) -> Sensors:
    """Return sensor output in which every measured value is a thousandth of the tick."""
    n, t = tick / 1000.0, tick * TICK_US
    return Sensors(
        SensorFrame(t, *(n,) * 10, 0.0, n, n, SENSORS_ALL, 0),
        gps=GpsFix(t, 3, n, n, n, n, n, n, 9),
        altimeter=Altimeter(t, n, 0.3, 30.0),
        dvl=Dvl(t, n, n, n, True, 0.01, 100),
        battery=Battery(n, n, n, n),
        duct=DuctFeedback(t, n, n),
    )


def reading(unit: str, sensors: Sensors) -> float | None:
    """Return the value of a unit, or None if it has no new reading."""
    record: Any = getattr(sensors, RECORD.get(unit, "frame"))
    if record is None or (unit in FRESH and not record.fields_updated & FRESH[unit]):
        return None
    return float(getattr(record, FIELD[unit]))


def faulty_readings(
    unit: str, kind: str, ticks: int = 500, /, **sizes: float
) -> list[float | None]:
    """Return the reading in each tick of a fault that starts at vehicle time zero."""
    running: tuple[Running, ...] = (Running(make(unit, kind, 0, None, sizes)),)
    rng, values = np.random.default_rng(3), []
    for tick in range(ticks):
        sensors, running = readings.apply(output(tick), running, tick * TICK_US, TICK_S, rng)
        values.append(reading(unit, sensors))
    return values


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_off_gives_no_readings(unit: str) -> None:
    assert set(faulty_readings(unit, "off")) == {None}


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_stuck_repeats_first_reading(unit: str) -> None:
    assert set(faulty_readings(unit, "stuck")) == {0.0}


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_wrong_adds_constant_error(unit: str) -> None:
    key = next(size.key for size in CATALOGUE[unit]["wrong"])
    values = np.array(faulty_readings(unit, "wrong", **{key: 2.0}), dtype=float)
    error = values - np.arange(500) / 1000.0
    expected = {"gyro": np.radians(2.0), "encoder": 0.02, "gps": 2.0 / 111_200.0}.get(unit, 2.0)
    assert error == pytest.approx(np.full(500, expected), rel=0.01)


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_drifting_error_grows_with_time(unit: str) -> None:
    key = next(size.key for size in CATALOGUE[unit]["drifting"])
    values = np.array(faulty_readings(unit, "drifting", **{key: 0.3}), dtype=float)
    error, t_s = values - np.arange(500) / 1000.0, np.arange(500) * TICK_S
    rate = {"gyro": np.radians(0.3), "encoder": 0.003, "gps": 0.3 / 111_200.0}.get(unit, 0.3)
    assert error == pytest.approx(rate * t_s, rel=0.01, abs=1e-9)


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_garbage_is_uniform_and_uncorrelated(unit: str) -> None:
    values = np.array(faulty_readings(unit, "garbage"), dtype=float)
    low, high = readings.INSTRUMENTS[unit].ranges[FIELD[unit]]
    assert ((low <= values) & (values <= high)).all()
    assert values.std() == pytest.approx((high - low) / 12**0.5, rel=0.1)
    assert abs(np.corrcoef(values, np.arange(500))[0, 1]) < 0.15


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_slow_gives_one_reading_per_period(unit: str) -> None:
    values = faulty_readings(unit, "slow", period_s=2.0)
    assert [n for n, value in enumerate(values) if value is not None] == [0, 100, 200, 300, 400]
    assert values[200] == 0.2


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_delayed_gives_old_readings(unit: str) -> None:
    values = faulty_readings(unit, "delayed", delay_s=0.5)
    assert values[:25] == [None] * 25
    assert values[25:] == [n / 1000.0 for n in range(475)]


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_intermittent_has_share_and_mean_outage(unit: str) -> None:
    values = np.array(
        [value is None for value in faulty_readings(unit, "intermittent", 60_000, share=0.3)]
    )
    outages = sum(not before and after for before, after in pairwise(values.tolist()))
    assert values.mean() == pytest.approx(0.3, abs=0.05)
    assert values.sum() * TICK_S / outages == pytest.approx(1.0, rel=0.2)


@pytest.mark.parametrize("unit", sorted(FRESH))
def test_fault_affects_one_group_of_sample_only(unit: str) -> None:
    running: tuple[Running, ...] = (Running(make(unit, "off", 0, None, {})),)
    sensors, _ = readings.apply(output(7), running, 0, TICK_S, np.random.default_rng(1))
    assert [name for name in FRESH if reading(name, sensors) is None] == [unit]
    assert sensors.gps == output(7).gps
