"""Torque-free tumble.

Verifies: the rigid body's rotational equations and their integration, about a stable axis and
through the flips of the intermediate one; the same with added mass, where a body in inviscid water
tumbles and darts by Kirchhoff's equations; that linear and angular impulse stay constant in the
inertial frame. Leaves out: weight, buoyancy, drag, lift. Reference: Euler's equations solved by
Jacobi's elliptic functions (Landau and Lifshitz 1976, Mechanics, sec. 37); Kirchhoff's equations in
the impulses (Lamb 1932, sec. 124) integrated by scipy's DOP853 at a tolerance of 1e-12. Tolerance:
what steps of 5 ms leave after a minute, with a factor of a few to spare.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from sitl.vehicle.model import VehicleModel
from tests.reference import bodies
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]

INERTIA_KGM2 = (40.0, 480.0, 510.0)
SECONDS = 60.0
STABLE_RADPS = (0.5, 0.0, 0.8)
NEAR_SEPARATRIX_RADPS = (0.8, 0.0, 0.8 * (40 * 440 / (510 * 30)) ** 0.5 * 1.0005)
"""Initial rates near the separatrix: the spin passes close to the unstable intermediate axis."""


def checks() -> Iterator[Check]:
    """Yield the checks of the analytic tumbles, then of the one in water."""
    for name, start in (("stable axis", STABLE_RADPS), ("flipping axis", NEAR_SEPARATRIX_RADPS)):
        track = _spin(start)
        found, expected = track[:, 10:13], euler_radps(start, _time(track))
        yield worst(
            f"{name}, rates over 60 s", "rad/s", found, expected, 1e-7, "Jacobi elliptic functions"
        )
    yield relative(
        "flipping axis, period",
        "s",
        _period_s(track),
        4 * ellipk(_parameter(start)) / _pace(start),
        1e-6,
        "4 K(m) / n",
    )
    yield from _in_water(
        flight.without_weight(flight.without_fluid_forces(flight.model("caribou_nominal")))
    )


def _spin(start_radps: tuple[float, ...]) -> Array:
    state = flight.cruising(0.0)
    state[10:13] = start_radps
    return flight.fly(bodies.rigid_body(640.0, np.zeros(3), np.diag(INERTIA_KGM2)), state, SECONDS)


def _time(track: Array) -> Array:
    return np.linspace(0.0, SECONDS, len(track))


def _invariants(start_radps: tuple[float, ...]) -> tuple[float, float]:
    """Twice the energy, and angular momentum squared."""
    moments, omega = np.array(INERTIA_KGM2), np.array(start_radps)
    return float(moments @ omega**2), float(moments**2 @ omega**2)


def _parameter(start_radps: tuple[float, ...]) -> float:
    (A, B, C), (twice_E, LL) = INERTIA_KGM2, _invariants(start_radps)
    return (B - A) * (twice_E * C - LL) / ((C - B) * (LL - twice_E * A))


def _pace(start_radps: tuple[float, ...]) -> float:
    (A, B, C), (twice_E, LL) = INERTIA_KGM2, _invariants(start_radps)
    return float(np.sqrt((C - B) * (LL - twice_E * A) / (A * B * C)))


def euler_radps(start_radps: tuple[float, ...], time_s: Array) -> Array:
    """Rates of a free body, principal moments ascending, that starts without spin about the middle
    axis.
    """
    (_, B, C), (twice_E, LL) = INERTIA_KGM2, _invariants(start_radps)
    sn, cn, dn, _ = ellipj(_pace(start_radps) * time_s, _parameter(start_radps))
    p, r = start_radps[0], start_radps[2]
    q = np.sqrt((twice_E * C - LL) / (B * (C - B)))
    return np.column_stack([p * cn, q * sn, r * dn])


def _period_s(track: Array) -> float:
    """Between upward crossings of the middle rate through zero."""
    q, time = track[:, 11], _time(track)
    at = np.flatnonzero((q[1:-1] < 0) & (q[2:] >= 0)) + 1
    crossings = [np.interp(0.0, q[i : i + 2], time[i : i + 2]) for i in at]
    return float(np.mean(np.diff([0.0, *crossings])))


def _in_water(model: VehicleModel) -> Iterator[Check]:
    """Body and entrained water against Kirchhoff's equations."""
    M, start = model.inertia.M, flight.tumbling()
    track = flight.fly(model, start, SECONDS)

    def impulse_rates(_: float, impulses: Array) -> Array:
        v, omega = np.split(np.linalg.solve(M, impulses), 2)
        P, H = np.split(impulses, 2)
        return np.concatenate([np.cross(P, omega), np.cross(H, omega) + np.cross(P, v)])

    kirchhoff = solve_ivp(
        impulse_rates, (0, SECONDS), M @ start[7:13], method="DOP853", rtol=1e-12, atol=1e-10
    )
    end = np.linalg.solve(M, kirchhoff.y[:, -1])
    yield worst(
        "in water, speeds after 60 s",
        "m/s",
        track[-1, 7:13],
        end,
        1e-6,
        "Kirchhoff's equations, DOP853",
    )
    impulses = np.array([_impulses(model, state, start) for state in track[::500]])
    size = np.linalg.norm(impulses[0])
    yield worst(
        "in water, impulses", "part", impulses / size, impulses[0] / size, 1e-8, "conservation"
    )


def _impulses(model: VehicleModel, state: Array, start: Array) -> Array:
    """Linear and angular impulse in the inertial frame, the latter about where the body was at
    ``start``.
    """
    R, (P, H) = flight.rotation(state), np.split(model.inertia.M @ state[7:13], 2)
    linear = R @ P
    return np.concatenate([linear, R @ H + np.cross(state[0:3] - start[0:3], linear)])
