"""Motion of a sampled vehicle in six degrees of freedom behind its tailcone, one tick at a time.

Tailcone and body are those of the simulator (``sitl.core.body``). A tick has `SUBSTEPS` integration
steps; clear of surface and floor the body needs only one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import Native, entry_point, kernel, native
from mavlink_io.tick import TICK_S
from sitl.core import tailcone
from sitl.core.body import Body, integrate, is_clear, step_axes
from sitl.vehicle import dynamics
from sitl.vehicle.vectors import Vector3
from sitl.vehicle.water import Water
from sysid.models import greybox
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane

Array = NDArray[np.float64]

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


class SampledSurroundings(NamedTuple):
    """Water and magnetic field."""

    water: Water
    field_nwu: Vector3
    """The earth's magnetic field in north-west-up axes (gauss)."""


class SimulatedVehicleState(NamedTuple):
    """State of a simulated vehicle; the arrays change at every tick."""

    body: Native
    """The ``sitl.core.body.Body``."""
    surroundings: Native
    state: Array
    """Position, attitude and velocity, (13,), as in ``sitl.vehicle.dynamics``."""
    rudder: Array
    elevator: Array
    """Tailcone axes as in ``sitl.core.tailcone``."""
    observed: Array
    """Ideal measurements after the last tick, (N_OBSERVED,)."""
    fine: bool
    """Whether the body takes `SUBSTEPS` steps in every tick, also clear of surface and floor."""


def initial_state(
    vehicle: CandidateVehicle, water: Water, field_nwu: Vector3, *, fine_steps: bool = False
) -> SimulatedVehicleState:
    """Return a vehicle at the surface, level, at rest, heading north.

    With ``fine_steps`` the body takes `SUBSTEPS` integration steps in every tick.
    """
    body = Body(
        model=vehicle.model,
        rudder=greybox.discretise(vehicle.actuators[Plane.YAW], SUBSTEP_S),
        elevator=greybox.discretise(vehicle.actuators[Plane.PITCH], SUBSTEP_S),
    )
    craft = SimulatedVehicleState(
        body=native(body),
        surroundings=native(SampledSurroundings(water=water, field_nwu=field_nwu)),
        state=dynamics.state_at_rest(-vehicle.model.hydrostatics.radius_m),
        rudder=tailcone.at_rest(body.rudder),
        elevator=tailcone.at_rest(body.elevator),
        observed=np.empty(N_OBSERVED),
        fine=fine_steps,
    )
    step(*craft, 0, 0.0, 0.0, 0.0, np.zeros(6))
    return craft


def horizontal_m(craft: SimulatedVehicleState) -> complex:
    """Return the horizontal position, north + i east of the start (m)."""
    return complex(craft.state[0], -craft.state[1])


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
    step(*craft, SUBSTEPS, rudder_rad, elevator_rad, thrust, wrench)
    return craft.observed


@entry_point
def step(
    body: Native,
    surroundings: Native,
    state: Array,
    rudder: Array,
    elevator: Array,
    observed: Array,
    fine: bool,
    substeps: int,
    rudder_rad: float,
    elevator_rad: float,
    thrust: float,
    wrench: Array,
) -> None:
    """Advance tailcone and body by a number of substeps, and write the ideal measurements."""
    duct_rad, at_sea = np.empty((2, substeps)), surroundings.value
    commands = rudder_rad, elevator_rad, thrust
    move(body.value, at_sea, state, rudder, elevator, observed, fine, duct_rad, commands, wrench)


@kernel
def move(
    body: Body,
    surroundings: SampledSurroundings,
    state: Array,
    rudder: Array,
    elevator: Array,
    observed: Array,
    fine: bool,
    duct_rad: Array,
    commands: Vector3,
    wrench: Array,
) -> None:
    """Advance tailcone and body by a tick, and write the ideal measurements.

    The columns of ``duct_rad``, which is overwritten, are its substeps; the commands are rudder and
    elevator (rad) and thrust.
    """
    # Measurements in FRD, which is FLU rotated by half a turn about x: specific force (m/s2) of
    # ``integrate``, rates (rad/s), magnetic field R^T B (gauss), depth -z (m).
    rudder_rad, elevator_rad, thrust = commands
    end_rad = step_axes(body, rudder, elevator, rudder_rad, elevator_rad, duct_rad)
    water, field = surroundings.water, surroundings.field_nwu
    step_s, substeps = SUBSTEP_S, duct_rad.shape[1]
    if not fine and substeps > 1 and is_clear(body, state, water):
        for axis in range(2):
            duct_rad[axis, 0] = duct_rad[axis].mean()
        duct_rad, step_s = duct_rad[:, :1], substeps * SUBSTEP_S
    _, _, force = integrate(body, state, duct_rad, step_s, end_rad, thrust, wrench, wrench, water)
    north, west, up = dynamics.rotation(state)
    for i in range(3):
        sign = 1.0 if i == 0 else -1.0
        observed[i] = sign * force[i]
        observed[3 + i] = sign * state[10 + i]
        observed[6 + i] = sign * (north[i] * field[0] + west[i] * field[1] + up[i] * field[2])
    observed[DEPTH] = -state[2]
