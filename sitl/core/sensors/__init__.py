"""The instruments: what the vehicle's devices tell of the true motion, each at its own rate, late,
or not at all.

One random stream each, so that one more reading of one instrument leaves the others as they were;
an instrument that is not carried draws nothing. The figures are those of ``datasheets.toml``; which
of them a vehicle carries stands in her file, table [instruments]."""

from __future__ import annotations

from math import gcd
from typing import NamedTuple

from msgspec.structs import replace

from mavlink_io.records import (
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
from sitl.core.environment import Environment
from sitl.core.sensors import (
    altimeter,
    battery,
    datasheets,
    dvl,
    encoder,
    gps,
    inertial,
    leak,
    magnetic,
    pressure,
)
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Timing
from sitl.core.truth import Truth
from sitl.vehicle.config import VehicleConfig

DAY_US = 86_400_000_000


class SensorSuite(NamedTuple):
    """The instruments that are carried; None for each that is not."""

    imu: inertial.Imu | None
    magnetometer: magnetic.Magnetometer | None
    pressure: pressure.PressureSensor | None
    devices: Devices
    devices_us: int
    """Devices take and deliver their readings at multiples of this time only."""


class Devices(NamedTuple):
    """The slower instruments, which speak in messages of their own."""

    gps: gps.Receiver | None
    dvl: dvl.DvlSensor | None
    altimeter: altimeter.AltimeterSensor | None
    battery: battery.BatteryPack | None
    leak: Timing | None
    encoder: encoder.Encoders | None


class SensorStreams(NamedTuple):
    """One random stream for each instrument."""

    imu: NoiseStream
    magnetometer: NoiseStream
    pressure: NoiseStream
    gps: NoiseStream
    dvl: NoiseStream
    altimeter: NoiseStream
    battery: NoiseStream
    leak: NoiseStream
    encoder: NoiseStream


class DeviceState(NamedTuple):
    gps: gps.GpsState
    dvl: dvl.DvlState
    altimeter: altimeter.AltimeterState
    battery: battery.BatteryState
    leak: leak.LeakState
    encoder: encoder.EncoderState


class SensorSuiteState(NamedTuple):
    """What the instruments carry from tick to tick: this run's errors, the newest readings, those
    on their way."""

    imu: inertial.InertialState
    magnetometer: magnetic.MagnetometerState
    pressure: pressure.PressureState
    devices: DeviceState


class Sensors(NamedTuple):
    """Everything that arrives from the instruments in one tick; None from those that say nothing in
    it."""

    frame: SensorFrame
    """Its ``fields_updated`` tells which of its groups are new."""
    gps: GpsFix | None
    altimeter: Altimeter | None
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None


def build(
    vehicle: VehicleConfig, full_rps: float, tick_us: int, *, brisk: bool = False
) -> SensorSuite:
    """What the vehicle carries; ``full_rps`` is the shaft's speed at full thrust. Raises
    VehicleError.

    With ``brisk`` the IMU speaks every tick: its data sheet's rate is set by our own autopilot,
    others want more."""
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
    devices = Devices(
        gps.build(receiver, tick_us) if receiver else None,
        dvl.build(log, tick_us) if log else None,
        altimeter.build(sounder, tick_us) if sounder else None,
        battery.build(pack, vehicle, full_rps, tick_us) if pack else None,
        leak.build(detector, tick_us) if detector else None,
        encoder.build(encoders, vehicle.tailcone.travel_deg, tick_us) if encoders else None,
    )
    return SensorSuite(
        inertial.build(replace(imu, rate_hz=1e6 / tick_us) if brisk else imu, tick_us)
        if imu
        else None,
        magnetic.build(compass, tick_us) if compass else None,
        pressure.build(depth, tick_us) if depth else None,
        devices,
        _common_us(devices),
    )


def _common_us(devices: Devices) -> int:
    """The longest time of which every device's period and latency is a multiple; a day where there
    is no device."""
    timings = [
        device if isinstance(device, Timing) else device.timing for device in devices if device
    ]
    return (
        gcd(*(time_us for when in timings for time_us in (when.period_us, when.latency_us)))
        or DAY_US
    )


def initial_state(suite: SensorSuite, charge: float, streams: SensorStreams) -> SensorSuiteState:
    """The instruments before their first reading, with this run's errors; ``charge`` is what fills
    the battery."""
    return SensorSuiteState(
        inertial.initial_state(suite.imu, streams.imu) if suite.imu else inertial.InertialState(),
        magnetic.initial_state(suite.magnetometer, streams.magnetometer)
        if suite.magnetometer
        else magnetic.MagnetometerState(),
        pressure.initial_state(suite.pressure, streams.pressure)
        if suite.pressure
        else pressure.PressureState(),
        _initial_device_state(suite.devices, charge, streams),
    )


def _initial_device_state(devices: Devices, charge: float, streams: SensorStreams) -> DeviceState:
    return DeviceState(
        gps.GpsState(),
        dvl.initial_state(devices.dvl, streams.dvl) if devices.dvl else dvl.DvlState(),
        (),
        battery.initial_state(devices.battery, charge, streams.battery)
        if devices.battery
        else battery.BatteryState(),
        (),
        encoder.initial_state(devices.encoder, streams.encoder)
        if devices.encoder
        else encoder.EncoderState(),
    )


def sample(
    suite: SensorSuite,
    truth: Truth,
    sea: Environment,
    memory: SensorSuiteState,
    streams: SensorStreams,
) -> tuple[SensorSuiteState, Sensors]:
    """One tick of every instrument."""
    imu, compass, depth, devices = memory
    moved = turned = dived = False
    if suite.imu:
        imu, moved = inertial.sample(suite.imu, truth, imu, streams.imu)
    if suite.magnetometer:
        compass, turned = magnetic.sample(
            suite.magnetometer, truth, sea, compass, streams.magnetometer
        )
    if suite.pressure:
        depth, dived = pressure.sample(suite.pressure, truth, sea, depth, streams.pressure)
    frame = _frame(
        truth.time_us, imu.held, compass.held, depth.held, _fields_updated(moved, turned, dived)
    )
    if truth.time_us % suite.devices_us:
        return SensorSuiteState(imu, compass, depth, devices), Sensors(frame, None, None)
    devices, sensors = _sample_devices(suite.devices, truth, sea, devices, streams, frame)
    return SensorSuiteState(imu, compass, depth, devices), sensors


def _sample_devices(
    carried: Devices,
    truth: Truth,
    sea: Environment,
    memory: DeviceState,
    streams: SensorStreams,
    frame: SensorFrame,
) -> tuple[DeviceState, Sensors]:
    """What the devices say beside the ``frame`` of the same tick."""
    receiver, log, sounder, pack, bilge, duct = memory
    fix = velocity = echo = charge = wet = angles = None
    if carried.gps:
        receiver, fix = gps.sample(carried.gps, truth, sea, receiver, streams.gps)
    if carried.dvl:
        log, velocity = dvl.sample(carried.dvl, truth, sea, log, streams.dvl)
    if carried.altimeter:
        sounder, echo = altimeter.sample(carried.altimeter, truth, sea, sounder, streams.altimeter)
    if carried.battery:
        pack, charge = battery.sample(carried.battery, truth, pack, streams.battery)
    if carried.leak:
        bilge, wet = leak.sample(carried.leak, truth, bilge, streams.leak)
    if carried.encoder:
        duct, angles = encoder.sample(carried.encoder, truth, duct, streams.encoder)
    sensors = Sensors(frame, fix, echo, velocity, charge, wet, angles)
    return DeviceState(receiver, log, sounder, pack, bilge, duct), sensors


def _frame(
    time_us: int,
    motion: inertial.InertialReading,
    field_gauss: tuple[float, float, float],
    water: pressure.PressureReading,
    fresh: int,
) -> SensorFrame:
    return SensorFrame(
        time_us,
        *motion.specific_force_mps2,
        *motion.rates_radps,
        *field_gauss,
        water.pressure_hpa,
        0.0,
        water.altitude_m,
        water.temperature_degc,
        fresh,
        0,
    )


def _fields_updated(moved: bool, turned: bool, dived: bool) -> int:
    """HIL_SENSOR.fields_updated."""
    inertial_bits = ACCELEROMETER_FRESH | GYRO_FRESH if moved else 0
    return inertial_bits | (MAGNETOMETER_FRESH if turned else 0) | (PRESSURE_FRESH if dived else 0)
