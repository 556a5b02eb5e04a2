"""Standard manoeuvres, turning circle and zig-zag, for any simulator."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from sitl.vehicle import dynamics
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import STILL
from tests.reference import fossen
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]
Event = Callable[[Array], float]
"""Function of (eta, nu) in Fossen's axes; a run ends at its zero crossing."""

STEP_S = 0.005
"""Integration step of the kernels."""
LONGEST_S = 120.0
"""Maximum duration of a leg."""
BISECTIONS = 40


class Simulator(NamedTuple):
    """Simulator of a vehicle with its own form of state."""

    start: Array
    """Initial state."""
    run: Callable[[Array, float, float, Event | None], tuple[float, Array]]
    """Function of state, rudder (rad, positive to starboard), maximum time (s) and event.

    It returns the duration and the final state."""
    read: Callable[[Array], Array]
    """Function from state to (eta, nu)."""


class Circle(NamedTuple):
    """Steady turn."""

    radius_m: float
    drift_deg: float
    speed_mps: float
    yaw_rate_degps: float


class Zigzag(NamedTuple):
    """Zig-zag manoeuvre: the rudder is reversed when the heading change equals the rudder angle."""

    first_overshoot_deg: float
    second_overshoot_deg: float
    period_s: float
    """Time from the second to the fourth reversal of the rudder."""


def circle(ship: Simulator, rudder_rad: float, seconds: float) -> Circle:
    """Return the turn after ``seconds`` of constant rudder."""
    _, end = ship.run(ship.start, rudder_rad, seconds, None)
    u, v, w, _, _, r = ship.read(end)[6:]
    speed = hypot(u, v, w)
    return Circle(hypot(u, v) / abs(r), degrees(np.arctan2(v, u)), speed, degrees(r))


def zigzag(ship: Simulator, angle_rad: float) -> Zigzag:
    """Return the results of four reversals at ``angle_rad``; the rudder moves without delay."""
    state, time, rudder = ship.start, 0.0, angle_rad
    reversals: list[float] = []
    overshoots: list[float] = []
    for _ in range(4):
        took, state = ship.run(state, rudder, LONGEST_S, _heading_minus(rudder))
        time, rudder = time + took, -rudder
        reversals.append(time)
        if len(overshoots) < 2:
            _, turned_back = ship.run(state, rudder, LONGEST_S, lambda x: x[11])
            overshoots.append(degrees(abs(ship.read(turned_back)[5]) - angle_rad))
    return Zigzag(overshoots[0], overshoots[1], reversals[3] - reversals[1])


def _heading_minus(heading_rad: float) -> Event:
    return lambda x: float(x[5] - heading_rad)


def kernels(model: VehicleModel, speed_mps: float, shaft_rps: float) -> Simulator:
    """Return the product's simulator; the last step ends at the event."""
    work, no_push = dynamics.work_array(), np.zeros(6)

    def step(state: Array, rudder: float, dt_s: float) -> Array:
        after = state.copy()
        dynamics.rk4_step(after, rudder, 0.0, shaft_rps, no_push, STILL, dt_s, model, work)
        return after

    def run(
        state: Array, rudder: float, seconds: float, event: Event | None
    ) -> tuple[float, Array]:
        if event is None:
            return seconds, flight.fly(
                model, state, seconds, rudder, 0.0, shaft_rps / model.propeller.full_rps
            )[-1]
        before, after, steps = state, step(state, rudder, STEP_S), 0
        while (
            event(fossen.from_state(before)) * event(fossen.from_state(after)) > 0
            and steps * STEP_S < seconds
        ):
            before, after, steps = after, step(after, rudder, STEP_S), steps + 1
        part = _root(lambda dt_s: event(fossen.from_state(step(before, rudder, dt_s))))
        return steps * STEP_S + part, step(before, rudder, part)

    return Simulator(flight.cruising(speed_mps), run, fossen.from_state)


def _root(event: Callable[[float], float]) -> float:
    """Return the zero crossing of an event within a step."""
    low, high, sign = 0.0, STEP_S, np.sign(event(0.0))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if np.sign(event(middle)) == sign else (low, middle)
    return high


def matrices(model: VehicleModel, speed_mps: float, shaft_rps: float) -> Simulator:
    """Return Fossen's equations in matrix form, integrated by scipy's DOP853."""
    ship, still = fossen.craft(model), np.zeros(3)

    def run(
        state: Array, rudder: float, seconds: float, event: Event | None
    ) -> tuple[float, Array]:
        inputs = fossen.Inputs(rudder, 0.0, shaft_rps)

        def reached(_: float, x: Array) -> float:
            return event(x) if event else 1.0

        reached.terminal = True  # type: ignore[attr-defined]
        solution = solve_ivp(
            lambda _, x: fossen.rates(x, inputs, ship, still),
            (0.0, seconds),
            state,
            method="DOP853",
            events=reached,
            rtol=1e-7,
            atol=1e-9,
        )
        return float(solution.t[-1]), np.asarray(solution.y[:, -1])

    return Simulator(fossen.from_state(flight.cruising(speed_mps)), run, lambda state: state)
