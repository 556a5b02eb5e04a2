"""The pressure sensor: absolute water pressure at the hull axis, and temperature."""

from __future__ import annotations

from typing import NamedTuple

from sitl.core.environment import PASCAL_PER_HPA, Environment, pressure_hpa
from sitl.core.sensors.datasheets import PressureSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth


class PressureSensor(NamedTuple):
    """Parameters of the pressure sensor."""

    timing: Timing
    noise_hpa: float
    offset_hpa: float
    """Standard deviation of the offset over runs."""
    resolution_hpa: float
    temperature_noise_degc: float


class PressureReading(NamedTuple):
    """One reading."""

    pressure_hpa: float = 0.0
    altitude_m: float = 0.0
    """Height above the still surface computed from the pressure with the scenario's density."""
    temperature_degc: float = 0.0


class PressureState(NamedTuple):
    """Offset of this run, latest reading, and readings in transit."""

    offset_hpa: float = 0.0
    latest: PressureReading = PressureReading()
    """Latest reading that has arrived."""
    queue: Queue[PressureReading] = ()


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


def initial_state(sensor: PressureSensor, stream: NoiseStream) -> PressureState:
    """Draw the offset of this run."""
    return PressureState(sensor.offset_hpa * stream.normal())


def sample(
    sensor: PressureSensor,
    truth: Truth,
    sea: Environment,
    state: PressureState,
    stream: NoiseStream,
) -> tuple[PressureState, bool]:
    """Sample if due; return the new state and whether ``latest`` is new in this tick."""
    offset, latest, queue = state
    measured = (
        _read(sensor, truth, sea, offset, stream) if is_due(sensor.timing, truth.time_us) else None
    )
    queue, reading = queue_reading(sensor.timing, queue, measured, truth.time_us, stream)
    return PressureState(offset, reading or latest, queue), reading is not None


def _read(
    sensor: PressureSensor, truth: Truth, sea: Environment, offset_hpa: float, stream: NoiseStream
) -> PressureReading:
    """Return a reading: pressure p with errors, and the altitude -(p - p0) / (rho g)."""
    # p = round_to_resolution(p_true + offset + sd n) in hPa, p0 pressure at the surface (hPa), rho
    # density (kg/m3) and g gravity (m/s2) of the surface water, n standard normal.
    n_pressure, n_temperature = stream.normals(2)
    true_hpa = pressure_hpa(sea, truth.position_ned_m[2], truth.wave_pressure_pa)
    pressure = true_hpa + offset_hpa + sensor.noise_hpa * n_pressure
    if sensor.resolution_hpa:
        pressure = round(pressure / sensor.resolution_hpa) * sensor.resolution_hpa
    gauge_pa = (pressure - sea.surface_pressure_hpa) * PASCAL_PER_HPA
    return PressureReading(
        pressure,
        -gauge_pa / (sea.density_kgpm3 * sea.gravity_mps2),
        sea.temperature_degc + sensor.temperature_noise_degc * n_temperature,
    )
