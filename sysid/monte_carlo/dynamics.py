"""A drawn vehicle in six degrees of freedom behind her identified tailcone: one tick of motion, and
what it shows."""

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
N_OBSERVED = 10
"""What an observer aboard could tell: specific force, rates, field (each x, y, z in FRD) and
depth."""
FORCE, RATES, FIELD, DEPTH = slice(0, 3), slice(3, 6), slice(6, 9), 9


class SimulatedBody(NamedTuple):
    """What obeys the laws of physics, and where."""

    model: VehicleModel
    rudder: Actuator
    elevator: Actuator
    water: Water
    field_nwu: Vector3
    """The earth's magnetic field, gauss."""


class SimulatedVehicleState(NamedTuple):
    """A vehicle on her way; the arrays change at every tick."""

    vessel: Native
    state: Array
    """(13,), as ``sitl.vehicle.dynamics`` has it."""
    rudder: Array
    elevator: Array
    """As ``tail`` has them."""
    seen: Array
    """(SEEN,) after the last tick."""
    work: Array


def initial_state(
    vehicle: CandidateVehicle, water: Water, field_nwu: Vector3
) -> SimulatedVehicleState:
    """Awash, level, at rest, heading north."""
    rudder, elevator = vehicle.actuators["yaw"], vehicle.actuators["pitch"]
    vessel = SimulatedBody(vehicle.model, rudder, elevator, water, field_nwu)
    craft = SimulatedVehicleState(
        native(vessel),
        dynamics.state_at_rest(-vehicle.model.hydrostatics.radius_m),
        actuator.at_rest(rudder, SUBSTEP_S),
        actuator.at_rest(elevator, SUBSTEP_S),
        np.empty(N_OBSERVED),
        dynamics.work_array(),
    )
    _observe(
        craft.vessel,
        craft.state,
        rudder.bias_rad,
        elevator.bias_rad,
        0.0,
        np.zeros(6),
        craft.seen,
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
    """What is seen a tick later under these commands and an extra ``wrench``, (6,), FLU, N and N
    m."""
    vessel, state, rudder, elevator, seen, work = craft
    _advance(vessel, state, rudder, elevator, rudder_rad, elevator_rad, thrust, wrench, seen, work)
    return seen


@entry_point
def _advance(
    native_vessel: Native,
    state: Array,
    rudder: Array,
    elevator: Array,
    rudder_rad: float,
    elevator_rad: float,
    thrust: float,
    wrench: Array,
    seen: Array,
    work: Array,
) -> None:
    vessel = native_vessel.value
    duct_rad = np.empty((2, SUBSTEPS))
    actuator.follow(vessel.rudder, rudder, rudder_rad, SUBSTEP_S, duct_rad[0])
    actuator.follow(vessel.elevator, elevator, elevator_rad, SUBSTEP_S, duct_rad[1])
    shaft_rps = propeller.rps(thrust, vessel.model)
    for k in range(SUBSTEPS):
        dynamics.rk4_step(
            state,
            duct_rad[0, k],
            duct_rad[1, k],
            shaft_rps,
            wrench,
            vessel.water,
            SUBSTEP_S,
            vessel.model,
            work,
        )
    rudder_now = rudder[actuator.DUCT] + vessel.rudder.bias_rad
    elevator_now = elevator[actuator.DUCT] + vessel.elevator.bias_rad
    _observe(native_vessel, state, rudder_now, elevator_now, shaft_rps, wrench, seen, work)


@entry_point
def _observe(
    native_vessel: Native,
    state: Array,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    wrench: Array,
    seen: Array,
    work: Array,
) -> None:
    """Perfect instruments, into ``seen``: the vehicle's axes turned by half a turn about x."""
    vessel, slope = native_vessel.value, work[0]
    dynamics.derivative(
        state, rudder_rad, elevator_rad, shaft_rps, wrench, vessel.water, vessel.model, slope
    )
    force = dynamics.specific_force(state, slope, vessel.model)
    north, west, up = dynamics.rotation(state)
    field = vessel.field_nwu
    for i in range(3):
        sign = 1.0 if i == 0 else -1.0
        seen[i] = sign * force[i]
        seen[3 + i] = sign * state[10 + i]
        seen[6 + i] = sign * (north[i] * field[0] + west[i] * field[1] + up[i] * field[2])
    seen[DEPTH] = -state[2]
