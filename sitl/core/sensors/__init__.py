"""The sensors: sampled at their own rates from the true motion, with errors, latency and dropouts.

All are sampled in the compiled tick (``core.tick``): IMU, magnetometer and pressure sensor, and the
slower ones with messages of their own (``devices``).

Each sensor has its own random stream, so that a change of one sensor does not alter the errors of
the others; a sensor that is not fitted draws nothing. The error parameters are in
``datasheets.toml``. The table [instruments] of a vehicle file names the sensors that are fitted.
"""

from __future__ import annotations

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
from sitl.core.sensors.devices import SimulatedDevices
from sitl.core.sensors.sample_timing import NOT_FITTED
from sitl.vehicle.config import VehicleConfig

_NO_DEVICES = (None,) * 6


class SensorSuite(NamedTuple):
    """Parameters of the sensors; ``timing.period_us`` is 0 for one that is not fitted."""

    imu: inertial.Imu
    magnetometer: magnetic.Magnetometer
    pressure: pressure.PressureSensor
    devices: SimulatedDevices


class Sensors(NamedTuple):
    """Sensor output of one tick; None for a sensor without a new reading."""

    frame: SensorFrame
    """Latest IMU, magnetometer and pressure readings; ``fields_updated`` marks the new ones."""
    gps: GpsFix | None = None
    altimeter: Altimeter | None = None
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
    catalogue, fitted = datasheets.catalogue(), vehicle.instruments
    name = f"vehicle {vehicle.name}"
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
    devices = SimulatedDevices(
        gps=gps.build(receiver, tick_us) if receiver else gps.GpsReceiver(),
        dvl=dvl.build(log, tick_us) if log else dvl.DvlSensor(),
        altimeter=altimeter.build(sounder, tick_us) if sounder else altimeter.AltimeterSensor(),
        battery=battery.build(pack, vehicle, full_rps, tick_us) if pack else battery.BatteryPack(),
        leak=leak.build(detector, tick_us) if detector else NOT_FITTED,
        encoder=encoder.build(encoders, vehicle.tailcone.travel_deg, tick_us)
        if encoders
        else encoder.Encoders(),
    )
    return SensorSuite(
        imu=inertial.build(imu, tick_us) if imu else inertial.Imu(),
        magnetometer=magnetic.build(compass, tick_us) if compass else magnetic.Magnetometer(),
        pressure=pressure.build(depth, tick_us) if depth else pressure.PressureSensor(),
        devices=devices,
    )
