"""The plant: what a tick of the sea does to the vehicle. Pure but for the random streams handed in.

>>> sea = plant.build(config.load("caribou_truth"), scenario.load("calm"))
>>> rng = plant.random_streams(seed=1)
>>> state, sensors = plant.launch(sea, rng)
>>> state, sensors = plant.step(sea, state, actuators, rng)  # once a tick
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.random import Generator, SeedSequence, default_rng

from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.records import ActuatorFrame
from sitl.core import environment, initial_conditions, sensors, tailcone
from sitl.core.environment import Environment, Weather, moments
from sitl.core.environment.field import LocalWater
from sitl.core.environment.moments import Disturbance
from sitl.core.sensors import Sensors, SensorStreams, SensorSuite, SensorSuiteState
from sitl.core.sensors.noise import NoiseStream
from sitl.core.tailcone import AxisMotion, TailconeAxis
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.core.truth import Truth
from sitl.faults import body as weights
from sitl.faults import failure_injection, readings, timeline
from sitl.faults import tailcone as tail
from sitl.faults.catalogue import FaultError
from sitl.faults.failure_injection import InjectionResult
from sitl.faults.tailcone import Drives
from sitl.faults.timeline import Timeline
from sitl.scenario import Scenario, StartTable
from sitl.scenario_types import ScenarioError
from sitl.vehicle import build_model
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.dynamics import (
    POSITION,
    QUATERNION,
    derivative,
    rk4_step,
    specific_force,
    work_array,
)
from sitl.vehicle.jit import Native, Vector, Vector3, kernel, native
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.propeller import rps
from sitl.vehicle.water import Water

RUDDER, ELEVATOR, THRUST = 0, 1, 2
"""Channels of ``ActuatorFrame.controls``."""
RATES = slice(10, 13)
"""Part of the body state, FLU."""


class Body(NamedTuple):
    """What obeys the laws of physics: body and tailcone."""

    model: VehicleModel
    rudder: TailconeAxis
    elevator: TailconeAxis


class Plant(NamedTuple):
    """All that stays the same through a run."""

    vessel: Body
    native: Native
    """The same, for the kernels; ``with_body`` changes both."""
    sea: Environment
    suite: SensorSuite
    start: StartTable
    clamped: bool
    """Held where she lies."""
    tick_us: int
    tick_s: float
    substeps: int
    """The pace's figures, which every tick asks for."""
    faults: Timeline
    """That are to come."""


class PlantState(NamedTuple):
    """All that changes from tick to tick. The arrays are never written to once a state holds
    them."""

    time_us: int
    body: Vector
    """Shape (13,), as ``vehicle.dynamics`` has it: FLU in NWU."""
    rudder: Vector
    elevator: Vector
    disturbance: Disturbance
    weather: Weather
    instruments: SensorSuiteState
    truth: Truth
    """The same in the axes of everyone else."""
    faults: Timeline


class RandomStreams(NamedTuple):
    """The random streams of a run."""

    slow: Generator
    wave: Generator
    sensors: SensorStreams
    rudder: Generator
    elevator: Generator
    """Of the steps that the motors lose."""
    faults: Generator
    swell: Generator
    drift: Generator
    """Of the run's waves, and of its current's variation."""


def build(vehicle: VehicleConfig, scenario: Scenario, pace: Timestep = DEFAULT_TIMESTEP) -> Plant:
    """Put a vehicle into a scenario. Raises VehicleError or ScenarioError when one of them is
    impossible."""
    if scenario.rig.encoder:
        instruments = replace(vehicle.instruments, encoder=scenario.rig.encoder)
        vehicle = replace(vehicle, instruments=instruments)
    model = build_model.build(vehicle)
    try:
        weights.refuse_impossible(model, scenario.faults)
    except FaultError as error:
        raise ScenarioError(f"scenario {scenario.title}: fault: {error}") from None
    vessel = Body(
        model=model,
        rudder=tailcone.of_vehicle(
            vehicle.tailcone, vehicle.tailcone.rudder_bias_deg, pace.substep_s
        ),
        elevator=tailcone.of_vehicle(
            vehicle.tailcone, vehicle.tailcone.elevator_bias_deg, pace.substep_s
        ),
    )
    return Plant(
        vessel=vessel,
        native=native(vessel),
        sea=environment.build(
            scenario,
            model.hydrostatics.gravity_mps2,
            pace.tick_s,
            model.hydrostatics.half_length_m,
            vehicle.water.density_kgpm3,
        ),
        suite=sensors.build(vehicle, model.propeller.full_rps, pace.tick_us, brisk=pace.brisk),
        start=scenario.start,
        clamped=scenario.rig.clamped,
        tick_us=pace.tick_us,
        tick_s=pace.tick_s,
        substeps=pace.substeps,
        faults=timeline.schedule(scenario.faults),
    )


def with_body(plant: Plant, vessel: Body) -> Plant:
    """The same place and time with another vessel in it."""
    return plant._replace(vessel=vessel, native=native(vessel))


def random_streams(seed: int) -> RandomStreams:
    """Independent streams of one seed: what one of them draws leaves the others as they were."""
    slow, wave, *instruments, rudder, elevator, faults, swell, drift = [
        default_rng(child) for child in SeedSequence(seed).spawn(7 + len(SensorStreams._fields))
    ]
    return RandomStreams(
        slow,
        wave,
        SensorStreams(*map(NoiseStream, instruments)),
        rudder,
        elevator,
        faults,
        swell,
        drift,
    )


def initial_state(plant: Plant, rng: RandomStreams) -> tuple[PlantState, Sensors]:
    """The state at vehicle time zero, with what the instruments say of it."""
    disturbance = moments.sample_stationary(rng.slow, rng.wave)
    weather = environment.initial_weather(plant.sea, rng.swell, rng.drift)
    model, *axes = plant.vessel
    rudder, elevator = map(tailcone.axis_at_rest, axes)
    start, here = initial_conditions.initial_body_state(model, plant.start, plant.sea, weather)
    body, truth = _step_body(plant, 0, start, rudder, elevator, 0.0, disturbance, disturbance, here)
    instruments = sensors.initial_state(plant.suite, plant.start.battery_pct / 100.0, rng.sensors)
    instruments, said = sensors.sample(plant.suite, truth, plant.sea, instruments, rng.sensors)
    return PlantState(
        0, body, rudder.axis, elevator.axis, disturbance, weather, instruments, truth, plant.faults
    ), said


def step(
    plant: Plant, state: PlantState, actuators: ActuatorFrame, rng: RandomStreams
) -> tuple[PlantState, Sensors]:
    """The state one tick later under ``actuators``, with what the instruments say of it."""
    time_us = state.time_us + plant.tick_us
    faults = timeline.advance(state.faults, plant.vessel.model, time_us)
    controls = actuators.controls
    if faults.running:
        plant, controls, faults = _apply_faults(plant, controls, faults, rng.faults)
    rudder, elevator = _step_actuators(plant, state, controls, rng)
    thrust = _limit_control(controls[THRUST])
    disturbance = moments.advance(plant.sea.moments, state.disturbance, rng.slow, rng.wave)
    weather = environment.advance(plant.sea, state.weather, rng.drift)
    if plant.clamped:
        body, truth = (
            state.body,
            _hold_clamped(state.truth, time_us, rudder, elevator, rps(thrust, plant.vessel.model)),
        )
    else:
        here = environment.sample_water(
            plant.sea, weather, state.body, time_us * 1e-6, plant.tick_s
        )
        body, truth = _step_body(
            plant,
            time_us,
            state.body,
            rudder,
            elevator,
            thrust,
            state.disturbance,
            disturbance,
            here,
        )
    if faults.running:
        truth = truth._replace(flooding="leak wet" in faults.names, faults=faults.names)
    instruments, said = sensors.sample(
        plant.suite, truth, plant.sea, state.instruments, rng.sensors
    )
    if faults.running:
        said, running = readings.apply(said, faults.running, time_us, plant.tick_s, rng.faults)
        faults = faults._replace(running=running)
    return PlantState(
        time_us, body, rudder.axis, elevator.axis, disturbance, weather, instruments, truth, faults
    ), said


def inject_failure(state: PlantState, verdict: InjectionResult) -> PlantState:
    """The state after an accepted order of a ground station: what it breaks breaks at the next
    tick."""
    return state._replace(
        faults=failure_injection.apply_order(state.faults, verdict, state.time_us)
    )


def _apply_faults(
    plant: Plant, controls: tuple[float, ...], faults: Timeline, noise: Generator
) -> tuple[Plant, tuple[float, ...], Timeline]:
    """The vehicle and what reaches her drives under the faults of this tick."""
    asked, vessel = (controls[RUDDER], controls[ELEVATOR], controls[THRUST]), plant.vessel
    drives, running = tail.apply(
        Drives(vessel.rudder, vessel.elevator, asked), faults.running, noise
    )
    hurt = Body(faults.model or vessel.model, drives.rudder, drives.elevator)
    if any(part is not sound for part, sound in zip(hurt, vessel, strict=True)):
        plant = with_body(plant, hurt)
    return plant, drives.controls, faults._replace(running=running)


def _step_actuators(
    plant: Plant, state: PlantState, controls: tuple[float, ...], rng: RandomStreams
) -> tuple[AxisMotion, AxisMotion]:
    """Rudder and elevator one tick later."""
    _, rudder, elevator = plant.vessel
    substeps = plant.substeps
    rudder_state, elevator_state, angles_rad = (
        state.rudder.copy(),
        state.elevator.copy(),
        np.empty((2, substeps)),
    )
    _step_axes(
        plant.native,
        rudder_state,
        elevator_state,
        angles_rad,
        _limit_control(controls[RUDDER]),
        _limit_control(controls[ELEVATOR]),
        tailcone.step_loss_draws(rudder, rng.rudder, substeps),
        tailcone.step_loss_draws(elevator, rng.elevator, substeps),
    )
    return (
        AxisMotion(rudder_state, angles_rad[0], tailcone.duct_angle_rad(rudder, rudder_state)),
        AxisMotion(
            elevator_state, angles_rad[1], tailcone.duct_angle_rad(elevator, elevator_state)
        ),
    )


def _limit_control(control: float) -> float:
    """A control within [-1, 1]; not-a-number means no demand, as foreign autopilots send it for
    idle channels."""
    return 0.0 if control != control else max(-1.0, min(1.0, control))


def _step_body(
    plant: Plant,
    time_us: int,
    body: Vector,
    rudder: AxisMotion,
    elevator: AxisMotion,
    thrust: float,
    before: Disturbance,
    after: Disturbance,
    here: LocalWater,
) -> tuple[Vector, Truth]:
    """The body after as many substeps as the duct turned for, with its truth at ``time_us``.

    The disturbance stands still at ``before`` meanwhile; ``after`` is the one that the
    accelerometer feels at the end. The water stands still as it will be at the end, where the body
    will be: that is half a tick ahead, on the mean."""
    moved, sea = body.copy(), plant.sea
    shaft_rps, velocity, force = _integrate(
        moved,
        rudder.substeps_rad,
        elevator.substeps_rad,
        rudder.end_rad,
        elevator.end_rad,
        thrust,
        _disturbance_wrench(sea, before),
        _disturbance_wrench(sea, after),
        here.water,
        plant.native,
        _WORK,
    )
    values = moved.tolist()
    pitch_nm, yaw_nm = moments.moments_flu_nm(sea.moments, after)
    truth = Truth(
        time_us,
        position_ned_m=flip(*values[POSITION]),
        attitude_q=flip_quaternion(*values[QUATERNION]),
        velocity_ned_mps=flip(*velocity),
        rates_radps=flip(*values[RATES]),
        specific_force_mps2=flip(*force),
        water_velocity_ned_mps=flip(*here.water.velocity_mps),
        rudder_rad=rudder.end_rad,
        elevator_rad=elevator.end_rad,
        propeller_rps=shaft_rps,
        pitch_disturbance_nm=-pitch_nm,
        yaw_disturbance_nm=-yaw_nm,
        surface_m=here.water.surface_m,
        wave_pressure_pa=here.wave_pressure_pa,
    )
    return moved, truth


def _hold_clamped(
    truth: Truth, time_us: int, rudder: AxisMotion, elevator: AxisMotion, shaft_rps: float
) -> Truth:
    """The truth of a body that nothing moves: only duct and propeller turn."""
    return truth._replace(
        time_us=time_us,
        rudder_rad=rudder.end_rad,
        elevator_rad=elevator.end_rad,
        propeller_rps=shaft_rps,
    )


def _disturbance_wrench(sea: Environment, disturbance: Disturbance) -> Vector:
    pitch_nm, yaw_nm = moments.moments_flu_nm(sea.moments, disturbance)
    return np.array((0.0, 0.0, 0.0, 0.0, pitch_nm, yaw_nm))


@kernel
def _step_axes(
    vessel: Native,
    rudder: Vector,
    elevator: Vector,
    angles_rad: Vector,
    rudder_control: float,
    elevator_control: float,
    rudder_luck: Vector | None,
    elevator_luck: Vector | None,
) -> None:
    """Both axes of the tailcone through the substeps of a tick; states and ``angles_rad``, (2, n),
    are changed."""
    first, second = vessel.value.rudder, vessel.value.elevator
    tailcone.advance(first, rudder, rudder_control * first.travel_rad, angles_rad[0], rudder_luck)
    tailcone.advance(
        second, elevator, elevator_control * second.travel_rad, angles_rad[1], elevator_luck
    )


@kernel
def _integrate(
    body: Vector,
    rudder_rad: Vector,
    elevator_rad: Vector,
    rudder_end_rad: float,
    elevator_end_rad: float,
    thrust: float,
    wrench: Vector,
    wrench_end: Vector,
    water: Water,
    vessel: Native,
    work: Vector,
) -> tuple[float, Vector3, Vector3]:
    """All substeps of a tick and what there is to observe at its end, in one call; ``body`` is
    changed in place.

    Returns shaft speed (rev/s), velocity over ground (NWU, m/s) and specific force at the origin
    (FLU, m/s2)."""
    model, substep_s = vessel.value.model, vessel.value.rudder.substep_s
    shaft_rps = rps(thrust, model)
    for k in range(rudder_rad.size):
        rk4_step(
            body, rudder_rad[k], elevator_rad[k], shaft_rps, wrench, water, substep_s, model, work
        )
    slope = work[0]
    derivative(body, rudder_end_rad, elevator_end_rad, shaft_rps, wrench_end, water, model, slope)
    return shaft_rps, (slope[0], slope[1], slope[2]), specific_force(body, slope, model)


_WORK = work_array()
"""Scratch space of the integrator: overwritten by every call, read by none."""
