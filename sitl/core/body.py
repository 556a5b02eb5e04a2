"""Tailcone and rigid body of the vehicle over one tick: commands to duct angles to motion."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.jit import kernel
from sitl.core import tailcone
from sitl.core.tailcone import TailconeAxis
from sitl.vehicle.dynamics import derivative, rk4_step, specific_force, work_array
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.propeller import rps
from sitl.vehicle.vectors import Vector, Vector3
from sitl.vehicle.water import Water


class Body(NamedTuple):
    """The vehicle's parameters: rigid body with hydrodynamics, and the two tailcone axes."""

    model: VehicleModel
    rudder: TailconeAxis
    elevator: TailconeAxis


@kernel
def step_axes(
    body: Body,
    rudder: Vector,
    elevator: Vector,
    rudder_rad: float,
    elevator_rad: float,
    angles_rad: Vector,
    rudder_loss: Vector | None = None,
    elevator_loss: Vector | None = None,
) -> tuple[float, float]:
    """Step both tailcone axes through a tick under constant commands, in place.

    Parameters
    ----------
    body : Body
        The vehicle.
    rudder, elevator : ndarray
        Axis states, see ``core.tailcone``.
    rudder_rad, elevator_rad : float
        Commands, rad; positive turns the nose to starboard and up.
    angles_rad : ndarray, shape (2, substeps)
        Receives the mean true duct angles of each substep, rad.
    rudder_loss, elevator_loss : ndarray, shape (substeps,), optional
        Numbers in [0, 1) for lost motor steps; without them no step is lost.

    Returns
    -------
    tuple of 2 floats
        True duct angles of rudder and elevator at the end of the tick, rad.
    """
    tailcone.advance(body.rudder, rudder, rudder_rad, angles_rad[0], rudder_loss)
    tailcone.advance(body.elevator, elevator, elevator_rad, angles_rad[1], elevator_loss)
    return (
        tailcone.duct_angle_rad(body.rudder, rudder),
        tailcone.duct_angle_rad(body.elevator, elevator),
    )


@kernel
def integrate(
    body: Body,
    state: Vector,
    angles_rad: Vector,
    step_s: float,
    end_angles_rad: tuple[float, float],
    thrust: float,
    wrench: Vector,
    wrench_end: Vector,
    water: Water,
) -> tuple[float, Vector3, Vector3]:
    """Integrate the rigid body over a tick, in place, with one step per column of ``angles_rad``.

    Parameters
    ----------
    body : Body
        The vehicle.
    state : ndarray, shape (13,)
        State of ``vehicle.dynamics``, FLU in NWU; overwritten.
    angles_rad : ndarray, shape (2, steps)
        Mean duct angle of rudder and elevator in each step, from ``step_axes``.
    step_s : float
        Length of a step.
    end_angles_rad : tuple of 2 floats
        Duct angles of rudder and elevator at the end of the tick.
    thrust : float
        Fraction of full shaft speed, -1 to 1.
    wrench, wrench_end : ndarray, shape (6,)
        Disturbance during and at the end of the tick, FLU, N and N m.
    water : Water
        Water at the hull, constant during the tick.

    Returns
    -------
    tuple
        Shaft speed (rev/s), velocity over ground (NWU, m/s) and specific force at the origin (FLU,
        m/s2) at the end of the tick.

    Notes
    -----
    Classical Runge-Kutta of order four for d(state)/dt = f(state, rudder, elevator, n, wrench,
    water) of ``vehicle.dynamics``, with duct angles that are constant in each step (their mean).
    """
    model = body.model
    shaft_rps, work = rps(thrust, model), work_array()
    for k in range(angles_rad.shape[1]):
        rk4_step(
            state,
            angles_rad[0, k],
            angles_rad[1, k],
            shaft_rps,
            wrench,
            water,
            step_s,
            model,
            work,
        )
    slope = work[0]
    rudder_rad, elevator_rad = end_angles_rad
    derivative(state, rudder_rad, elevator_rad, shaft_rps, wrench_end, water, model, slope)
    return shaft_rps, (slope[0], slope[1], slope[2]), specific_force(state, slope, model)


@kernel
def is_clear(body: Body, state: Vector, water: Water) -> bool:
    """Return whether the vehicle is clear of surface, ice and floor, whatever its attitude.

    Its motion is smooth there, and one integration step of 20 ms is as good as four: contact has a
    natural frequency of 10 rad/s, and the buoyancy of a hull in the surface changes within its
    radius.

    Parameters
    ----------
    body : Body
        The vehicle.
    state : ndarray, shape (13,)
        State of ``vehicle.dynamics``, FLU in NWU.
    water : Water
        Water at the hull.

    Returns
    -------
    bool
        Whether every boundary is farther away than half the hull's length plus its radius.
    """
    hull = body.model.hydrostatics
    lid_m = min(water.ceiling_m, water.surface_m) - state[2]
    ground_m = (state[2] - water.floor_m) * water.floor_normal[2]
    return bool(min(lid_m, ground_m) > hull.half_length_m + hull.radius_m)
