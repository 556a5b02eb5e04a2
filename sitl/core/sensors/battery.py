"""The battery and its gauge: open-circuit voltage with a series resistance, hotel and drive load.

P = P_hotel + c |n|^3 for the shaft speed n (rev/s);  V = E(charge) - R I,  P = V I.
"""

from __future__ import annotations

from math import pow as power  # compiled, the operator ** rounds otherwise
from math import sqrt
from typing import NamedTuple

import numpy as np

from mavlink_io.jit import entry_point, kernel
from sitl.core.sensors.datasheets import BatterySheet
from sitl.core.sensors.noise import NoiseStream, normals
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, is_due, lose, row, timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.vectors import Vector

SECONDS_PER_HOUR = 3600.0


class BatteryPack(NamedTuple):
    """Parameters of the battery, its gauge and its loads."""

    timing: Timing = NOT_FITTED
    capacity_ah: float = 1.0
    cells: int = 1
    """Cells in series."""
    charge_points: Vector = np.zeros(1)
    """Charge fractions at which ``open_circuit_cell_v`` is given, increasing."""
    open_circuit_cell_v: Vector = np.zeros(1)
    resistance_ohm: float = 1.0
    voltage_noise_v: float = 0.0
    current_noise_a: float = 0.0
    gauge_error: float = 0.0
    """Standard deviation of the gauge's scale error over runs."""
    hotel_w: float = 0.0
    """Constant load."""
    drive_ws3: float = 0.0
    """Power of the drive over the cube of the shaft speed, W s3."""


CHARGE, USED_AH, GAUGE_SCALE = 0, 1, 2
"""Indices of the state: true charge as a fraction of the capacity; true charge drawn since the
battery was full; scale factor of the measured current."""
STATE = 3
"""Length of the state."""


def build(
    sheet: BatterySheet, vehicle: VehicleConfig, full_rps: float, tick_us: int
) -> BatteryPack:
    """Build the battery; the drive's power law follows from the vehicle's operating point.

    c = T U / (eta n^3) for thrust T (N), speed U (m/s), drive efficiency eta and shaft speed n
    (rev/s) at the operating point.
    """
    at, drive = vehicle.operating_point, vehicle.power
    drive_w = at.thrust_n * at.speed_mps / drive.drive_efficiency
    return BatteryPack(
        timing=timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        capacity_ah=sheet.capacity_ah,
        cells=sheet.cells,
        charge_points=np.array(sheet.charge_points),
        open_circuit_cell_v=np.array(sheet.open_circuit_cell_v),
        resistance_ohm=sheet.resistance_ohm,
        voltage_noise_v=sheet.voltage_noise_v,
        current_noise_a=sheet.current_noise_a,
        gauge_error=sheet.gauge_error,
        hotel_w=drive.hotel_w,
        drive_ws3=drive_w / (at.thrust_fraction * full_rps) ** 3,
    )


@kernel
def begin(pack: BatteryPack, stream: NoiseStream, state: Vector) -> None:
    """Complete the state of a battery whose charge is given; draw the gauge error."""
    state[USED_AH] = (1.0 - state[CHARGE]) * pack.capacity_ah
    state[GAUGE_SCALE] = 1.0 + pack.gauge_error * normals(stream, 1)[0]


@kernel
def sample(
    pack: BatteryPack,
    truth: TrueMotion,
    state: Vector,
    stream: NoiseStream,
    transit: Vector,
    latest: Vector,
) -> bool:
    """Report and discharge if due; return whether ``latest``, numbers of a ``Battery``, is new."""
    if is_due(pack.timing, truth.time_us):
        reading = row(pack.timing, transit, truth.time_us)
        voltage_v, current_a = load(pack, state[CHARGE], truth.propeller_rps)
        _read_gauge(pack, state, voltage_v, current_a, stream, reading)
        _discharge(pack, state, current_a)
        lose(pack.timing, reading, stream)
    return deliver(pack.timing, transit, truth.time_us, latest)


@entry_point
def load(pack: BatteryPack, charge: float, shaft_rps: float) -> tuple[float, float]:
    """Return terminal voltage (V) and current (A) of a load of constant power.

    V = (E + sqrt(E^2 - 4 R P)) / 2, the larger root of V = E - R I, P = V I. If the load exceeds
    the largest power, E^2 / (4 R), that power is delivered at V = E / 2.
    """
    power_w = pack.hotel_w + pack.drive_ws3 * power(abs(shaft_rps), 3.0)
    open_v = pack.cells * _open_circuit_v(pack.charge_points, pack.open_circuit_cell_v, charge)
    voltage_v = 0.5 * (
        open_v + sqrt(max(0.0, open_v * open_v - 4.0 * pack.resistance_ohm * power_w))
    )
    return voltage_v, (open_v - voltage_v) / pack.resistance_ohm


@kernel
def _open_circuit_v(points: Vector, cell_v: Vector, charge: float) -> float:
    """Return the voltage of a cell without load, linear between the points."""
    last = len(points) - 1
    if charge >= points[last]:
        return float(cell_v[last])
    if charge <= points[0]:
        return float(cell_v[0])
    i = 0
    while points[i + 1] <= charge:
        i += 1
    slope = (cell_v[i + 1] - cell_v[i]) / (points[i + 1] - points[i])
    return float(slope * (charge - points[i]) + cell_v[i])


@kernel
def _discharge(pack: BatteryPack, state: Vector, current_a: float) -> None:
    """Draw the current for one report period, Q <- Q + I dt."""
    hours = pack.timing.period_us * 1e-6 / SECONDS_PER_HOUR
    state[USED_AH] += current_a * hours
    state[CHARGE] = max(0.0, 1.0 - state[USED_AH] / pack.capacity_ah)


@kernel
def _read_gauge(
    pack: BatteryPack,
    state: Vector,
    voltage_v: float,
    current_a: float,
    stream: NoiseStream,
    reading: Vector,
) -> None:
    """Write the gauge's report with its noise and scale error."""
    # voltage = V + sd n (V),   current = k I + sd n (A),   charge = 1 - k Q / Q_full, with V, I and
    # Q true voltage, current and used charge (A h), k scale of the gauge, n standard normal.
    n = normals(stream, 2)
    counted_ah = state[GAUGE_SCALE] * state[USED_AH]
    reading[0] = voltage_v + pack.voltage_noise_v * n[0]
    reading[1] = state[GAUGE_SCALE] * current_a + pack.current_noise_a * n[1]
    reading[2] = counted_ah
    reading[3] = max(0.0, 1.0 - counted_ah / pack.capacity_ah)
