"""One tick of the plant's numeric core in one compiled call: actuators, water, body, sensors.

Everything else of a tick happens rarely and is Python, in ``plant``: faults and records.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.jit import Native, entry_point, kernel
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
)
from sitl.core import body, draws, state, tailcone
from sitl.core.draws import DrawTable
from sitl.core.environment import Surroundings, current, local_water, moments
from sitl.core.environment.field import LocalWater
from sitl.core.sensors import devices, inertial, magnetic, pressure
from sitl.core.sensors.devices import SimulatedDevices
from sitl.core.sensors.true_motion import TrueMotion
from sitl.core.state import Layout, StateParts
from sitl.core.tailcone import TailconeAxis
from sitl.vehicle.propeller import rps
from sitl.vehicle.vectors import Vector

_MAGNETOMETER, _PRESSURE = inertial.READING, inertial.READING + magnetic.READING
"""Indices of the readings of magnetometer and pressure sensor; those of the IMU come first."""


class Constants(NamedTuple):
    """Parameters that are constant during a run, other than those of the body."""

    layout: Layout
    imu: inertial.Imu
    magnetometer: magnetic.Magnetometer
    pressure: pressure.PressureSensor
    devices: SimulatedDevices
    devices_us: int
    """``SimulatedDevices.common_us``."""
    clamped: bool
    """Whether the body is held in its initial state."""
    tick_s: float
    substeps: int
    """Integration steps per tick."""


class Fresh(NamedTuple):
    """Readings that are new in a tick."""

    updated: int
    """HIL_SENSOR.fields_updated."""
    devices: int
    """Bits of the slower sensors, ``device_records.GPS_NEW`` and so on."""


class SimulationRun(NamedTuple):
    """Everything that is constant during a run, other than the body."""

    constants: Constants
    sea: Surroundings
    imu: inertial.InertialErrors
    magnetometer: magnetic.MagneticErrors
    pressure_offset_hpa: float


@entry_point
def start(
    vessel: Native,
    run: Native,
    numbers: Vector,
    used: NDArray[np.int64],
    streams: Native,
    values: Vector,
) -> Fresh:
    """Write the motion at vehicle time zero, and take the first readings.

    Parameters
    ----------
    vessel, run : Native
        ``body.Body`` and ``SimulationRun``.
    numbers, used : ndarray
        The ``draws.DrawTable``; its counters advance.
    streams : Native
        ``DeviceStreams``; they advance.
    values : ndarray
        State of ``core.state`` with body, moments, variation, biases, axes and charge of the
        battery at their initial values; motion and readings are written.

    Returns
    -------
    Fresh
        Readings that are new.
    """
    parts = state.parts(run.value.constants.layout, values)
    axes = vessel.value
    _write_duct(axes.rudder, axes.elevator, parts)
    water = local_water(run.value.sea, parts.variation, parts.body, 0.0, 0.0)
    still = np.empty((2, 0))
    _move(vessel, run.value.sea, parts, still, parts.moments, 0.0, water)
    devices.begin(run.value.constants.devices, streams, parts.devices)
    return _sense(run.value, DrawTable(numbers, used), streams, parts, 0)


@entry_point
def advance(
    vessel: Native,
    run: Native,
    numbers: Vector,
    used: NDArray[np.int64],
    streams: Native,
    values: Vector,
    time_us: int,
    rudder: float,
    elevator: float,
    thrust: float,
) -> Fresh:
    """Advance a state by one tick, in place.

    Parameters
    ----------
    vessel, run : Native
        ``body.Body`` and ``SimulationRun``.
    numbers, used : ndarray
        The ``draws.DrawTable``; its counters advance.
    streams : Native
        ``DeviceStreams``; they advance.
    values : ndarray
        State of ``core.state`` before the tick; overwritten with the state after it.
    time_us : int
        Vehicle time at the end of the tick.
    rudder, elevator, thrust : float
        Controls, constant during the tick; limited to [-1, 1], NaN means 0.

    Returns
    -------
    Fresh
        Readings that are new.

    Notes
    -----
    Disturbance moments are constant during the tick at their value before it; the accelerometer at
    the end of the tick measures with that after it. The water is constant during the tick. It is
    sampled for the end of the tick at the position extrapolated to that time, half a tick ahead of
    the mean.
    """
    fixed, sea, table = run.value.constants, run.value.sea, DrawTable(numbers, used)
    parts = state.parts(fixed.layout, values)
    duct_rad = np.empty((2, fixed.substeps))
    _turn_duct(vessel, table, parts, _limited(rudder), _limited(elevator), duct_rad)
    before = parts.moments.copy()
    moments.advance(sea.moments, parts.moments, table)
    current.advance(sea.drift, parts.variation, table)
    if fixed.clamped:
        parts.motion[state.SHAFT_RPS] = rps(_limited(thrust), vessel.value.model)
    else:
        water = local_water(sea, parts.variation, parts.body, time_us * 1e-6, fixed.tick_s)
        _move(vessel, sea, parts, duct_rad, before, _limited(thrust), water)
    return _sense(run.value, table, streams, parts, time_us)


@kernel
def _limited(control: float) -> float:
    """Limit a control to [-1, 1]; NaN, which some autopilots send for idle channels, means 0."""
    return 0.0 if control != control else max(-1.0, min(1.0, control))


@kernel
def _turn_duct(
    vessel: Native,
    table: DrawTable,
    parts: StateParts,
    rudder: float,
    elevator: float,
    duct_rad: Vector,
) -> None:
    """Step both axes through a tick; write the mean duct angles of each substep."""
    axes = vessel.value
    body.step_axes(
        axes,
        parts.rudder,
        parts.elevator,
        rudder * axes.rudder.travel_rad,
        elevator * axes.elevator.travel_rad,
        duct_rad,
        _step_losses(axes.rudder, table, draws.RUDDER, duct_rad.shape[1]),
        _step_losses(axes.elevator, table, draws.ELEVATOR, duct_rad.shape[1]),
    )
    _write_duct(axes.rudder, axes.elevator, parts)


@kernel
def _step_losses(axis: TailconeAxis, table: DrawTable, stream: int, substeps: int) -> Vector:
    """Return a number in [0, 1) per substep for lost steps; unused if none can be lost."""
    if axis.lost_step_chance > 0.0:
        return draws.take(table, stream, substeps)
    return table.values[stream, :substeps]


@kernel
def _write_duct(rudder: TailconeAxis, elevator: TailconeAxis, parts: StateParts) -> None:
    """Write the true duct angles at the end of a tick."""
    parts.motion[state.RUDDER_RAD] = tailcone.duct_angle_rad(rudder, parts.rudder)
    parts.motion[state.ELEVATOR_RAD] = tailcone.duct_angle_rad(elevator, parts.elevator)


@kernel
def _move(
    vessel: Native,
    sea: Surroundings,
    parts: StateParts,
    duct_rad: Vector,
    moments_before: Vector,
    thrust: float,
    local: LocalWater,
) -> None:
    """Integrate the body over a tick, a step per column of ``duct_rad``; write the motion."""
    motion = parts.motion
    vehicle = vessel.value
    shaft_rps, velocity, force = body.integrate(
        vehicle,
        parts.body,
        duct_rad,
        vehicle.rudder.substep_s,
        (motion[state.RUDDER_RAD], motion[state.ELEVATOR_RAD]),
        thrust,
        _wrench(sea, moments_before),
        _wrench(sea, parts.moments),
        local.water,
    )
    for i in range(3):
        motion[state.VELOCITY + i] = velocity[i]
        motion[state.FORCE + i] = force[i]
        motion[state.WATER_VELOCITY + i] = local.water.velocity_mps[i]
    motion[state.SHAFT_RPS] = shaft_rps
    motion[state.PITCH_NM], motion[state.YAW_NM] = moments.moments_flu_nm(
        sea.moments, parts.moments
    )
    motion[state.SURFACE_M] = local.water.surface_m
    motion[state.WAVE_PA] = local.wave_pressure_pa


@kernel
def _wrench(sea: Surroundings, processes: Vector) -> Vector:
    """Return the disturbance as generalised force (X, Y, Z, K, M, N), FLU, N and N m."""
    wrench = np.zeros(6)
    wrench[4], wrench[5] = moments.moments_flu_nm(sea.moments, processes)
    return wrench


@kernel
def _sense(
    run: SimulationRun, table: DrawTable, streams: Native, parts: StateParts, time_us: int
) -> Fresh:
    """Sample all sensors that are due; return which readings are new."""
    fixed, force, motion, flu = run.constants, state.FORCE, parts.motion, parts.body
    fresh = 0
    if inertial.sample(
        fixed.imu,
        run.imu,
        flip(motion[force], motion[force + 1], motion[force + 2]),
        flip(flu[10], flu[11], flu[12]),
        time_us,
        parts.biases,
        parts.imu,
        parts.readings[:_MAGNETOMETER],
        table,
    ):
        fresh |= ACCELEROMETER_FRESH | GYRO_FRESH
    if magnetic.sample(
        fixed.magnetometer,
        run.magnetometer,
        flip_quaternion(flu[3], flu[4], flu[5], flu[6]),
        run.sea.magnetic_field_ned_gauss,
        time_us,
        parts.magnetometer,
        parts.readings[_MAGNETOMETER:_PRESSURE],
        table,
    ):
        fresh |= MAGNETOMETER_FRESH
    if pressure.sample(
        fixed.pressure,
        run.pressure_offset_hpa,
        -flu[2],
        motion[state.WAVE_PA],
        run.sea,
        time_us,
        parts.pressure,
        parts.readings[_PRESSURE:],
        table,
    ):
        fresh |= PRESSURE_FRESH
    if time_us % fixed.devices_us != 0:
        return Fresh(fresh, 0)
    new = devices.sample(
        fixed.devices,
        fixed.layout.devices,
        _true_motion(parts, time_us),
        run.sea,
        streams,
        parts.devices,
    )
    return Fresh(fresh, new)


@kernel
def _true_motion(parts: StateParts, time_us: int) -> TrueMotion:
    """Return the true motion in FRD and NED."""
    b, m, v, w = parts.body, parts.motion, state.VELOCITY, state.WATER_VELOCITY
    return TrueMotion(
        time_us,
        flip(b[0], b[1], b[2]),
        flip_quaternion(b[3], b[4], b[5], b[6]),
        flip(m[v], m[v + 1], m[v + 2]),
        flip(m[w], m[w + 1], m[w + 2]),
        m[state.RUDDER_RAD],
        m[state.ELEVATOR_RAD],
        m[state.SHAFT_RPS],
        m[state.SURFACE_M],
        m[state.FLOODING] != 0.0,
    )
