"""The battery pack and its gauge: open-circuit voltage behind a resistance, emptied by hotel load
and propeller."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from mavlink_io.records import Battery
from sitl.core.sensors.datasheets import BatterySheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth
from sitl.vehicle.config import VehicleConfig

SECONDS_PER_HOUR = 3600.0


class BatteryPack(NamedTuple):
    timing: Timing
    sheet: BatterySheet
    hotel_w: float
    drive_ws3: float
    """Power of the drive over shaft speed cubed, W s3."""


class BatteryState(NamedTuple):
    charge: float = 1.0
    """What is really left, as a fraction of the capacity."""
    used_ah: float = 0.0
    """What was really drawn since the last full charge."""
    gauge_scale: float = 1.0
    """Of the current that the gauge counts."""
    queue: Queue[Battery] = ()


def build(
    sheet: BatterySheet, vehicle: VehicleConfig, full_rps: float, tick_us: int
) -> BatteryPack:
    """The drive's power follows the cube of shaft speed through thrust times speed at the operating
    point."""
    at, power = vehicle.operating_point, vehicle.power
    drive_w = at.thrust_n * at.speed_mps / power.drive_efficiency
    when = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    return BatteryPack(when, sheet, power.hotel_w, drive_w / (at.thrust_fraction * full_rps) ** 3)


def initial_state(pack: BatteryPack, charge: float, stream: NoiseStream) -> BatteryState:
    """A pack filled to the fraction ``charge``, with this run's gauge."""
    used_ah = (1.0 - charge) * pack.sheet.capacity_ah
    return BatteryState(charge, used_ah, 1.0 + pack.sheet.gauge_error * stream.normal())


def sample(
    pack: BatteryPack, truth: Truth, memory: BatteryState, stream: NoiseStream
) -> tuple[BatteryState, Battery | None]:
    """The gauge's report that arrives now, if one does. The pack is emptied from report to
    report."""
    taken = None
    if is_due(pack.timing, truth.time_us):
        voltage_v, current_a = load(pack, memory.charge, truth.propeller_rps)
        taken = _read_gauge(pack, memory, voltage_v, current_a, stream)
        memory = _discharge(pack, memory, current_a)
    queue, report = queue_reading(pack.timing, memory.queue, taken, truth.time_us, stream)
    return (memory if queue is memory.queue else memory._replace(queue=queue)), report


def load(pack: BatteryPack, charge: float, shaft_rps: float) -> tuple[float, float]:
    """Voltage (V) at the terminals and current (A) of a constant-power load: V = E - R I, P = V I.

    A pack too weak for the load gives all it can, at half its open-circuit voltage.
    """
    power_w = pack.hotel_w + pack.drive_ws3 * abs(shaft_rps) ** 3
    points, cell_v = pack.sheet.charge_points, pack.sheet.open_circuit_cell_v
    open_v = pack.sheet.cells * float(np.interp(charge, points, cell_v))
    voltage_v = 0.5 * (
        open_v + sqrt(max(0.0, open_v * open_v - 4.0 * pack.sheet.resistance_ohm * power_w))
    )
    return voltage_v, (open_v - voltage_v) / pack.sheet.resistance_ohm


def _discharge(pack: BatteryPack, memory: BatteryState, current_a: float) -> BatteryState:
    hours = pack.timing.period_us * 1e-6 / SECONDS_PER_HOUR
    used_ah = memory.used_ah + current_a * hours
    return memory._replace(charge=max(0.0, 1.0 - used_ah / pack.sheet.capacity_ah), used_ah=used_ah)


def _read_gauge(
    pack: BatteryPack, memory: BatteryState, voltage_v: float, current_a: float, stream: NoiseStream
) -> Battery:
    n_voltage, n_current = stream.normals(2)
    counted_ah = memory.gauge_scale * memory.used_ah
    return Battery(
        voltage_v + pack.sheet.voltage_noise_v * n_voltage,
        memory.gauge_scale * current_a + pack.sheet.current_noise_a * n_current,
        counted_ah,
        max(0.0, 1.0 - counted_ah / pack.sheet.capacity_ah),
    )
