"""Motion of a sampled vehicle in six degrees of freedom behind its tailcone, one tick at a time.

Rigid body and hydrodynamics are those of ``sitl.vehicle.dynamics``, integrated by a fourth-order
Runge-Kutta method with `SUBSTEPS` steps per tick. An axis of the tailcone is the model of
``greybox.duct_angles``, tick by tick: delay, second-order lag with rate limit, travel, play, bias.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import dynamics, propeller
from sitl.vehicle.jit import Native, entry_point, kernel, native
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import Water
from sysid.control_analysis.loop_transfer import TICK_S
from sysid.models import greybox
from sysid.models.greybox import Actuator
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]
Vector3 = tuple[float, float, float]

SUBSTEPS = 4
SUBSTEP_S = TICK_S / SUBSTEPS
"""Step of integration (s)."""
N_OBSERVED = 10
"""Number of ideal measurements.

Specific force (m/s^2), angular rate (rad/s) and magnetic field (gauss), each x, y, z in FRD, and
depth (m).
"""
FORCE, RATES, FIELD, DEPTH = slice(0, 3), slice(3, 6), slice(6, 9), 9
"""Indices of specific force, rates, magnetic field and depth in the measurements."""
ANGLE, RATE, DUCT, QUEUE = range(4)
"""Indices of an axis of the tailcone.

Motor angle (rad) and rate (rad/s), duct angle behind the play (rad), and the queue of delayed
commands (rad), newest first.
"""


class SimulatedBody(NamedTuple):
    """Vehicle model, tailcone, water and magnetic field."""

    model: VehicleModel
    rudder: Actuator
    elevator: Actuator
    water: Water
    field_nwu: Vector3
    """The earth's magnetic field in north-west-up axes (gauss)."""


class SimulatedVehicleState(NamedTuple):
    """State of a simulated vehicle; the arrays change at every tick."""

    body: Native
    state: Array
    """Position, attitude and velocity, (13,), as in ``sitl.vehicle.dynamics``."""
    rudder: Array
    elevator: Array
    """Tailcone axes, with the indices ANGLE, RATE, DUCT, QUEUE."""
    observed: Array
    """Ideal measurements after the last tick, (N_OBSERVED,)."""
    work: Array
    """Work array of the integration."""


def initial_state(
    vehicle: CandidateVehicle, water: Water, field_nwu: Vector3
) -> SimulatedVehicleState:
    """Return a vehicle at the surface, level, at rest, heading north."""
    rudder, elevator = vehicle.actuators["yaw"], vehicle.actuators["pitch"]
    body = SimulatedBody(
        model=vehicle.model, rudder=rudder, elevator=elevator, water=water, field_nwu=field_nwu
    )
    craft = SimulatedVehicleState(
        body=native(body),
        state=dynamics.state_at_rest(-vehicle.model.hydrostatics.radius_m),
        rudder=axis_at_rest(rudder, SUBSTEP_S),
        elevator=axis_at_rest(elevator, SUBSTEP_S),
        observed=np.empty(N_OBSERVED),
        work=dynamics.work_array(),
    )
    _observe(
        craft.body,
        craft.state,
        rudder.bias_rad,
        elevator.bias_rad,
        0.0,
        np.zeros(6),
        craft.observed,
        craft.work,
    )
    return craft


def advance(
    craft: SimulatedVehicleState,
    rudder_rad: float,
    elevator_rad: float,
    thrust: float,
    wrench: Array,
) -> Array:
    """Advance a vehicle by one tick.

    Parameters
    ----------
    craft : SimulatedVehicleState
        Vehicle; its arrays are updated.
    rudder_rad, elevator_rad : float
        Commands (rad).
    thrust : float
        Fraction of full thrust.
    wrench : ndarray
        Disturbing force and moment, (6,), N and N m in FLU.

    Returns
    -------
    ndarray
        Ideal measurements, (N_OBSERVED,).
    """
    body, state, rudder, elevator, observed, work = craft
    _advance(
        body, state, rudder, elevator, rudder_rad, elevator_rad, thrust, wrench, observed, work
    )
    return observed


def axis_at_rest(actuator: Actuator, substep_s: float) -> Array:
    """Return the axis at neutral, with a queue for the commands within its delay."""
    return np.zeros(QUEUE + int(actuator.delay_s / substep_s) + 2)


@kernel
def follow_command(
    actuator: Actuator, axis: Array, command_rad: float, substep_s: float, duct_rad: Array
) -> None:
    """Advance `axis` by the substeps of `duct_rad`; each element receives its mean duct angle.

    Lag: a'' = wn^2 (u(t - T) - a) - 2 zeta wn a', with rate limit (``greybox.step_actuator``). The
    command u is limited to the travel and delayed by linear interpolation. Play: the duct moves
    only when the motor is more than half the play away. Angles in rad.
    """
    c, s = greybox.lag_coefficients(actuator, substep_s)
    delay_steps, half_play = actuator.delay_s / substep_s, 0.5 * actuator.backlash_rad
    whole_steps = int(delay_steps)
    for k in range(duct_rad.size):
        for i in range(axis.size - 1, QUEUE, -1):
            axis[i] = axis[i - 1]
        axis[QUEUE] = min(max(command_rad, -actuator.travel_rad), actuator.travel_rad)
        newer_command, older_command = axis[QUEUE + whole_steps], axis[QUEUE + whole_steps + 1]
        target = newer_command + (delay_steps - whole_steps) * (older_command - newer_command)
        axis[ANGLE], axis[RATE] = greybox.step_actuator(
            actuator, axis[ANGLE], axis[RATE], target, c, s, substep_s
        )
        previous_duct = axis[DUCT]
        axis[DUCT] = min(max(previous_duct, axis[ANGLE] - half_play), axis[ANGLE] + half_play)
        duct_rad[k] = 0.5 * (previous_duct + axis[DUCT]) + actuator.bias_rad


@entry_point
def _advance(
    native_body: Native,
    state: Array,
    rudder: Array,
    elevator: Array,
    rudder_rad: float,
    elevator_rad: float,
    thrust: float,
    wrench: Array,
    observed: Array,
    work: Array,
) -> None:
    """Advance tailcone and body by one tick and update the measurements."""
    body = native_body.value
    duct_rad = np.empty((2, SUBSTEPS))
    follow_command(body.rudder, rudder, rudder_rad, SUBSTEP_S, duct_rad[0])
    follow_command(body.elevator, elevator, elevator_rad, SUBSTEP_S, duct_rad[1])
    shaft_rps = propeller.rps(thrust, body.model)
    for k in range(SUBSTEPS):
        dynamics.rk4_step(
            state,
            duct_rad[0, k],
            duct_rad[1, k],
            shaft_rps,
            wrench,
            body.water,
            SUBSTEP_S,
            body.model,
            work,
        )
    rudder_now = rudder[DUCT] + body.rudder.bias_rad
    elevator_now = elevator[DUCT] + body.elevator.bias_rad
    _observe(native_body, state, rudder_now, elevator_now, shaft_rps, wrench, observed, work)


@entry_point
def _observe(
    native_body: Native,
    state: Array,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    wrench: Array,
    observed: Array,
    work: Array,
) -> None:
    """Write the ideal measurements; FRD is FLU rotated by half a turn about x."""
    body, slope = native_body.value, work[0]
    dynamics.derivative(
        state, rudder_rad, elevator_rad, shaft_rps, wrench, body.water, body.model, slope
    )
    force = dynamics.specific_force(state, slope, body.model)
    north, west, up = dynamics.rotation(state)
    field = body.field_nwu
    for i in range(3):
        sign = 1.0 if i == 0 else -1.0
        observed[i] = sign * force[i]
        observed[3 + i] = sign * state[10 + i]
        observed[6 + i] = sign * (north[i] * field[0] + west[i] * field[1] + up[i] * field[2])
    observed[DEPTH] = -state[2]
