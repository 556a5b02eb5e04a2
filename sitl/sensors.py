"""The instruments: what an AHRS, a pressure sensor, a GPS receiver and an altimeter tell of the true motion.

Noise figures are those of the class of instrument such a vehicle carries. The inertial and magnetic ones are of a MEMS
AHRS of the better kind (makers publish 0.01 deg/s/rtHz and 10 deg/h for the gyro, 60 ug/rtHz for the accelerometer,
0.2 mG/rtHz for the magnetometer). White noise of one-sided density N, sampled at rate f behind a filter that passes all
below f/2, has a standard deviation of N sqrt(f/2). Biases are drawn once a run. Nothing is quantised but by the wire.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians, sqrt
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from link.frames import STANDARD_GRAVITY_MPS2, Vector, offset_to_geodetic, rotate_back
from link.records import SENSORS_ALL, Altimeter, GpsFix, SensorFrame
from sitl.environment import PASCAL_PER_HPA, Environment, pressure_hpa
from sitl.truth import Truth

SAMPLE_RATE_HZ = 50.0
GYRO_DENSITY_RADPS_RTHZ = radians(0.01)
GYRO_BIAS_RMS_RADPS = radians(10.0) / 3600.0
ACCELEROMETER_DENSITY_MPS2_RTHZ = 60e-6 * STANDARD_GRAVITY_MPS2
ACCELEROMETER_BIAS_RMS_MPS2 = 0.5e-3 * STANDARD_GRAVITY_MPS2
"""What a calibration leaves: half a milli-g, 0.03 deg of tilt."""
MAGNETOMETER_DENSITY_GAUSS_RTHZ = 0.2e-3
MAGNETOMETER_BIAS_RMS_GAUSS = 0.5e-3
"""What hard-iron compensation leaves: about 0.15 deg of heading in Boston's field."""
PRESSURE_NOISE_HPA = 0.5
"""Half a centimetre of water: 0.005 % of a 10 bar transducer's full scale."""
TEMPERATURE_NOISE_DEGC = 0.01

GPS_PERIOD_US = 200_000
GPS_MAX_DEPTH_M = 0.4
"""Of the hull axis: the antenna on her back is awash when she floats in trim and drowned below."""
GPS_HORIZONTAL_NOISE_M = 1.5
GPS_VERTICAL_NOISE_M = 3.0
GPS_VELOCITY_NOISE_MPS = 0.05
GPS_SATELLITES = 10
GPS_FIX_3D = 3

ALTIMETER_PERIOD_US = 200_000
ALTIMETER_MIN_M = 0.3
ALTIMETER_MAX_M = 30.0
ALTIMETER_NOISE_M = 0.02
ALTIMETER_WORST_TILT_COS = 0.5
"""Beyond 60 deg from the vertical the beam glances off and no echo returns."""

_WHITE = sqrt(SAMPLE_RATE_HZ / 2.0)
_GYRO_NOISE_RADPS = GYRO_DENSITY_RADPS_RTHZ * _WHITE
_ACCELEROMETER_NOISE_MPS2 = ACCELEROMETER_DENSITY_MPS2_RTHZ * _WHITE
_MAGNETOMETER_NOISE_GAUSS = MAGNETOMETER_DENSITY_GAUSS_RTHZ * _WHITE


class Biases(NamedTuple):
    """Errors that stay the same through a run, FRD axes."""

    gyro_radps: Vector
    accelerometer_mps2: Vector
    magnetometer_gauss: Vector


class SensorStreams(NamedTuple):
    """One random stream for each instrument, so that one more sample of one leaves the others as they were."""

    biases: Generator
    gyro: Generator
    accelerometer: Generator
    magnetometer: Generator
    pressure: Generator
    temperature: Generator
    gps: Generator
    altimeter: Generator


class Sensors(NamedTuple):
    """Everything the instruments deliver at one instant."""

    frame: SensorFrame
    gps: GpsFix | None
    altimeter: Altimeter | None


def draw_biases(stream: Generator) -> Biases:
    """The errors of one run's instruments."""
    draws = stream.standard_normal((3, 3)) * np.array(
        [[GYRO_BIAS_RMS_RADPS], [ACCELEROMETER_BIAS_RMS_MPS2], [MAGNETOMETER_BIAS_RMS_GAUSS]]
    )
    gyro, accelerometer, magnetometer = (_vector(row) for row in draws.tolist())
    return Biases(gyro, accelerometer, magnetometer)


def sample(truth: Truth, sea: Environment, biases: Biases, streams: SensorStreams) -> Sensors:
    """Read every instrument that is due."""
    return Sensors(
        _inertial_magnetic_pressure(truth, sea, biases, streams),
        _gps(truth, sea, streams.gps) if _gps_sees_sky(truth) else None,
        _altimeter(truth, sea, streams.altimeter) if truth.time_us % ALTIMETER_PERIOD_US == 0 else None,
    )


def _inertial_magnetic_pressure(truth: Truth, sea: Environment, biases: Biases, streams: SensorStreams) -> SensorFrame:
    field = rotate_back(truth.attitude_q, sea.magnetic_field_ned_gauss)
    pressure = pressure_hpa(sea, truth.position_ned_m[2]) + PRESSURE_NOISE_HPA * streams.pressure.standard_normal()
    water_column_hpa = pressure - sea.surface_pressure_hpa
    return SensorFrame(
        truth.time_us,
        *_noisy(truth.specific_force_mps2, biases.accelerometer_mps2, _ACCELEROMETER_NOISE_MPS2, streams.accelerometer),
        *_noisy(truth.rates_radps, biases.gyro_radps, _GYRO_NOISE_RADPS, streams.gyro),
        *_noisy(field, biases.magnetometer_gauss, _MAGNETOMETER_NOISE_GAUSS, streams.magnetometer),
        pressure_hpa=pressure,
        differential_pressure_hpa=0.0,
        pressure_altitude_m=-water_column_hpa * PASCAL_PER_HPA / (sea.density_kgpm3 * sea.gravity_mps2),
        temperature_degc=sea.temperature_degc + TEMPERATURE_NOISE_DEGC * streams.temperature.standard_normal(),
        fields_updated=SENSORS_ALL,
        sensor_id=0,
    )


def _gps_sees_sky(truth: Truth) -> bool:
    return truth.time_us % GPS_PERIOD_US == 0 and truth.position_ned_m[2] < GPS_MAX_DEPTH_M


def _gps(truth: Truth, sea: Environment, stream: Generator) -> GpsFix:
    north, east, up, v_north, v_east, v_down = stream.standard_normal(6).tolist()
    latitude, longitude = offset_to_geodetic(
        truth.position_ned_m[0] + GPS_HORIZONTAL_NOISE_M * north,
        truth.position_ned_m[1] + GPS_HORIZONTAL_NOISE_M * east,
        sea.latitude_deg,
        sea.longitude_deg,
    )
    return GpsFix(
        truth.time_us,
        GPS_FIX_3D,
        latitude,
        longitude,
        -truth.position_ned_m[2] + GPS_VERTICAL_NOISE_M * up,
        truth.velocity_ned_mps[0] + GPS_VELOCITY_NOISE_MPS * v_north,
        truth.velocity_ned_mps[1] + GPS_VELOCITY_NOISE_MPS * v_east,
        truth.velocity_ned_mps[2] + GPS_VELOCITY_NOISE_MPS * v_down,
        GPS_SATELLITES,
    )


def _altimeter(truth: Truth, sea: Environment, stream: Generator) -> Altimeter | None:
    """Slant range along the body's down axis to a flat floor; None without an echo."""
    noise = stream.standard_normal()
    down_cos = rotate_back(truth.attitude_q, (0.0, 0.0, 1.0))[2]
    if down_cos < ALTIMETER_WORST_TILT_COS:
        return None
    range_m = (sea.floor_depth_m - truth.position_ned_m[2]) / down_cos + ALTIMETER_NOISE_M * noise
    if not ALTIMETER_MIN_M <= range_m <= ALTIMETER_MAX_M:
        return None
    return Altimeter(truth.time_us, range_m, ALTIMETER_MIN_M, ALTIMETER_MAX_M)


def _noisy(true: Vector, bias: Vector, noise: float, stream: Generator) -> Vector:
    x, y, z = stream.standard_normal(3).tolist()
    return true[0] + bias[0] + noise * x, true[1] + bias[1] + noise * y, true[2] + bias[2] + noise * z


def _vector(row: Sequence[float]) -> Vector:
    x, y, z = row
    return x, y, z
