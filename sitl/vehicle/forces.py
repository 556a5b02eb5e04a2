"""Sum of the forces on the vehicle, for the simulator and for the models that identification fits.

Axes are body FLU (x forward, y port, z up) with the origin on the hull axis at mid-length; a wrench
is (X, Y, Z, K, M, N) about the origin, N and N m. The sum is the right-hand side of the equation of
motion in ``dynamics``, without the disturbance:

    tau = -C(nu) nu + tau_hydrostatic + tau_crossflow + tau_hull + tau_tail + tau_boundary
          + tau_interaction

(Fossen 2021, sec. 10.3; the paper, "Overall Vehicle Modeling").
"""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.jit import kernel
from sitl.vehicle import duct, fins, hydrodynamics, propeller, restoring
from sitl.vehicle.model import Inertia, VehicleModel
from sitl.vehicle.vectors import Vector3, Wrench

NO_WRENCH = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class HullFlow(NamedTuple):
    """Motion of the hull through the water, and its place under the surface."""

    nu: Wrench
    """Velocity (u, v, w, p, q, r): through the water, m/s, and angular, rad/s."""
    nu_flow: Wrench
    """The same with the angular velocity relative to the line of water along the hull."""
    up: Vector3
    """Opposite direction of effective gravity, see ``restoring.wrench``; body axes."""
    height_m: float
    """Height of the origin above the surface; negative under water."""
    climb: float
    """Change of that height per metre forward along the hull."""
    density_ratio: float
    """Density over that of the water in which the vehicle was ballasted."""
    boundary: Wrench
    """Wrench of ice, surface and sea floor; zero in deep water."""


class TailInputs(NamedTuple):
    """Inputs of ring, propeller and fins."""

    axis: Vector3
    """Unit vector along the ring, forward, body axes."""
    rudder_rad: float
    """Positive turns the nose to starboard."""
    elevator_rad: float
    """Positive turns the nose up."""
    shaft_rps: float
    """Shaft speed, rev/s; negative is astern."""


@kernel
def tail_inputs(
    rudder_rad: float, elevator_rad: float, shaft_rps: float, model: VehicleModel
) -> TailInputs:
    """Return the inputs of the tail; a duct that is not vectored keeps its axis.

    Parameters
    ----------
    rudder_rad, elevator_rad : float
        Angles of the duct or the fins; positive turns the nose to starboard and up.
    shaft_rps : float
        Shaft speed, rev/s; negative is astern.
    model : VehicleModel
        Vehicle whose tail it is.

    Returns
    -------
    TailInputs
        Ring axis, angles and shaft speed.
    """
    vectored = model.duct.vectored
    axis = duct.ring_axis(vectored * rudder_rad, vectored * elevator_rad)
    return TailInputs(
        axis=axis, rudder_rad=rudder_rad, elevator_rad=elevator_rad, shaft_rps=shaft_rps
    )


@kernel
def total(flow: HullFlow, tail: TailInputs, model: VehicleModel) -> Wrench:
    """Return the sum of all forces except the disturbance.

    Parameters
    ----------
    flow : HullFlow
        Motion through the water and place under the surface.
    tail : TailInputs
        Surface angles and shaft speed, from ``tail_inputs``.
    model : VehicleModel
        The vehicle.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    The module docstring has the equation. A model with fewer degrees of freedom uses the components
    of its plane; the compiler removes the computation of the others.
    """
    _, v, w, _, q, r = flow.nu_flow
    crossflow = hydrodynamics.crossflow_drag(v, w, q, r, model.stations)
    return total_of(flow, tail, crossflow, at_tail(flow, tail, model), model)


@kernel
def total_of(
    flow: HullFlow, tail: TailInputs, crossflow: Wrench, stern: Wrench, model: VehicleModel
) -> Wrench:
    """Return ``total`` for a known crossflow drag and a known wrench of the tail.

    Both take most of the time, and many changes of a model or of its state leave one as it is.

    Parameters
    ----------
    flow : HullFlow
        Motion through the water and place under the surface.
    tail : TailInputs
        Surface angles and shaft speed, from ``tail_inputs``.
    crossflow, stern : tuple of 6 floats
        Results of ``hydrodynamics.crossflow_drag`` and ``at_tail``, FLU, N and N m.
    model : VehicleModel
        The vehicle.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.
    """
    # Forces that depend on the flow along the hull use the angular velocity relative to the water,
    # nu_flow. The momentum in -C(nu) nu uses the angular velocity itself.
    u, v, w, p, q, r = flow.nu_flow
    wrench = _sum(
        coriolis(flow.nu, model.inertia),
        restoring.wrench(
            flow.height_m,
            flow.climb,
            flow.up,
            flow.density_ratio,
            model.hydrostatics,
            model.stations,
        ),
    )
    wrench = _sum(wrench, crossflow)
    wrench = _sum(wrench, hydrodynamics.lift_and_drag(u, v, w, p, q, r, model.hull))
    wrench = _sum(wrench, stern)
    wrench = _sum(wrench, flow.boundary)
    return _sum(
        wrench,
        hydrodynamics.duct_interaction(
            _immersed(flow, model) * u * abs(u), tail.rudder_rad, tail.elevator_rad, model.hull
        ),
    )


@kernel
def at_tail(flow: HullFlow, tail: TailInputs, model: VehicleModel) -> Wrench:
    """Return the wrench of ring wing, propeller and fins, as far as they are under water.

    Parameters
    ----------
    flow : HullFlow
        Motion through the water and place under the surface.
    tail : TailInputs
        Surface angles and shaft speed, from ``tail_inputs``.
    model : VehicleModel
        The vehicle; its ``duct``, ``fins`` and ``propeller`` are used.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    ``duct.force``, ``propeller.thrust_n`` and ``fins.wrench`` have the equations and sources.
    """
    # Ring and thrust act at (x, 0, 0), x < 0. Velocity there: (u, v, w) + omega x (x, 0, 0).
    # Moment about the origin: (x, 0, 0) x (X, Y, Z) = (0, -x Z, x Y).
    u, v, w, _, q, r = flow.nu_flow
    immersed = _immersed(flow, model)
    x = model.duct.x_m
    velocity = (u, v + x * r, w - x * q)
    axis = tail.axis
    fx, fy, fz = duct.force(velocity, axis, model.duct)
    axial_mps = velocity[0] * axis[0] + velocity[1] * axis[1] + velocity[2] * axis[2]
    thrust = propeller.thrust_n(tail.shaft_rps, axial_mps, model.propeller)
    X = immersed * (fx + thrust * axis[0])
    Y = immersed * (fy + thrust * axis[1])
    Z = immersed * (fz + thrust * axis[2])
    fin_wrench = fins.wrench(flow.nu_flow, tail.rudder_rad, tail.elevator_rad, model.fins)
    return (
        X + immersed * fin_wrench[0],
        Y + immersed * fin_wrench[1],
        Z + immersed * fin_wrench[2],
        immersed * fin_wrench[3],
        -x * Z + immersed * fin_wrench[4],
        x * Y + immersed * fin_wrench[5],
    )


@kernel
def _immersed(flow: HullFlow, model: VehicleModel) -> float:
    """Return the fraction of the duct that is under water."""
    return restoring.immersion(flow.height_m + flow.climb * model.duct.x_m, model.duct.radius_m)


@kernel
def _sum(a: Wrench, b: Wrench) -> Wrench:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def coriolis(nu: Wrench, inertia: Inertia) -> Wrench:
    """Return the Coriolis and centripetal wrench of the body and its added mass.

    Parameters
    ----------
    nu : tuple of 6 floats
        Velocity (u, v, w, p, q, r) through the water, FLU, m/s and rad/s.
    inertia : Inertia
        Mass matrices; M = M_RB + M_A is used.

    Returns
    -------
    tuple of 6 floats
        -C(nu) nu about the origin, FLU, N and N m; it does no work.

    Notes
    -----
    Kirchhoff's equations (Lamb 1932, sec. 124).
    """
    # M = M_RB + M_A (6 x 6), nu = (v, omega) in FLU axes, m/s and rad/s.
    # Kirchhoff's equations (Lamb 1932, sec. 124), with momenta about the origin
    #     (P, H) = M nu:
    #     force  = -omega x P,
    #     moment = -omega x H - v x P.
    u, v, w, p, q, r = nu
    M = inertia.M
    px = M[0, 0] * u + M[0, 1] * v + M[0, 2] * w + M[0, 3] * p + M[0, 4] * q + M[0, 5] * r
    py = M[1, 0] * u + M[1, 1] * v + M[1, 2] * w + M[1, 3] * p + M[1, 4] * q + M[1, 5] * r
    pz = M[2, 0] * u + M[2, 1] * v + M[2, 2] * w + M[2, 3] * p + M[2, 4] * q + M[2, 5] * r
    hx = M[3, 0] * u + M[3, 1] * v + M[3, 2] * w + M[3, 3] * p + M[3, 4] * q + M[3, 5] * r
    hy = M[4, 0] * u + M[4, 1] * v + M[4, 2] * w + M[4, 3] * p + M[4, 4] * q + M[4, 5] * r
    hz = M[5, 0] * u + M[5, 1] * v + M[5, 2] * w + M[5, 3] * p + M[5, 4] * q + M[5, 5] * r
    return (
        r * py - q * pz,
        p * pz - r * px,
        q * px - p * py,
        (r * hy - q * hz) + (w * py - v * pz),
        (p * hz - r * hx) + (u * pz - w * px),
        (q * hx - p * hy) + (v * px - u * py),
    )
