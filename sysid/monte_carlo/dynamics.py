"""Motion of a sampled vehicle in six degrees of freedom behind its tailcone, one tick at a time.

Rigid body and hydrodynamics are those of ``sitl.vehicle.dynamics``, integrated by a fourth-order
Runge-Kutta method with `SUBSTEPS` steps per tick.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import dynamics, propeller
from sitl.vehicle.jit import Native, entry_point, native
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import Water
from sysid.control_analysis.loop_transfer import TICK_S
from sysid.models.greybox import Actuator
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import actuator

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
    """Tailcone axes as in ``actuator``."""
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
        rudder=actuator.at_rest(rudder, SUBSTEP_S),
        elevator=actuator.at_rest(elevator, SUBSTEP_S),
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
    actuator.follow(body.rudder, rudder, rudder_rad, SUBSTEP_S, duct_rad[0])
    actuator.follow(body.elevator, elevator, elevator_rad, SUBSTEP_S, duct_rad[1])
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
    rudder_now = rudder[actuator.DUCT] + body.rudder.bias_rad
    elevator_now = elevator[actuator.DUCT] + body.elevator.bias_rad
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
