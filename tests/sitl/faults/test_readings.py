"""Every way in which an instrument fails, on readings that are known: value n at tick n."""

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


def spoken(tick: int) -> Sensors:
    """Everything that is measured reads a thousandth of the tick."""
    n, t = tick / 1000.0, tick * TICK_US
    return Sensors(
        SensorFrame(t, *(n,) * 10, 0.0, n, n, SENSORS_ALL, 0),
        gps=GpsFix(t, 3, n, n, n, n, n, n, 9),
        altimeter=Altimeter(t, n, 0.3, 30.0),
        dvl=Dvl(t, n, n, n, True, 0.01, 100),
        battery=Battery(n, n, n, n),
        duct=DuctFeedback(t, n, n),
    )


def heard(unit: str, sensors: Sensors) -> float | None:
    record: Any = getattr(sensors, RECORD.get(unit, "frame"))
    if record is None or (unit in FRESH and not record.fields_updated & FRESH[unit]):
        return None
    return float(getattr(record, FIELD[unit]))


def listen(unit: str, kind: str, ticks: int = 500, **sizes: float) -> list[float | None]:
    """What is heard in each tick of a fault that begins at vehicle time zero."""
    running: tuple[Running, ...] = (Running(make(unit, kind, 0, None, sizes)),)
    chance, told = np.random.default_rng(3), []
    for tick in range(ticks):
        sensors, running = readings.apply(spoken(tick), running, tick * TICK_US, TICK_S, chance)
        told.append(heard(unit, sensors))
    return told


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_off_is_silent(unit: str) -> None:
    assert set(listen(unit, "off")) == {None}


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_stuck_says_the_same_for_ever(unit: str) -> None:
    assert set(listen(unit, "stuck")) == {0.0}


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_wrong_is_off_by_as_much_all_the_time(unit: str) -> None:
    key = next(size.key for size in CATALOGUE[unit]["wrong"])
    told = np.array(listen(unit, "wrong", **{key: 2.0}), dtype=float)
    error = told - np.arange(500) / 1000.0
    expected = {"gyro": np.radians(2.0), "encoder": 0.02, "gps": 2.0 / 111_200.0}.get(unit, 2.0)
    assert error == pytest.approx(np.full(500, expected), rel=0.01)


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_drifting_grows_with_time(unit: str) -> None:
    key = next(size.key for size in CATALOGUE[unit]["drifting"])
    told = np.array(listen(unit, "drifting", **{key: 0.3}), dtype=float)
    error, t_s = told - np.arange(500) / 1000.0, np.arange(500) * TICK_S
    rate = {"gyro": np.radians(0.3), "encoder": 0.003, "gps": 0.3 / 111_200.0}.get(unit, 0.3)
    assert error == pytest.approx(rate * t_s, rel=0.01, abs=1e-9)


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_garbage_has_nothing_to_do_with_the_truth(unit: str) -> None:
    told = np.array(listen(unit, "garbage"), dtype=float)
    low, high = readings.INSTRUMENTS[unit].ranges[FIELD[unit]]
    assert ((low <= told) & (told <= high)).all()
    assert told.std() == pytest.approx((high - low) / 12**0.5, rel=0.1)
    assert abs(np.corrcoef(told, np.arange(500))[0, 1]) < 0.15


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_slow_speaks_once_a_period(unit: str) -> None:
    told = listen(unit, "slow", period_s=2.0)
    assert [n for n, value in enumerate(told) if value is not None] == [0, 100, 200, 300, 400]
    assert told[200] == 0.2


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_delayed_tells_what_was(unit: str) -> None:
    told = listen(unit, "delayed", delay_s=0.5)
    assert told[:25] == [None] * 25
    assert told[25:] == [n / 1000.0 for n in range(475)]


@pytest.mark.parametrize("unit", INSTRUMENTS)
def test_intermittent_is_silent_for_its_share_and_a_second_at_once(unit: str) -> None:
    told = np.array(
        [value is None for value in listen(unit, "intermittent", ticks=60_000, share=0.3)]
    )
    outages = sum(not before and after for before, after in pairwise(told.tolist()))
    assert told.mean() == pytest.approx(0.3, abs=0.05)
    assert told.sum() * TICK_S / outages == pytest.approx(1.0, rel=0.2)


@pytest.mark.parametrize("unit", sorted(FRESH))
def test_one_group_of_the_sample_fails_alone(unit: str) -> None:
    running: tuple[Running, ...] = (Running(make(unit, "off", 0, None, {})),)
    sensors, _ = readings.apply(spoken(7), running, 0, TICK_S, np.random.default_rng(1))
    assert [name for name in FRESH if heard(name, sensors) is None] == [unit]
    assert sensors.gps == spoken(7).gps
