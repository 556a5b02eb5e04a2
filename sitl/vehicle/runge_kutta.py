"""The classical Runge-Kutta method of order four (Kutta 1901), for all integrations in time.

Symbols: x state (n,), f(t, x) its derivative, h step (s), k_i slopes (n,):

    k1 = f(t, x),               k2 = f(t + h/2, x + h/2 k1),
    k3 = f(t + h/2, x + h/2 k2),   k4 = f(t + h, x + h k3),
    x(t + h) = x + h/6 k1 + h/3 k2 + h/3 k3 + h/6 k4.

A caller loops over the stages: ``stage_state``, then its own f into ``slopes[stage]``; after the
last stage, ``combine``.
"""

from __future__ import annotations

from mavlink_io.jit import kernel
from sitl.vehicle.vectors import Vector

STAGES = 4


@kernel
def stage_fraction(stage: int) -> float:
    """Return the time of a stage in units of the step.

    Parameters
    ----------
    stage : int
        Stage, 0 to 3.

    Returns
    -------
    float
        0, 1/2, 1/2 or 1.
    """
    return 0.0 if stage == 0 else (1.0 if stage == STAGES - 1 else 0.5)


@kernel
def samples_at(stage: int, first: int, stride: int) -> tuple[int, int]:
    """Return the two samples whose mean is the input of a stage.

    Parameters
    ----------
    stage : int
        Stage, 0 to 3.
    first : int
        Index of the sample at which the step begins.
    stride : int
        Number of samples in a step.

    Returns
    -------
    tuple of int
        Indices of the samples; they are equal where a sample lies at the time of the stage.
    """
    if stage == 0:
        return first, first
    if stage == STAGES - 1:
        return first + stride, first + stride
    return first + stride // 2, first + (stride + 1) // 2


@kernel
def stage_state(stage: int, state: Vector, slopes: Vector, h: float, out: Vector) -> None:
    """Write the state at which the slope of a stage is evaluated.

    Parameters
    ----------
    stage : int
        Stage, 0 to 3.
    state : Vector
        State at the start of the step, (n,).
    slopes : Vector
        Slopes of the earlier stages in its first rows, (4 or more, n).
    h : float
        Step, s.
    out : Vector
        Receives the state of the stage, (n,).
    """
    slope, step = slopes[max(stage, 1) - 1], stage_fraction(stage) * h
    for i in range(state.size):
        out[i] = state[i] + step * slope[i] if stage > 0 else state[i]


@kernel
def combine(state: Vector, slopes: Vector, h: float, out: Vector) -> None:
    """Write the state after the step.

    Parameters
    ----------
    state : Vector
        State at the start of the step, (n,).
    slopes : Vector
        Slopes of the four stages in its first rows, (4 or more, n).
    h : float
        Step, s.
    out : Vector
        Receives the state after the step, (n,); may be ``state`` itself.
    """
    outer, inner = h / 6.0, h / 3.0
    for i in range(state.size):
        out[i] = state[i] + (
            outer * slopes[0, i]
            + inner * slopes[1, i]
            + inner * slopes[2, i]
            + outer * slopes[3, i]
        )
