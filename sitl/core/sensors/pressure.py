"""The pressure sensor: absolute water pressure at the hull axis, and temperature."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.jit import kernel
from sitl.core import draws
from sitl.core.draws import Draws, DrawTable
from sitl.core.environment import PASCAL_PER_HPA, Surroundings, pressure_hpa
from sitl.core.sensors.datasheets import PressureSheet
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, drop, is_due, row, timing
from sitl.vehicle.vectors import Vector

READING = 4
"""Length of a reading, fields of HIL_SENSOR: pressure (hPa), differential pressure (zero), height
above the still surface computed from the pressure with the scenario's density (m), temperature (deg
C)."""


class PressureSensor(NamedTuple):
    """Parameters of the pressure sensor."""

    timing: Timing = NOT_FITTED
    noise_hpa: float = 0.0
    offset_hpa: float = 0.0
    """Standard deviation of the offset over runs."""
    resolution_hpa: float = 0.0
    temperature_noise_degc: float = 0.0


def build(sheet: PressureSheet, tick_us: int) -> PressureSensor:
    """Build the sensor from its data sheet."""
    schedule = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    return PressureSensor(
        timing=schedule,
        noise_hpa=sheet.noise_hpa,
        offset_hpa=sheet.offset_hpa,
        resolution_hpa=sheet.resolution_hpa,
        temperature_noise_degc=sheet.temperature_noise_degc,
    )


def initial_offset_hpa(sensor: PressureSensor, stream: Draws) -> float:
    """Draw the offset of this run."""
    return sensor.offset_hpa * stream.normals(draws.PRESSURE, 1)[0]


@kernel
def sample(
    sensor: PressureSensor,
    offset_hpa: float,
    depth_m: float,
    wave_pa: float,
    sea: Surroundings,
    time_us: int,
    transit: Vector,
    latest: Vector,
    table: DrawTable,
) -> bool:
    """Sample if due; return whether ``latest`` is new in this tick.

    Parameters
    ----------
    sensor : PressureSensor
        Parameters.
    offset_hpa : float
        Offset of this run.
    depth_m, wave_pa : float
        True depth below the still surface, and pressure due to waves at the origin.
    sea : Surroundings
        The environment.
    time_us : int
        Vehicle time.
    transit : ndarray, shape (slots, READING)
        Readings in transit; updated.
    latest : ndarray, shape (READING,)
        Receives the reading that arrives.
    table : DrawTable
        Random numbers.
    """
    if is_due(sensor.timing, time_us):
        reading = row(sensor.timing, transit, time_us)
        true_hpa = pressure_hpa(
            sea.field.column, sea.gravity_mps2, sea.surface_pressure_hpa, depth_m, wave_pa
        )
        _read(sensor, true_hpa + offset_hpa, sea, table, reading)
        drop(sensor.timing, reading, table, draws.PRESSURE)
    return deliver(sensor.timing, transit, time_us, latest)


@kernel
def _read(
    sensor: PressureSensor, mean_hpa: float, sea: Surroundings, table: DrawTable, reading: Vector
) -> None:
    """Write a reading: pressure p with errors, and the altitude -(p - p0) / (rho g)."""
    # p = round_to_resolution(p_true + offset + sd n) in hPa, p0 pressure at the surface (hPa), rho
    # density (kg/m3) and g gravity (m/s2) of the surface water, n standard normal.
    n = draws.take(table, draws.PRESSURE, 2)
    pressure = mean_hpa + sensor.noise_hpa * n[0]
    if sensor.resolution_hpa > 0.0:
        pressure = round(pressure / sensor.resolution_hpa) * sensor.resolution_hpa
    gauge_pa = (pressure - sea.surface_pressure_hpa) * PASCAL_PER_HPA
    reading[0] = pressure
    reading[1] = 0.0
    reading[2] = -gauge_pa / (sea.density_kgpm3 * sea.gravity_mps2)
    reading[3] = sea.temperature_degc + sensor.temperature_noise_degc * n[1]
