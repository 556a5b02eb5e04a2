"""Effect of a surface on a rate, estimated from tests without a model of the vehicle.

Symbols: x rate of a plane (rad/s), chi its angle (rad), u deflection of a surface from its mean
before the test (rad), h = WINDOW_S, tau a delay. The balance of angular momentum over a window,
with damping a, restoring k (pitch only) and a constant c for each run::

    x(t + h) - x(t) = b int u(s - tau) ds - a (chi(t + h) - chi(t)) - k int chi ds + c h

is linear in b, a, k and c. Least squares over all windows of all runs gives b (1/s^2) with the
delay that leaves the smallest residual. The effect of a correctly wired surface is positive: a
positive rudder turns the nose to starboard, a positive elevator turns it up. A vehicle whose rate
settles within a fraction of h does not determine b; its static gain K (1/s) is estimated from::

    chi(t + h) - chi(t) = K int u(s - tau) ds + c h
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import RATE_HZ, Run
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

WINDOW_S = 1.0
"""Length of a window: longer than actuator lag, shorter than the response of the vehicle."""
STRIDE = int(0.5 * RATE_HZ)
"""Distance of the windows, samples. They overlap by half."""
OVERLAP = 2.0
"""Factor of the variance of an estimate from windows that overlap by half."""
BEFORE_S = 4.0
"""Time before the test from which on windows are used, so that a step is seen to begin."""
DELAYS_S = (0.0, 0.2, 0.4, 0.8)
"""Delays of the actuator that are tried."""
MIN_WINDOWS = 12
"""Minimum number of windows of a run; a shorter run is not used."""


class ControlEffect(NamedTuple):
    """Angular acceleration, or rate, of a plane per deflection of a surface."""

    value: float
    """Estimate of b, 1/s^2, or of K, 1/s."""
    sd: float
    """Standard deviation of the estimate."""
    share: float
    """Share of the change of rate or angle that only the surface explains, 0..1."""

    @property
    def significance(self) -> float:
        """Return the estimate in standard deviations."""
        return self.value / self.sd


class _Balance(NamedTuple):
    """Windows of one run: left-hand side, regressors that every delay shares, and deflections."""

    change: Array
    other: Array
    """(windows, terms), the first column is the constant."""
    deflection: Array
    """(delays, windows), integral of the deflection."""


def control_effect(runs: Sequence[Run], plane: Plane, surface: Plane) -> ControlEffect | None:
    """Estimate the effect b of a surface on the rate of a plane.

    Parameters
    ----------
    runs : sequence of Run
        Tests of that surface.
    plane : Plane
        Plane of the rate.
    surface : Plane
        Plane whose surface is meant: yaw for the rudder, pitch for the elevator.

    Returns
    -------
    ControlEffect or None
        The effect; None if no run is long enough, or if the surface did not move. Without any
        motion it is 0 with an infinite standard deviation.
    """
    return _estimate([_balance(run, plane, surface, steady=False) for run in runs])


def static_gain(runs: Sequence[Run], plane: Plane) -> ControlEffect | None:
    """Estimate the static gain K of a plane for its own surface.

    Parameters
    ----------
    runs : sequence of Run
        Tests of the plane.
    plane : Plane
        The plane.

    Returns
    -------
    ControlEffect or None
        The gain; None if no run is long enough, or if the surface did not move.
    """
    return _estimate([_balance(run, plane, plane, steady=True) for run in runs])


def _estimate(candidates: Sequence[_Balance | None]) -> ControlEffect | None:
    """Return the coefficient of the deflection; None without windows, deflection or motion."""
    balances = [balance for balance in candidates if balance is not None]
    if not balances:
        return None
    change = np.concatenate([balance.change for balance in balances])
    other = _block_columns([balance.other for balance in balances])
    deflections = np.concatenate([balance.deflection for balance in balances], axis=1)
    # The regressors without the deflection are projected out (Frisch and Waugh 1933).
    basis = _orthonormal(other)
    change_left = change - basis @ (basis.T @ change)
    deflections_left = deflections - (deflections @ basis) @ basis.T
    energies = np.sum(deflections_left**2, axis=1)
    total = float(change_left @ change_left)
    if np.min(energies) <= 0.0:
        return None
    if total <= 0.0:
        return ControlEffect(0.0, math.inf, 0.0)
    slopes = deflections_left @ change_left / energies
    explained = slopes**2 * energies
    best = int(np.argmax(explained))
    freedom = max(change.size - basis.shape[1] - 1, 1)
    variance = OVERLAP * max(total - explained[best], 1e-12 * total) / freedom
    return ControlEffect(
        value=float(slopes[best]),
        sd=math.sqrt(variance / float(energies[best])),
        share=float(explained[best] / total),
    )


def _balance(run: Run, plane: Plane, surface: Plane, *, steady: bool) -> _Balance | None:
    """Return the windows of a run; None if they are too few."""
    width, lead = int(WINDOW_S * RATE_HZ), int(max(DELAYS_S) * RATE_HZ)
    first = max(int(np.searchsorted(run.time_s, -BEFORE_S)), lead)
    starts = np.arange(first, run.time_s.size - width, STRIDE)
    if starts.size < MIN_WINDOWS:
        return None
    signals, command = run.in_plane(plane), run.in_plane(surface).command_rad
    before = run.approach
    held = float(np.mean(command[before])) if before.any() else float(command[0])
    rate, angle = signals.rate_radps, signals.angle_rad - signals.angle_rad[0]
    ends = starts + width
    turned, columns = angle[ends] - angle[starts], [np.full(starts.size, WINDOW_S)]
    if not steady:
        columns.append(turned)
    if not steady and not PLANES[plane].is_yaw:
        columns.append(_window_integral(angle, starts, width))
    deflection = np.stack(
        [
            _window_integral(command - held, starts - int(delay_s * RATE_HZ), width)
            for delay_s in DELAYS_S
        ]
    )
    change = turned if steady else rate[ends] - rate[starts]
    return _Balance(change, np.stack(columns, axis=1), deflection)


def _window_integral(values: Array, starts: NDArray[np.intp], width: int) -> Array:
    """Return the integrals over windows by the rectangle rule."""
    total = np.concatenate(([0.0], np.cumsum(values))) / RATE_HZ
    integral: Array = total[starts + width] - total[starts]
    return integral


def _block_columns(parts: Sequence[Array]) -> Array:
    """Stack regressors of all runs; the constant (column 0) is each run's own."""
    rows = sum(len(part) for part in parts)
    constants = np.zeros((rows, len(parts)))
    first = 0
    for number, part in enumerate(parts):
        constants[first : first + len(part), number] = part[:, 0]
        first += len(part)
    shared = np.concatenate([part[:, 1:] for part in parts])
    return np.concatenate([shared, constants], axis=1)


def _orthonormal(columns: Array) -> Array:
    """Return an orthonormal basis of the columns; dependent columns are left out."""
    scale = np.linalg.norm(columns, axis=0)
    left, sizes, _ = np.linalg.svd(
        columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False
    )
    basis: Array = left[:, sizes > 1e-9 * sizes[0]]
    return basis
