"""The plant's numeric state: one array of floats, with its parts as views.

Compiled code takes one array at a fraction of the cost of a record of many, and one copy of it
keeps the state before a tick.
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.jit import kernel
from sitl.core.environment.current import VARIATION
from sitl.core.environment.moments import PROCESSES
from sitl.core.sensors import devices, inertial, magnetic, pressure
from sitl.core.sensors.devices import DeviceSlots
from sitl.vehicle.dynamics import STATE_SIZE
from sitl.vehicle.vectors import Vector

READINGS = inertial.READING + magnetic.READING + pressure.READING
"""Length of the readings of IMU, magnetometer and pressure sensor, in the order of HIL_SENSOR."""
BIASES = 6
"""Length of the biases of gyros and accelerometers."""
(
    VELOCITY,
    FORCE,
    WATER_VELOCITY,
    SHAFT_RPS,
    RUDDER_RAD,
    ELEVATOR_RAD,
    PITCH_NM,
    YAW_NM,
    SURFACE_M,
    WAVE_PA,
    FLOODING,
) = (0, 3, 6, 9, 10, 11, 12, 13, 14, 15, 16)
"""Indices of the motion at the end of a tick.

Velocity over ground (NWU, m/s), specific force at the origin (FLU, m/s2) and velocity of the water
(NWU, m/s), three elements each; shaft speed (rev/s); true duct angles (rad); disturbance moments
(FLU, N m); height of the surface above the still level (m); pressure due to waves (Pa); 1 with
water in the hull, else 0.
"""
MOTION = FLOODING + 1
"""Length of the motion."""


class Layout(NamedTuple):
    """Sizes of the parts that depend on the vehicle."""

    axis: int
    """Length of the state of a tailcone axis."""
    imu_slots: int
    magnetometer_slots: int
    pressure_slots: int
    """Readings in transit of each sensor."""
    devices: DeviceSlots


class StateParts(NamedTuple):
    """Views of the parts of a state."""

    body: Vector
    """State of ``vehicle.dynamics``, shape (13,), FLU in NWU."""
    motion: Vector
    moments: Vector
    """Disturbance moments, see ``environment.moments``."""
    variation: Vector
    """Variation of the current, see ``environment.current``."""
    biases: Vector
    """Biases of the IMU, see ``sensors.inertial``."""
    readings: Vector
    """Latest readings, see `READINGS`."""
    rudder: Vector
    elevator: Vector
    """States of the tailcone axes, see ``core.tailcone``."""
    imu: Vector
    magnetometer: Vector
    pressure: Vector
    """Readings in transit, one row each."""
    devices: Vector
    """The slower sensors, see ``sensors.devices``."""


BODY = slice(0, STATE_SIZE)
"""State of ``vehicle.dynamics``."""
_BODY_END = STATE_SIZE
_MOTION_END = _BODY_END + MOTION
_MOMENTS_END = _MOTION_END + PROCESSES
_VARIATION_END = _MOMENTS_END + VARIATION
_BIASES_END = _VARIATION_END + BIASES
_READINGS_END = _BIASES_END + READINGS
FIRST_MOTION, FIRST_READING = _BODY_END, _BIASES_END
"""Indices of the first element of the motion, and of the latest readings."""


def size(layout: Layout) -> int:
    """Return the length of a state."""
    transit = (
        layout.imu_slots * inertial.READING
        + layout.magnetometer_slots * magnetic.READING
        + layout.pressure_slots * pressure.READING
    )
    return _READINGS_END + 2 * layout.axis + transit + devices.size(layout.devices)


def body_and_motion(values: Vector) -> tuple[list[float], list[float]]:
    """Return body and motion."""
    floats = values[:_MOTION_END].tolist()
    return floats[:_BODY_END], floats[_BODY_END:]


def readings(values: Vector) -> list[float]:
    """Return the latest readings of IMU, magnetometer and pressure sensor."""
    return values[_BIASES_END:_READINGS_END].tolist()  # type: ignore[no-any-return]


def device_readings(layout: Layout, values: Vector) -> list[float]:
    """Return the latest readings of the slower sensors, see ``devices.LATEST``."""
    own = values[-devices.size(layout.devices) :]
    return devices.latest(own).tolist()  # type: ignore[no-any-return]


@kernel
def parts(layout: Layout, values: Vector) -> StateParts:
    """Return views of the parts of a state.

    Parameters
    ----------
    layout : Layout
        Sizes of the parts.
    values : ndarray, shape (size(layout),)
        The state.

    Returns
    -------
    StateParts
        Arrays that share the memory of ``values``.
    """
    rudder_end = _READINGS_END + layout.axis
    elevator_end = rudder_end + layout.axis
    imu_end = elevator_end + layout.imu_slots * inertial.READING
    magnetometer_end = imu_end + layout.magnetometer_slots * magnetic.READING
    pressure_end = magnetometer_end + layout.pressure_slots * pressure.READING
    return StateParts(
        values[:_BODY_END],
        values[_BODY_END:_MOTION_END],
        values[_MOTION_END:_MOMENTS_END],
        values[_MOMENTS_END:_VARIATION_END],
        values[_VARIATION_END:_BIASES_END],
        values[_BIASES_END:_READINGS_END],
        values[_READINGS_END:rudder_end],
        values[rudder_end:elevator_end],
        values[elevator_end:imu_end].reshape((layout.imu_slots, inertial.READING)),
        values[imu_end:magnetometer_end].reshape((layout.magnetometer_slots, magnetic.READING)),
        values[magnetometer_end:pressure_end].reshape((layout.pressure_slots, pressure.READING)),
        values[pressure_end:],
    )
