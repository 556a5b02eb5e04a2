"""The plant: one tick of actuators, body, water and sensors, as a pure function.

The only side effect is that the given random streams advance.

>>> simulated = plant.build(config.load("caribou_truth"), scenario.load("calm"))
>>> rng = plant.random_streams(seed=1)
>>> state, sensors = plant.initial_state(simulated, rng)
>>> state, sensors = plant.step(simulated, state, actuators, rng)  # once per tick
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.random import Generator, SeedSequence, default_rng

from mavlink_io import jit
from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.jit import Native, native
from mavlink_io.records import ActuatorFrame, SensorFrame
from sitl.core import environment, initial_conditions, sensors, state, tailcone, tick
from sitl.core.body import Body
from sitl.core.draws import AT_START, PER_TICK, Draws
from sitl.core.environment import Environment, current, moments
from sitl.core.sensors import (
    Sensors,
    SensorSuite,
    battery,
    devices,
    inertial,
    magnetic,
    pressure,
    sample_timing,
)
from sitl.core.sensors.devices import DeviceStreams
from sitl.core.state import Layout
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.core.truth import Truth
from sitl.faults import body as body_faults
from sitl.faults import failure_injection, readings, timeline
from sitl.faults import tailcone as tailcone_faults
from sitl.faults.catalogue import FaultError
from sitl.faults.failure_injection import InjectionResult
from sitl.faults.tailcone import Drives
from sitl.faults.timeline import Timeline
from sitl.scenario import Scenario, StartTable
from sitl.scenario_types import ScenarioError
from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_config
from sitl.vehicle.config import DropWeight, VehicleConfig
from sitl.vehicle.dynamics import POSITION, QUATERNION
from sitl.vehicle.vectors import Vector

RUDDER, ELEVATOR, THRUST, DROP = 0, 1, 2, 3
"""Indices of ``ActuatorFrame.controls``."""
RELEASE_ABOVE = 0.5
"""Control above which the drop weight is released."""
_FLOODED = "leak wet"
"""Name of the fault with water in the hull."""
RATES = slice(10, 13)
"""Angular rates in the body state, FLU, rad/s."""


class Plant(NamedTuple):
    """Parameters that are constant during a run."""

    vessel: Body
    native: Native
    """Copy of ``vessel`` for compiled code; change both together."""
    sea: Environment
    suite: SensorSuite
    start: StartTable
    constants: tick.Constants
    draws: int
    """Largest number of draws of one stream in a tick."""
    tick_us: int
    faults: Timeline
    """Scheduled faults."""
    drop_weight: DropWeight | None = None
    """None if none is fitted."""


class PlantState(NamedTuple):
    """Variables of a run at one tick; the arrays of a state are never modified."""

    time_us: int
    """Vehicle time."""
    values: Vector
    """Numeric state, see ``core.state``."""
    layout: Layout
    run: Native
    """The ``tick.SimulationRun``."""
    advance: Callable[..., tuple[int, int]]
    """Machine code of ``tick.advance``."""
    faults: Timeline
    weight_released: bool = False

    @property
    def body(self) -> Vector:
        """State of ``vehicle.dynamics``, shape (13,), FLU in NWU."""
        return self.values[state.BODY]

    @property
    def truth(self) -> Truth:
        """True motion in FRD and NED."""
        return _truth(self)


class RandomStreams(NamedTuple):
    """Independent random streams of a run."""

    draws: Draws
    """Streams of the compiled tick."""
    devices: Native
    """``DeviceStreams``."""
    faults: Generator
    swell: Generator
    """Phases and directions of the waves."""


def build(
    vehicle: VehicleConfig, scenario: Scenario, timestep: Timestep = DEFAULT_TIMESTEP
) -> Plant:
    """Build the plant of a vehicle in a scenario.

    Parameters
    ----------
    vehicle : VehicleConfig
        Content of a vehicle file.
    scenario : Scenario
        Content of a scenario file.
    timestep : Timestep
        Length of a tick.

    Returns
    -------
    Plant
        Parameters for ``initial_state`` and ``step``.

    Raises
    ------
    VehicleFileError
        The vehicle is impossible or names an unknown sensor.
    ScenarioError
        The scenario is impossible for this vehicle.
    """
    if scenario.rig.encoder:
        instruments = replace(vehicle.instruments, encoder=scenario.rig.encoder)
        vehicle = replace(vehicle, instruments=instruments)
    vehicle_config.check_drop_weight(vehicle, f"vehicle {vehicle.name}")
    model = build_model.build(vehicle)
    try:
        body_faults.check_feasible(model, scenario.faults)
    except FaultError as error:
        raise ScenarioError(f"scenario {scenario.title}: fault: {error}") from None
    suite = sensors.build(
        vehicle,
        model.propeller.full_rps,
        timestep.tick_us,
        imu_every_tick=timestep.imu_every_tick,
    )
    vessel = Body(
        model=model,
        rudder=tailcone.from_config(
            vehicle.tailcone, vehicle.tailcone.rudder_bias_deg, timestep.substep_s
        ),
        elevator=tailcone.from_config(
            vehicle.tailcone, vehicle.tailcone.elevator_bias_deg, timestep.substep_s
        ),
    )
    layout = Layout(
        axis=len(tailcone.at_rest(vessel.rudder)),
        imu_slots=sample_timing.slots(suite.imu.timing),
        magnetometer_slots=sample_timing.slots(suite.magnetometer.timing),
        pressure_slots=sample_timing.slots(suite.pressure.timing),
        devices=devices.device_slots(suite.devices),
    )
    constants = tick.Constants(
        layout=layout,
        imu=suite.imu,
        magnetometer=suite.magnetometer,
        pressure=suite.pressure,
        devices=suite.devices,
        devices_us=suite.devices.common_us,
        clamped=scenario.rig.clamped,
        tick_s=timestep.tick_s,
        substeps=timestep.substeps,
    )
    return Plant(
        vessel=vessel,
        native=native(vessel),
        sea=environment.build(
            scenario,
            model.hydrostatics.gravity_mps2,
            timestep.tick_s,
            model.hydrostatics.half_length_m,
            vehicle.water.density_kgpm3,
        ),
        suite=suite,
        start=scenario.start,
        constants=constants,
        draws=max(PER_TICK, timestep.substeps),
        tick_us=timestep.tick_us,
        faults=timeline.schedule(scenario.faults),
        drop_weight=vehicle.drop_weight,
    )


def random_streams(seed: int, sea_seed: int | None = None) -> RandomStreams:
    """Return the random streams of a seed; draws from one stream do not affect the others.

    Parameters
    ----------
    seed : int
        Seed of the simulation.
    sea_seed : int, optional
        Seed of the sea: its waves and the variation of its current. Simulations with the same one
        are in the same sea at the same vehicle time. Default: ``seed``.

    Returns
    -------
    RandomStreams
        Generators of the environment, the sensors, the actuators and the faults.
    """
    slow, wave, imu, compass, depth, *slower, rudder, elevator, faults, swell, drift = _spawn(seed)
    if sea_seed is not None:
        *_, swell, drift = _spawn(sea_seed)
    return RandomStreams(
        draws=Draws((slow, wave, imu, compass, depth, drift, rudder, elevator)),
        devices=devices.streams(slower),
        faults=faults,
        swell=swell,
    )


def _spawn(seed: int) -> list[Generator]:
    """Return the generators of a seed, those of the sea last."""
    children = SeedSequence(seed).spawn(10 + len(DeviceStreams._fields))
    return [default_rng(child) for child in children]


def initial_state(plant: Plant, rng: RandomStreams) -> tuple[PlantState, Sensors]:
    """Return the state at vehicle time zero and the sensor output.

    Parameters
    ----------
    plant : Plant
        Parameters of the run.
    rng : RandomStreams
        Random streams of the run; they advance.

    Returns
    -------
    state : PlantState
        State at vehicle time zero.
    sensors : Sensors
        Sensor output at that time.
    """
    rng.draws.prepare(AT_START)
    suite, layout = plant.suite, plant.constants.layout
    sea, values = environment.draw_waves(plant.sea, rng.swell), np.zeros(state.size(layout))
    parts = state.parts(layout, values)
    parts.moments[:] = moments.sample_stationary(rng.draws)
    parts.variation[:] = current.sample_stationary(sea.drift, rng.draws)
    parts.body[:] = initial_conditions.initial_body_state(
        plant.vessel.model, plant.start, sea, parts.variation
    )
    errors, parts.biases[:] = inertial.initial_errors(suite.imu, rng.draws)
    iron = magnetic.initial_errors(suite.magnetometer, rng.draws)
    offset_hpa = pressure.initial_offset_hpa(suite.pressure, rng.draws)
    run = native(tick.SimulationRun(plant.constants, sea, errors, iron, offset_hpa))
    devices.parts(parts.devices).battery[battery.CHARGE] = plant.start.battery_pct / 100.0
    flown = plant.native, run, *rng.draws.table, rng.devices, values
    fresh = tick.start(*flown)
    advance = jit.machine_code(tick.advance, *flown, 0, 0.0, 0.0, 0.0)
    begun = PlantState(0, values, layout, run, advance, plant.faults)
    return measure(plant, begun, *fresh, rng)


def step(
    plant: Plant, before: PlantState, actuators: ActuatorFrame, rng: RandomStreams
) -> tuple[PlantState, Sensors]:
    """Advance the plant by one tick.

    Parameters
    ----------
    plant : Plant
        Parameters of the run.
    before : PlantState
        State at the start of the tick.
    actuators : ActuatorFrame
        Controls in [-1, 1], constant during the tick: rudder, elevator, thrust, drop weight.
    rng : RandomStreams
        Random streams of the run; they advance.

    Returns
    -------
    state : PlantState
        State at the end of the tick.
    sensors : Sensors
        Sensor output at the end of the tick.
    """
    time_us = before.time_us + plant.tick_us
    faults = timeline.advance(before.faults, plant.vessel.model, time_us)
    controls, vessel = actuators.controls, plant.vessel
    if faults.running:
        vessel, controls, faults = _apply_faults(vessel, controls, faults, rng.faults)
    weight, released = plant.drop_weight, before.weight_released
    if weight is not None:
        released = released or (len(controls) > DROP and controls[DROP] > RELEASE_ABOVE)
        vessel = _without_weight(vessel, weight) if released else vessel
    rng.draws.prepare(plant.draws)
    values = before.values.copy()
    values[state.FIRST_MOTION + state.FLOODING] = _FLOODED in faults.names
    is_nominal = vessel is plant.vessel
    advance = before.advance if is_nominal else tick.advance
    fresh = advance(
        plant.native if is_nominal else native(vessel),
        before.run,
        *rng.draws.table,
        rng.devices,
        values,
        time_us,
        controls[RUDDER],
        controls[ELEVATOR],
        controls[THRUST],
    )
    after = PlantState(
        time_us,
        values,
        before.layout,
        before.run,
        before.advance,
        faults,
        released,
    )
    return measure(plant, after, *fresh, rng)


def quiet_until_us(now: PlantState) -> int:
    """Return the vehicle time until which ``tick.advance`` makes every tick.

    Parameters
    ----------
    now : PlantState
        Present state.

    Returns
    -------
    int
        Vehicle time of the next fault; the present time while a fault is in force or the drop
        weight is released.
    """
    if now.faults.running or now.faults.changes or now.weight_released:
        return now.time_us
    return now.faults.next_us


def measure(
    plant: Plant, moved: PlantState, updated: int, new: int, rng: RandomStreams
) -> tuple[PlantState, Sensors]:
    """Return the readings of a tick as records, with the faults of the sensors.

    Parameters
    ----------
    plant : Plant
        Parameters of the run.
    moved : PlantState
        State after ``tick.advance``.
    updated, new : int
        Readings that are new, ``tick.Fresh``.
    rng : RandomStreams
        Random streams of the run; that of the faults may advance.

    Returns
    -------
    state : PlantState
        State at the end of the tick.
    sensors : Sensors
        Sensor output at the end of the tick.
    """
    time_us, values = moved.time_us, moved.values
    frame = SensorFrame._make((time_us, *state.readings(values), updated, 0))
    output = Sensors(frame)
    if new:
        output = Sensors(frame, *devices.records(new, state.device_readings(moved.layout, values)))
    if moved.faults.running:
        output, running = readings.apply(
            output, moved.faults.running, time_us, plant.constants.tick_s, rng.faults
        )
        moved = moved._replace(faults=moved.faults._replace(running=running))
    return moved, output


def inject_failure(state: PlantState, injection: InjectionResult) -> PlantState:
    """Add or clear a failure that a ground station commands; it takes effect at the next tick.

    Parameters
    ----------
    state : PlantState
        Present state.
    injection : InjectionResult
        An accepted result of ``failure_injection.parse_command``.
    """
    return state._replace(
        faults=failure_injection.apply_injection(state.faults, injection, state.time_us)
    )


def _apply_faults(
    vessel: Body, controls: tuple[float, ...], faults: Timeline, noise: Generator
) -> tuple[Body, tuple[float, ...], Timeline]:
    """Return the body, the controls and the fault states under the faults of this tick."""
    commanded = controls[RUDDER], controls[ELEVATOR], controls[THRUST]
    drives, running = tailcone_faults.apply(
        Drives(vessel.rudder, vessel.elevator, commanded), faults.running, noise
    )
    faulted = Body(faults.model or vessel.model, drives.rudder, drives.elevator)
    is_changed = any(part is not nominal for part, nominal in zip(faulted, vessel, strict=True))
    others = controls[THRUST + 1 :]
    return (
        faulted if is_changed else vessel,
        (*drives.controls, *others),
        faults._replace(running=running),
    )


def _without_weight(vessel: Body, weight: DropWeight) -> Body:
    """Return the body after the drop weight was released."""
    position_m = weight.x_m, weight.y_m, weight.z_m
    light = body_faults.add_mass(vessel.model, -weight.mass_kg, position_m)
    return vessel._replace(model=light)


def _truth(now: PlantState) -> Truth:
    """Return the true motion in FRD and NED."""
    body, motion = state.body_and_motion(now.values)
    velocity, force, water = state.VELOCITY, state.FORCE, state.WATER_VELOCITY
    faults = now.faults.names
    return Truth(
        now.time_us,
        position_ned_m=flip(*body[POSITION]),
        attitude_q=flip_quaternion(*body[QUATERNION]),
        velocity_ned_mps=flip(*motion[velocity : velocity + 3]),
        rates_radps=flip(*body[RATES]),
        specific_force_mps2=flip(*motion[force : force + 3]),
        water_velocity_ned_mps=flip(*motion[water : water + 3]),
        rudder_rad=motion[state.RUDDER_RAD],
        elevator_rad=motion[state.ELEVATOR_RAD],
        propeller_rps=motion[state.SHAFT_RPS],
        pitch_disturbance_nm=-motion[state.PITCH_NM],
        yaw_disturbance_nm=-motion[state.YAW_NM],
        flooding=_FLOODED in faults,
        faults=faults,
        surface_m=motion[state.SURFACE_M],
        wave_pressure_pa=motion[state.WAVE_PA],
    )
