"""The plant: one tick of actuators, body, water and sensors, as a pure function.

The only side effect is that the given random streams advance.

>>> simulated = plant.build(config.load("caribou_truth"), scenario.load("calm"))
>>> rng = plant.random_streams(seed=1)
>>> state, sensors = plant.initial_state(simulated, rng)
>>> state, sensors = plant.step(simulated, state, actuators, rng)  # once per tick
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.random import Generator, SeedSequence, default_rng

from mavlink_io.frames import flip, flip_quaternion
from mavlink_io.jit import Native, native
from mavlink_io.records import ActuatorFrame
from sitl.core import body as core_body
from sitl.core import environment, initial_conditions, sensors, tailcone
from sitl.core.body import Body, TailconeMotion
from sitl.core.environment import Environment, Weather, moments
from sitl.core.environment.field import LocalWater
from sitl.core.environment.moments import Disturbance
from sitl.core.sensors import Sensors, SensorStreams, SensorSuite, SensorSuiteState
from sitl.core.sensors.noise import NoiseStream
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
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.dynamics import POSITION, QUATERNION
from sitl.vehicle.propeller import rps
from sitl.vehicle.vectors import Vector

RUDDER, ELEVATOR, THRUST = 0, 1, 2
"""Indices of ``ActuatorFrame.controls``."""
RATES = slice(10, 13)
"""Angular rates in the body state, FLU, rad/s."""


class Plant(NamedTuple):
    """Parameters that are constant during a run."""

    vessel: Body
    native: Native
    """Copy of ``vessel`` for compiled code; change both with ``with_body``."""
    sea: Environment
    suite: SensorSuite
    start: StartTable
    clamped: bool
    """Whether the body is held in its initial state."""
    tick_us: int
    tick_s: float
    substeps: int
    """Integration steps per tick."""
    faults: Timeline
    """Scheduled faults."""


class PlantState(NamedTuple):
    """Variables of a run at one tick; the arrays of a state are never modified."""

    time_us: int
    """Vehicle time."""
    body: Vector
    """State of ``vehicle.dynamics``, shape (13,), FLU in NWU."""
    rudder: Vector
    elevator: Vector
    """States of the tailcone axes, see ``core.tailcone``."""
    disturbance: Disturbance
    weather: Weather
    instruments: SensorSuiteState
    truth: Truth
    """True motion in FRD and NED."""
    faults: Timeline


class RandomStreams(NamedTuple):
    """Independent random streams of a run."""

    slow: Generator
    wave: Generator
    """Slow and wave-band disturbance moments."""
    sensors: SensorStreams
    rudder: Generator
    elevator: Generator
    """Lost motor steps of the axes."""
    faults: Generator
    swell: Generator
    """Phases and directions of the waves."""
    drift: Generator
    """Variation of the current."""


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
    model = build_model.build(vehicle)
    try:
        body_faults.check_feasible(model, scenario.faults)
    except FaultError as error:
        raise ScenarioError(f"scenario {scenario.title}: fault: {error}") from None
    vessel = Body(
        model=model,
        rudder=tailcone.from_config(
            vehicle.tailcone, vehicle.tailcone.rudder_bias_deg, timestep.substep_s
        ),
        elevator=tailcone.from_config(
            vehicle.tailcone, vehicle.tailcone.elevator_bias_deg, timestep.substep_s
        ),
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
        suite=sensors.build(
            vehicle,
            model.propeller.full_rps,
            timestep.tick_us,
            imu_every_tick=timestep.imu_every_tick,
        ),
        start=scenario.start,
        clamped=scenario.rig.clamped,
        tick_us=timestep.tick_us,
        tick_s=timestep.tick_s,
        substeps=timestep.substeps,
        faults=timeline.schedule(scenario.faults),
    )


def with_body(plant: Plant, vessel: Body) -> Plant:
    """Return the plant with another body; site, sensors and time step are unchanged."""
    return plant._replace(vessel=vessel, native=native(vessel))


def random_streams(seed: int) -> RandomStreams:
    """Return the random streams of a seed; draws from one stream do not affect the others.

    Parameters
    ----------
    seed : int
        Seed of the simulation.

    Returns
    -------
    RandomStreams
        Generators of the environment, the sensors, the actuators and the faults.
    """
    slow, wave, *instruments, rudder, elevator, faults, swell, drift = [
        default_rng(child) for child in SeedSequence(seed).spawn(7 + len(SensorStreams._fields))
    ]
    return RandomStreams(
        slow=slow,
        wave=wave,
        sensors=SensorStreams(*map(NoiseStream, instruments)),
        rudder=rudder,
        elevator=elevator,
        faults=faults,
        swell=swell,
        drift=drift,
    )


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
    disturbance = moments.sample_stationary(rng.slow, rng.wave)
    weather = environment.initial_weather(plant.sea, rng.swell, rng.drift)
    tail = core_body.motion_at_rest(plant.vessel)
    start, local_water = initial_conditions.initial_body_state(
        plant.vessel.model, plant.start, plant.sea, weather
    )
    body, truth = _step_body(plant, 0, start, tail, 0.0, disturbance, disturbance, local_water)
    instruments = sensors.initial_state(plant.suite, plant.start.battery_pct / 100.0, rng.sensors)
    instruments, output = sensors.sample(plant.suite, truth, plant.sea, instruments, rng.sensors)
    return PlantState(
        time_us=0,
        body=body,
        rudder=tail.rudder,
        elevator=tail.elevator,
        disturbance=disturbance,
        weather=weather,
        instruments=instruments,
        truth=truth,
        faults=plant.faults,
    ), output


def step(
    plant: Plant, state: PlantState, actuators: ActuatorFrame, rng: RandomStreams
) -> tuple[PlantState, Sensors]:
    """Advance the plant by one tick.

    Parameters
    ----------
    plant : Plant
        Parameters of the run.
    state : PlantState
        State at the start of the tick.
    actuators : ActuatorFrame
        Controls in [-1, 1], constant during the tick: rudder, elevator, thrust.
    rng : RandomStreams
        Random streams of the run; they advance.

    Returns
    -------
    state : PlantState
        State at the end of the tick.
    sensors : Sensors
        Sensor output at the end of the tick.
    """
    time_us = state.time_us + plant.tick_us
    faults = timeline.advance(state.faults, plant.vessel.model, time_us)
    controls = actuators.controls
    if faults.running:
        plant, controls, faults = _apply_faults(plant, controls, faults, rng.faults)
    tail = _step_actuators(plant, state, controls, rng)
    thrust = _limit_control(controls[THRUST])
    disturbance = moments.advance(plant.sea.moments, state.disturbance, rng.slow, rng.wave)
    weather = environment.advance(plant.sea, state.weather, rng.drift)
    if plant.clamped:
        body, truth = (
            state.body,
            _hold_clamped(state.truth, time_us, tail, rps(thrust, plant.vessel.model)),
        )
    else:
        local_water = environment.sample_water(
            plant.sea, weather, state.body, time_us * 1e-6, plant.tick_s
        )
        body, truth = _step_body(
            plant, time_us, state.body, tail, thrust, state.disturbance, disturbance, local_water
        )
    if faults.running:
        truth = truth._replace(flooding="leak wet" in faults.names, faults=faults.names)
    instruments, output = sensors.sample(
        plant.suite, truth, plant.sea, state.instruments, rng.sensors
    )
    if faults.running:
        output, running = readings.apply(output, faults.running, time_us, plant.tick_s, rng.faults)
        faults = faults._replace(running=running)
    return PlantState(
        time_us=time_us,
        body=body,
        rudder=tail.rudder,
        elevator=tail.elevator,
        disturbance=disturbance,
        weather=weather,
        instruments=instruments,
        truth=truth,
        faults=faults,
    ), output


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
    plant: Plant, controls: tuple[float, ...], faults: Timeline, noise: Generator
) -> tuple[Plant, tuple[float, ...], Timeline]:
    """Return the plant, the controls and the fault states under the faults of this tick."""
    commanded, vessel = (controls[RUDDER], controls[ELEVATOR], controls[THRUST]), plant.vessel
    drives, running = tailcone_faults.apply(
        Drives(vessel.rudder, vessel.elevator, commanded), faults.running, noise
    )
    faulted = Body(faults.model or vessel.model, drives.rudder, drives.elevator)
    if any(part is not nominal for part, nominal in zip(faulted, vessel, strict=True)):
        plant = with_body(plant, faulted)
    return plant, drives.controls, faults._replace(running=running)


def _step_actuators(
    plant: Plant, state: PlantState, controls: tuple[float, ...], rng: RandomStreams
) -> TailconeMotion:
    """Return the motion of rudder and elevator during a tick."""
    _, rudder, elevator = plant.vessel
    rudder_state, elevator_state = state.rudder.copy(), state.elevator.copy()
    angles_rad = np.empty((2, plant.substeps))
    end_rad = core_body.step_axes(
        plant.native,
        rudder_state,
        elevator_state,
        _limit_control(controls[RUDDER]) * rudder.travel_rad,
        _limit_control(controls[ELEVATOR]) * elevator.travel_rad,
        angles_rad,
        tailcone.step_loss_draws(rudder, rng.rudder, plant.substeps),
        tailcone.step_loss_draws(elevator, rng.elevator, plant.substeps),
    )
    return TailconeMotion(
        rudder=rudder_state, elevator=elevator_state, angles_rad=angles_rad, end_rad=end_rad
    )


def _limit_control(control: float) -> float:
    """Limit a control to [-1, 1]; NaN, which some autopilots send for idle channels, means 0."""
    return 0.0 if control != control else max(-1.0, min(1.0, control))


def _step_body(
    plant: Plant,
    time_us: int,
    body: Vector,
    tail: TailconeMotion,
    thrust: float,
    before: Disturbance,
    after: Disturbance,
    local_water: LocalWater,
) -> tuple[Vector, Truth]:
    """Integrate the body over the substeps of a tick; return its state and the true motion.

    Disturbance moments are constant at ``before`` during the tick; the accelerometer at the end of
    the tick measures with ``after``. The water is constant during the tick. It was sampled for the
    end of the tick at the position extrapolated to that time, half a tick ahead of the mean.
    """
    new_body, sea = body.copy(), plant.sea
    shaft_rps, velocity, force = core_body.integrate(
        plant.native,
        new_body,
        tail.angles_rad,
        plant.vessel.rudder.substep_s,
        tail.end_rad,
        thrust,
        _disturbance_wrench(sea, before),
        _disturbance_wrench(sea, after),
        local_water.water,
    )
    values = new_body.tolist()
    pitch_nm, yaw_nm = moments.moments_flu_nm(sea.moments, after)
    truth = Truth(
        time_us,
        position_ned_m=flip(*values[POSITION]),
        attitude_q=flip_quaternion(*values[QUATERNION]),
        velocity_ned_mps=flip(*velocity),
        rates_radps=flip(*values[RATES]),
        specific_force_mps2=flip(*force),
        water_velocity_ned_mps=flip(*local_water.water.velocity_mps),
        rudder_rad=tail.end_rad[0],
        elevator_rad=tail.end_rad[1],
        propeller_rps=shaft_rps,
        pitch_disturbance_nm=-pitch_nm,
        yaw_disturbance_nm=-yaw_nm,
        surface_m=local_water.water.surface_m,
        wave_pressure_pa=local_water.wave_pressure_pa,
    )
    return new_body, truth


def _hold_clamped(truth: Truth, time_us: int, tail: TailconeMotion, shaft_rps: float) -> Truth:
    """Return the true motion of a clamped body: only duct and propeller move."""
    return truth._replace(
        time_us=time_us,
        rudder_rad=tail.end_rad[0],
        elevator_rad=tail.end_rad[1],
        propeller_rps=shaft_rps,
    )


def _disturbance_wrench(sea: Environment, disturbance: Disturbance) -> Vector:
    """Return the disturbance as generalised force (X, Y, Z, K, M, N), FLU, N and N m."""
    pitch_nm, yaw_nm = moments.moments_flu_nm(sea.moments, disturbance)
    return np.array((0.0, 0.0, 0.0, 0.0, pitch_nm, yaw_nm))
