"""The instruments: what the vehicle's devices tell of the true motion, each at its own rate, late, or not at all.

One random stream each, so that one more reading of one instrument leaves the others as they were; an instrument that is
not carried draws nothing. The figures are those of ``datasheets.toml``; which of them a vehicle carries stands in her
file, table [instruments].
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.random import Generator

from link.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
    Altimeter,
    Battery,
    DuctFeedback,
    Dvl,
    GpsFix,
    Leak,
    SensorFrame,
)
from sitl.environment import Environment
from sitl.sensors import altimeter, battery, datasheets, dvl, encoder, gps, inertial, leak, magnetic, pressure
from sitl.sensors.timing import Timing
from sitl.truth import Truth
from sitl.vehicle.config import VehicleConfig


class Suite(NamedTuple):
    """The instruments that are carried; None for each that is not."""

    imu: inertial.Imu | None
    magnetometer: magnetic.Magnetometer | None
    pressure: pressure.PressureSensor | None
    gps: gps.Receiver | None
    dvl: dvl.Log | None
    altimeter: altimeter.Sounder | None
    battery: battery.Pack | None
    leak: Timing | None
    encoder: encoder.Encoders | None


class SensorStreams(NamedTuple):
    """One random stream for each instrument."""

    imu: Generator
    magnetometer: Generator
    pressure: Generator
    gps: Generator
    dvl: Generator
    altimeter: Generator
    battery: Generator
    leak: Generator
    encoder: Generator


class Memory(NamedTuple):
    """What the instruments carry from tick to tick: this run's errors, the newest readings, those on their way."""

    imu: inertial.Memory
    magnetometer: magnetic.Memory
    pressure: pressure.Memory
    gps: gps.Memory
    dvl: dvl.Memory
    altimeter: altimeter.Memory
    battery: battery.Memory
    leak: leak.Memory
    encoder: encoder.Memory


class Sensors(NamedTuple):
    """Everything that arrives from the instruments in one tick; None from those that say nothing in it."""

    frame: SensorFrame
    """Its ``fields_updated`` tells which of its groups are new."""
    gps: GpsFix | None
    altimeter: Altimeter | None
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None


def build(vehicle: VehicleConfig, full_rps: float, tick_us: int) -> Suite:
    """What the vehicle carries; ``full_rps`` is the shaft's speed at full thrust. Raises VehicleError."""
    shelf, carried, name = datasheets.catalogue(), vehicle.instruments, vehicle.name
    imu = datasheets.find("imu", shelf.imu, carried, name)
    compass = datasheets.find("magnetometer", shelf.magnetometer, carried, name)
    depth = datasheets.find("pressure", shelf.pressure, carried, name)
    receiver = datasheets.find("gps", shelf.gps, carried, name)
    log = datasheets.find("dvl", shelf.dvl, carried, name)
    sounder = datasheets.find("altimeter", shelf.altimeter, carried, name)
    pack = datasheets.find("battery", shelf.battery, carried, name)
    detector = datasheets.find("leak", shelf.leak, carried, name)
    encoders = datasheets.find("encoder", shelf.encoder, carried, name)
    return Suite(
        inertial.build(imu, tick_us) if imu else None,
        magnetic.build(compass, tick_us) if compass else None,
        pressure.build(depth, tick_us) if depth else None,
        gps.build(receiver, tick_us) if receiver else None,
        dvl.build(log, tick_us) if log else None,
        altimeter.build(sounder, tick_us) if sounder else None,
        battery.build(pack, vehicle, full_rps, tick_us) if pack else None,
        leak.build(detector, tick_us) if detector else None,
        encoder.build(encoders, vehicle.tailcone.travel_deg, tick_us) if encoders else None,
    )


def switch_on(suite: Suite, charge: float, streams: SensorStreams) -> Memory:
    """The instruments before their first reading, with this run's errors; ``charge`` is what fills the battery."""
    return Memory(
        inertial.switch_on(suite.imu, streams.imu) if suite.imu else inertial.Memory(),
        magnetic.switch_on(suite.magnetometer, streams.magnetometer) if suite.magnetometer else magnetic.Memory(),
        pressure.switch_on(suite.pressure, streams.pressure) if suite.pressure else pressure.Memory(),
        gps.Memory(),
        dvl.switch_on(suite.dvl, streams.dvl) if suite.dvl else dvl.Memory(),
        (),
        battery.switch_on(suite.battery, charge, streams.battery) if suite.battery else battery.Memory(),
        (),
        encoder.switch_on(suite.encoder, streams.encoder) if suite.encoder else encoder.Memory(),
    )


def sample(
    suite: Suite, truth: Truth, sea: Environment, memory: Memory, streams: SensorStreams
) -> tuple[Memory, Sensors]:
    """One tick of every instrument."""
    m, s = memory, streams
    imu, moved = inertial.sample(suite.imu, truth, m.imu, s.imu) if suite.imu else (m.imu, False)
    field, turned = (
        magnetic.sample(suite.magnetometer, truth, sea, m.magnetometer, s.magnetometer)
        if suite.magnetometer
        else (m.magnetometer, False)
    )
    water, dived = (
        pressure.sample(suite.pressure, truth, sea, m.pressure, s.pressure) if suite.pressure else (m.pressure, False)
    )
    receiver, fix = gps.sample(suite.gps, truth, sea, m.gps, s.gps) if suite.gps else (m.gps, None)
    log, velocity = dvl.sample(suite.dvl, truth, sea, m.dvl, s.dvl) if suite.dvl else (m.dvl, None)
    sounder, echo = (
        altimeter.sample(suite.altimeter, truth, sea, m.altimeter, s.altimeter)
        if suite.altimeter
        else (m.altimeter, None)
    )
    pack, charge = battery.sample(suite.battery, truth, m.battery, s.battery) if suite.battery else (m.battery, None)
    bilge, wet = leak.sample(suite.leak, truth, m.leak, s.leak) if suite.leak else (m.leak, None)
    duct, angles = encoder.sample(suite.encoder, truth, m.encoder, s.encoder) if suite.encoder else (m.encoder, None)
    frame = _frame(truth.time_us, imu.held, field.held, water.held, _fresh(moved, turned, dived))
    return (
        Memory(imu, field, water, receiver, log, sounder, pack, bilge, duct),
        Sensors(frame, fix, echo, velocity, charge, wet, angles),
    )


def _frame(
    time_us: int, motion: inertial.Motion, field_gauss: tuple[float, float, float], water: pressure.Water, fresh: int
) -> SensorFrame:
    return SensorFrame(
        time_us, *motion.specific_force_mps2, *motion.rates_radps, *field_gauss,
        water.pressure_hpa, 0.0, water.altitude_m, water.temperature_degc, fresh, 0,
    )  # fmt: skip


def _fresh(moved: bool, turned: bool, dived: bool) -> int:
    """HIL_SENSOR.fields_updated."""
    inertial_bits = ACCELEROMETER_FRESH | GYRO_FRESH if moved else 0
    return inertial_bits | (MAGNETOMETER_FRESH if turned else 0) | (PRESSURE_FRESH if dived else 0)
