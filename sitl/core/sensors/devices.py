"""The slower sensors, which have messages of their own, in compiled code.

Their states, latest readings and readings in transit are one array, a part of ``core.state``.
"""

from __future__ import annotations

from math import gcd
from typing import Any, NamedTuple

from numpy.random import Generator

from mavlink_io import device_records
from mavlink_io.device_records import (
    ALTIMETER_NEW,
    BATTERY_NEW,
    DUCT_NEW,
    DVL_NEW,
    GPS_NEW,
    LEAK_NEW,
    LENGTHS,
)
from mavlink_io.jit import Native, entry_point, kernel, native
from sitl.core.environment import Surroundings
from sitl.core.sensors import altimeter, battery, dvl, encoder, gps, leak
from sitl.core.sensors.noise import NoiseStream, noise_stream
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, slots
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.vectors import Vector

DAY_US = 86_400_000_000


class SimulatedDevices(NamedTuple):
    """Parameters of the slower sensors; ``timing.period_us`` is 0 for one that is not fitted."""

    gps: gps.GpsReceiver = gps.GpsReceiver()
    dvl: dvl.DvlSensor = dvl.DvlSensor()
    altimeter: altimeter.AltimeterSensor = altimeter.AltimeterSensor()
    battery: battery.BatteryPack = battery.BatteryPack()
    leak: Timing = NOT_FITTED
    encoder: encoder.Encoders = encoder.Encoders()

    @property
    def timings(self) -> tuple[Timing, ...]:
        """Timing of each sensor, in the order of ``device_records.KINDS``."""
        own = self.gps, self.altimeter, self.dvl, self.battery
        return *(device.timing for device in own), self.leak, self.encoder.timing

    @property
    def common_us(self) -> int:
        """Common period: vehicle times at which a sensor samples or delivers are multiples of it.

        A day if no sensor is fitted.
        """
        times = (time for item in self.timings for time in (item.period_us, item.latency_us))
        return gcd(*times) or DAY_US


class DeviceStreams(NamedTuple):
    """Random stream of each of the slower sensors."""

    gps: NoiseStream
    dvl: NoiseStream
    altimeter: NoiseStream
    battery: NoiseStream
    leak: NoiseStream
    encoder: NoiseStream


class DeviceSlots(NamedTuple):
    """Number of readings in transit of each sensor, in the order of ``device_records.KINDS``."""

    gps: int
    altimeter: int
    dvl: int
    battery: int
    leak: int
    duct: int


class DeviceParts(NamedTuple):
    """Views of the parts of the array."""

    gps: Vector
    dvl: Vector
    battery: Vector
    encoder: Vector
    """States of the sensors, see their modules."""
    latest: Vector
    """Latest readings, see `LATEST`."""
    transit: Vector
    """Readings in transit."""


_STATES = gps.STATE + dvl.STATE + battery.STATE + encoder.STATE
_DVL, _BATTERY = gps.STATE, gps.STATE + dvl.STATE
_ENCODER = _BATTERY + battery.STATE
LATEST = tuple(sum(LENGTHS[:kind]) for kind in range(len(LENGTHS)))
"""Index of the latest reading of each of ``device_records.KINDS`` in ``DeviceParts.latest``."""
_TRANSIT = _STATES + sum(LENGTHS)
_AT_GPS, _AT_ALTIMETER, _AT_DVL, _AT_BATTERY, _AT_LEAK, _AT_DUCT = LATEST
_GPS, _ALTIMETER, _VELOCITY, _GAUGE, _LEAK, _DUCT = LENGTHS


def streams(generators: list[Generator]) -> Native:
    """Return the random streams of generators, in the order of ``DeviceStreams``."""
    return native(DeviceStreams(*map(noise_stream, generators)))


def device_slots(fitted: SimulatedDevices) -> DeviceSlots:
    """Return the sizes of the array that depend on the vehicle."""
    return DeviceSlots(*map(slots, fitted.timings))


def size(layout: DeviceSlots) -> int:
    """Return the length of the array."""
    rows = zip(layout, LENGTHS, strict=True)
    return _TRANSIT + sum(count * length for count, length in rows)


def latest(values: Vector) -> Vector:
    """Return the latest readings in the array, see `LATEST`."""
    return values[_STATES:_TRANSIT]


@kernel
def parts(values: Vector) -> DeviceParts:
    """Return views of the parts of the array."""
    return DeviceParts(
        values[:_DVL],
        values[_DVL:_BATTERY],
        values[_BATTERY:_ENCODER],
        values[_ENCODER:_STATES],
        values[_STATES:_TRANSIT],
        values[_TRANSIT:],
    )


@entry_point
def begin(fitted: SimulatedDevices, drawn: Native, values: Vector) -> None:
    """Draw the errors of a run.

    Parameters
    ----------
    fitted : SimulatedDevices
        Parameters of the sensors.
    drawn : Native
        ``DeviceStreams``; they advance.
    values : ndarray
        The array, with zeros and the charge of the battery.
    """
    part, random = parts(values), drawn.value
    if fitted.dvl.timing.period_us > 0:
        dvl.begin(fitted.dvl, random.dvl, part.dvl)
    if fitted.battery.timing.period_us > 0:
        battery.begin(fitted.battery, random.battery, part.battery)
    if fitted.encoder.timing.period_us > 0:
        encoder.begin(fitted.encoder, random.encoder, part.encoder)


@entry_point
def sample(
    fitted: SimulatedDevices,
    layout: DeviceSlots,
    truth: TrueMotion,
    sea: Surroundings,
    drawn: Native,
    values: Vector,
) -> int:
    """Sample the sensors that are due.

    Parameters
    ----------
    fitted : SimulatedDevices
        Parameters of the sensors.
    layout : DeviceSlots
        Readings in transit of each sensor.
    truth : TrueMotion
        True motion.
    sea : Surroundings
        The environment.
    drawn : Native
        ``DeviceStreams``; they advance.
    values : ndarray
        The array.

    Returns
    -------
    int
        Bits of the sensors with a new reading: ``device_records.GPS_NEW`` and so on.
    """
    part, random, ground = parts(values), drawn.value, sea.field.floor
    newest, transit, new = part.latest, part.transit, 0
    end = layout.gps * _GPS
    rows = transit[:end].reshape((layout.gps, _GPS))
    fix = newest[_AT_GPS:_AT_ALTIMETER]
    if gps.sample(fitted.gps, truth, sea, part.gps, random.gps, rows, fix):
        new |= GPS_NEW
    start, end = end, end + layout.altimeter * _ALTIMETER
    rows = transit[start:end].reshape((layout.altimeter, _ALTIMETER))
    echo = newest[_AT_ALTIMETER:_AT_DVL]
    if altimeter.sample(fitted.altimeter, truth, ground, random.altimeter, rows, echo):
        new |= ALTIMETER_NEW
    start, end = end, end + layout.dvl * _VELOCITY
    rows = transit[start:end].reshape((layout.dvl, _VELOCITY))
    velocity = newest[_AT_DVL:_AT_BATTERY]
    if dvl.sample(fitted.dvl, truth, ground, part.dvl, random.dvl, rows, velocity):
        new |= DVL_NEW
    start, end = end, end + layout.battery * _GAUGE
    rows = transit[start:end].reshape((layout.battery, _GAUGE))
    charge = newest[_AT_BATTERY:_AT_LEAK]
    if battery.sample(fitted.battery, truth, part.battery, random.battery, rows, charge):
        new |= BATTERY_NEW
    start, end = end, end + layout.leak * _LEAK
    rows = transit[start:end].reshape((layout.leak, _LEAK))
    if leak.sample(fitted.leak, truth, random.leak, rows, newest[_AT_LEAK:_AT_DUCT]):
        new |= LEAK_NEW
    start, end = end, end + layout.duct * _DUCT
    rows = transit[start:end].reshape((layout.duct, _DUCT))
    if encoder.sample(fitted.encoder, truth, part.encoder, random.encoder, rows, newest[_AT_DUCT:]):
        new |= DUCT_NEW
    return new


def records(new: int, numbers: list[float]) -> list[Any]:
    """Return the records of the bits ``new`` in the order of ``device_records.KINDS``, else None.

    ``numbers`` are the latest readings.
    """
    return [
        read(numbers[start:]) if new >> kind & 1 else None
        for kind, (read, start) in enumerate(zip(device_records.READERS, LATEST, strict=True))
    ]
