"""LQG controllers: a Kalman filter as observer and state feedback. Pure Python, pure.

Time-invariant, one step per tick k. y is measured, r its reference, u the command about the trim,
x the observer state::

    x[k] = A x[k-1] + B u[k-1] + L (y[k-1] + y[k]) / 2
    u[k] = F (x[k] - S r[k]) + u_ff,    low <= u <= high

The observer uses the limited command, so that nothing winds up. ``sysid.design.lqg`` designs the
matrices; ``autopilot.control.lqg_file`` reads them from a file at the start.
"""

from operator import mul
from typing import NamedTuple

MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.8, 1.25
"""Range of speed over design speed in which the LQG controllers are used; outside it, the PIDs."""


class LqgController(NamedTuple):
    """Matrices of one controller with n states and m measurements."""

    rows: tuple[tuple[float, ...], ...]
    """Matrix (A B L), shape (n, n + 1 + m)."""
    feedback: tuple[float, ...]
    """Feedback gain F, shape (n,)."""
    start: tuple[tuple[float, ...], ...]
    """S, shape (n, m): states of a vehicle in steady motion, from its measurements."""
    forward: tuple[float, ...]
    """Feed-forward gain -F S, shape (m,)."""
    loads: int
    """Number of states, the last ones, that are constant disturbances."""


class LqgControllers(NamedTuple):
    """Content of a controller file."""

    speed_mps: float
    """Design speed."""
    heading: LqgController
    """Controller of the rudder (rad) from yaw rate (rad/s) and heading (rad)."""
    depth: LqgController
    """Controller of the elevator (rad) from pitch rate, pitch, depth and depth rate (SI)."""
    pitch_per_metre: float
    """Nose-down pitch (rad) that has the same effect on the elevator as 1 m too deep.

    Converts the pitch limit into a limit of the depth error.
    """


class ObserverState(NamedTuple):
    """State of a controller between two ticks."""

    states: tuple[float, ...]
    """Observer state x."""
    measured: tuple[float, ...]
    """Measurements y of the last tick."""
    command_rad: float
    """Limited command u of the last tick."""


class LqgReference(NamedTuple):
    """Reference and limits of a controller in one tick."""

    wanted: tuple[float, ...]
    """Reference r, in the order of the measurements."""
    feedforward_rad: float
    """Feed-forward command u_ff, which the motion of the reference needs."""
    low: float
    high: float
    """Limits of u (rad), relative to the trim."""
    moving: bool = False
    """Whether the reference moves: then the disturbance states are frozen, because tracking error
    during a manoeuvre is transient."""


def from_matrices(
    rows: tuple[tuple[float, ...], ...],
    feedback: tuple[float, ...],
    start: tuple[tuple[float, ...], ...],
    loads: int,
) -> LqgController:
    """Return a controller with its feed-forward -F S.

    Parameters
    ----------
    rows : tuple of tuple of float
        Matrix (A B L), shape (n, n + 1 + m).
    feedback : tuple of float
        F, shape (n,).
    start : tuple of tuple of float
        S, shape (n, m).
    loads : int
        Number of states, the last ones, that are constant disturbances.

    Returns
    -------
    LqgController
        Controller for ``step``.
    """
    forward = tuple(-sum(map(mul, feedback, column)) for column in zip(*start, strict=True))
    return LqgController(rows=rows, feedback=feedback, start=start, forward=forward, loads=loads)


def step(
    controller: LqgController,
    observer: ObserverState | None,
    measured: tuple[float, ...],
    target: LqgReference,
) -> tuple[float, ObserverState]:
    """Run a controller for one tick.

    Parameters
    ----------
    controller : LqgController
        Matrices.
    observer : ObserverState | None
        State after the last tick; None starts at x = S y.
    measured : tuple of float
        y, in the units of the controller, shape (m,).
    target : LqgReference
        Reference and limits. A new reference changes the command at once; the observer
        follows the measurements only.

    Returns
    -------
    tuple[float, ObserverState]
        Limited command u (rad) relative to the trim, and the new observer state.
    """
    if observer is None:
        states = tuple([sum(map(mul, row, measured)) for row in controller.start])
    else:
        means = [0.5 * (old + new) for old, new in zip(observer.measured, measured, strict=True)]
        inputs = (*observer.states, observer.command_rad, *means)
        updated = len(controller.rows) - (controller.loads if target.moving else 0)
        states = (
            tuple([sum(map(mul, row, inputs)) for row in controller.rows[:updated]])
            + observer.states[updated:]
        )
    wanted = (
        sum(map(mul, controller.feedback, states))
        + sum(map(mul, controller.forward, target.wanted))
        + target.feedforward_rad
    )
    command = min(target.high, max(target.low, wanted))
    return command, ObserverState(states, measured, command)


def in_range(controllers: LqgControllers | None, speed_mps: float) -> bool:
    """Return whether there are controllers and the speed is in their range."""
    return (
        controllers is not None
        and MIN_SPEED_RATIO * controllers.speed_mps
        < speed_mps
        < MAX_SPEED_RATIO * controllers.speed_mps
    )
