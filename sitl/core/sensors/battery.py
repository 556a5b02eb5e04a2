"""The battery and its gauge: open-circuit voltage with a series resistance, hotel and drive load.

P = P_hotel + c |n|^3 for the shaft speed n (rev/s);  V = E(charge) - R I,  P = V I.
"""

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
    """Parameters of the battery and its loads."""

    timing: Timing
    sheet: BatterySheet
    hotel_w: float
    """Constant load."""
    drive_ws3: float
    """Power of the drive over the cube of the shaft speed, W s3."""


class BatteryState(NamedTuple):
    """State of the battery and errors of the gauge."""

    charge: float = 1.0
    """True charge as a fraction of the capacity."""
    used_ah: float = 0.0
    """True charge drawn since the battery was full."""
    gauge_scale: float = 1.0
    """Scale factor of the measured current."""
    queue: Queue[Battery] = ()


def build(
    sheet: BatterySheet, vehicle: VehicleConfig, full_rps: float, tick_us: int
) -> BatteryPack:
    """Build the battery; the drive's power law follows from the vehicle's operating point.

    c = T U / (eta n^3) for thrust T (N), speed U (m/s), drive efficiency eta and shaft speed n
    (rev/s) at the operating point.
    """
    at, power = vehicle.operating_point, vehicle.power
    drive_w = at.thrust_n * at.speed_mps / power.drive_efficiency
    schedule = timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us)
    return BatteryPack(
        timing=schedule,
        sheet=sheet,
        hotel_w=power.hotel_w,
        drive_ws3=drive_w / (at.thrust_fraction * full_rps) ** 3,
    )


def initial_state(pack: BatteryPack, charge: float, stream: NoiseStream) -> BatteryState:
    """Return the state of a battery charged to the fraction ``charge``; draw the gauge error."""
    used_ah = (1.0 - charge) * pack.sheet.capacity_ah
    return BatteryState(charge, used_ah, 1.0 + pack.sheet.gauge_error * stream.normal())


def sample(
    pack: BatteryPack, truth: Truth, state: BatteryState, stream: NoiseStream
) -> tuple[BatteryState, Battery | None]:
    """Report and discharge if due; return the new state and the report that arrives now, if any."""
    measured = None
    if is_due(pack.timing, truth.time_us):
        voltage_v, current_a = load(pack, state.charge, truth.propeller_rps)
        measured = _read_gauge(pack, state, voltage_v, current_a, stream)
        state = _discharge(pack, state, current_a)
    queue, report = queue_reading(pack.timing, state.queue, measured, truth.time_us, stream)
    return (state if queue is state.queue else state._replace(queue=queue)), report


def load(pack: BatteryPack, charge: float, shaft_rps: float) -> tuple[float, float]:
    """Return terminal voltage (V) and current (A) of a load of constant power.

    V = (E + sqrt(E^2 - 4 R P)) / 2, the larger root of V = E - R I, P = V I. If the load exceeds
    the largest power, E^2 / (4 R), that power is delivered at V = E / 2.
    """
    power_w = pack.hotel_w + pack.drive_ws3 * abs(shaft_rps) ** 3
    points, cell_v = pack.sheet.charge_points, pack.sheet.open_circuit_cell_v
    open_v = pack.sheet.cells * float(np.interp(charge, points, cell_v))
    voltage_v = 0.5 * (
        open_v + sqrt(max(0.0, open_v * open_v - 4.0 * pack.sheet.resistance_ohm * power_w))
    )
    return voltage_v, (open_v - voltage_v) / pack.sheet.resistance_ohm


def _discharge(pack: BatteryPack, state: BatteryState, current_a: float) -> BatteryState:
    """Draw the current for one report period, Q <- Q + I dt."""
    hours = pack.timing.period_us * 1e-6 / SECONDS_PER_HOUR
    used_ah = state.used_ah + current_a * hours
    return state._replace(charge=max(0.0, 1.0 - used_ah / pack.sheet.capacity_ah), used_ah=used_ah)


def _read_gauge(
    pack: BatteryPack, state: BatteryState, voltage_v: float, current_a: float, stream: NoiseStream
) -> Battery:
    """Return the gauge's report with its noise and scale error."""
    # voltage = V + sd n (V),   current = k I + sd n (A),   charge = 1 - k Q / Q_full, with V, I and
    # Q true voltage, current and used charge (A h), k scale of the gauge, n standard normal.
    n_voltage, n_current = stream.normals(2)
    counted_ah = state.gauge_scale * state.used_ah
    return Battery(
        voltage_v + pack.sheet.voltage_noise_v * n_voltage,
        state.gauge_scale * current_a + pack.sheet.current_noise_a * n_current,
        counted_ah,
        max(0.0, 1.0 - counted_ah / pack.sheet.capacity_ah),
    )
