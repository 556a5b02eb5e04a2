"""The sensors: sampled at their own rates from the true motion, with errors, latency and dropouts.

IMU, magnetometer and pressure sensor are sampled in the compiled tick (``core.tick``); the slower
ones, with messages of their own, here.

Each sensor has its own random stream, so that a change of one sensor does not alter the errors of
the others; a sensor that is not fitted draws nothing. The error parameters are in
``datasheets.toml``. The table [instruments] of a vehicle file names the sensors that are fitted.
"""

from __future__ import annotations

from math import gcd
from typing import NamedTuple

from msgspec.structs import replace

from mavlink_io.records import (
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
from sitl.core.sensors.sample_timing import Timing, is_idle
from sitl.core.truth import Truth
from sitl.vehicle.config import VehicleConfig

DAY_US = 86_400_000_000
_NO_DEVICES = (None,) * 6


class SensorSuite(NamedTuple):
    """Parameters of the sensors; ``timing.period_us`` is 0 for one that is not fitted."""

    imu: inertial.Imu
    magnetometer: magnetic.Magnetometer
    pressure: pressure.PressureSensor
    devices: Devices
    devices_us: int
    """Common period: devices sample and deliver only at multiples of this vehicle time."""


class Devices(NamedTuple):
    """Parameters of the slower sensors, which have messages of their own; None if not fitted."""

    gps: gps.GpsReceiver | None
    dvl: dvl.DvlSensor | None
    altimeter: altimeter.AltimeterSensor | None
    battery: battery.BatteryPack | None
    leak: Timing | None
    encoder: encoder.Encoders | None


class SensorStreams(NamedTuple):
    """Random stream of each of the slower sensors."""

    gps: NoiseStream
    dvl: NoiseStream
    altimeter: NoiseStream
    battery: NoiseStream
    leak: NoiseStream
    encoder: NoiseStream


class DeviceState(NamedTuple):
    """States of the slower sensors."""

    gps: gps.GpsState
    dvl: dvl.DvlState
    altimeter: altimeter.AltimeterState
    battery: battery.BatteryState
    leak: leak.LeakState
    encoder: encoder.EncoderState


class Sensors(NamedTuple):
    """Sensor output of one tick; None for a sensor without a new reading."""

    frame: SensorFrame
    """Latest IMU, magnetometer and pressure readings; ``fields_updated`` marks the new ones."""
    gps: GpsFix | None
    altimeter: Altimeter | None
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None

    @property
    def has_devices(self) -> bool:
        """Whether any of the slower sensors has a new reading."""
        return self[1:] != _NO_DEVICES


def build(
    vehicle: VehicleConfig, full_rps: float, tick_us: int, *, imu_every_tick: bool = False
) -> SensorSuite:
    """Build the fitted sensors of a vehicle.

    Parameters
    ----------
    vehicle : VehicleConfig
        Content of a vehicle file.
    full_rps : float
        Shaft speed at full thrust, rev/s.
    tick_us : int
        Length of a tick.
    imu_every_tick : bool
        Sample the IMU in every tick. Its catalogue rate is that of Caribou's autopilot; other
        autopilots need a higher one.

    Raises
    ------
    VehicleFileError
        The vehicle names an unknown sensor.
    """
    catalogue, fitted, name = datasheets.catalogue(), vehicle.instruments, vehicle.name
    imu = datasheets.find("imu", catalogue.imu, fitted, name)
    compass = datasheets.find("magnetometer", catalogue.magnetometer, fitted, name)
    depth = datasheets.find("pressure", catalogue.pressure, fitted, name)
    receiver = datasheets.find("gps", catalogue.gps, fitted, name)
    log = datasheets.find("dvl", catalogue.dvl, fitted, name)
    sounder = datasheets.find("altimeter", catalogue.altimeter, fitted, name)
    pack = datasheets.find("battery", catalogue.battery, fitted, name)
    detector = datasheets.find("leak", catalogue.leak, fitted, name)
    encoders = datasheets.find("encoder", catalogue.encoder, fitted, name)
    if imu and imu_every_tick:
        imu = replace(imu, rate_hz=1e6 / tick_us)
    devices = Devices(
        gps=gps.build(receiver, tick_us) if receiver else None,
        dvl=dvl.build(log, tick_us) if log else None,
        altimeter=altimeter.build(sounder, tick_us) if sounder else None,
        battery=battery.build(pack, vehicle, full_rps, tick_us) if pack else None,
        leak=leak.build(detector, tick_us) if detector else None,
        encoder=encoder.build(encoders, vehicle.tailcone.travel_deg, tick_us) if encoders else None,
    )
    return SensorSuite(
        imu=inertial.build(imu, tick_us) if imu else inertial.Imu(),
        magnetometer=magnetic.build(compass, tick_us) if compass else magnetic.Magnetometer(),
        pressure=pressure.build(depth, tick_us) if depth else pressure.PressureSensor(),
        devices=devices,
        devices_us=_common_us(devices),
    )


def _common_us(devices: Devices) -> int:
    """Return the greatest common divisor of all periods and latencies; a day without devices."""
    timings = [
        device if isinstance(device, Timing) else device.timing for device in devices if device
    ]
    return (
        gcd(*(time_us for item in timings for time_us in (item.period_us, item.latency_us)))
        or DAY_US
    )


def initial_devices(devices: Devices, charge: float, streams: SensorStreams) -> DeviceState:
    """Draw the errors of this run of the slower sensors; return their states at the start.

    ``charge`` is the initial charge of the battery as a fraction of its capacity.
    """
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


def sample_devices(
    fitted: Devices,
    truth: Truth,
    sea: Environment,
    state: DeviceState,
    streams: SensorStreams,
    frame: SensorFrame,
) -> tuple[DeviceState, Sensors]:
    """Sample the slower sensors that are due in this tick.

    Parameters
    ----------
    fitted : Devices
        Parameters of the sensors.
    truth : Truth
        True state of the vehicle.
    sea : Environment
        The environment.
    state : DeviceState
        States of the sensors.
    streams : SensorStreams
        Random streams; they advance.
    frame : SensorFrame
        Readings of the other sensors.
    """
    receiver, log, sounder, pack, bilge, duct = state
    fix = velocity = echo = charge = wet = angles = None
    now_us = truth.time_us
    if fitted.gps and not is_idle(fitted.gps.timing, receiver.queue, now_us):
        receiver, fix = gps.sample(fitted.gps, truth, sea, receiver, streams.gps)
    if fitted.dvl and not is_idle(fitted.dvl.timing, log.queue, now_us):
        log, velocity = dvl.sample(fitted.dvl, truth, sea, log, streams.dvl)
    if fitted.altimeter and not is_idle(fitted.altimeter.timing, sounder, now_us):
        sounder, echo = altimeter.sample(fitted.altimeter, truth, sea, sounder, streams.altimeter)
    if fitted.battery and not is_idle(fitted.battery.timing, pack.queue, now_us):
        pack, charge = battery.sample(fitted.battery, truth, pack, streams.battery)
    if fitted.leak and not is_idle(fitted.leak, bilge, now_us):
        bilge, wet = leak.sample(fitted.leak, truth, bilge, streams.leak)
    if fitted.encoder and not is_idle(fitted.encoder.timing, duct.queue, now_us):
        duct, angles = encoder.sample(fitted.encoder, truth, duct, streams.encoder)
    sensors = Sensors(
        frame=frame, gps=fix, altimeter=echo, dvl=velocity, battery=charge, leak=wet, duct=angles
    )
    return DeviceState(receiver, log, sounder, pack, bilge, duct), sensors
