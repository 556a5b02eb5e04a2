"""Relative violations of stability and load-rejection constraints.

A violation is a share of its limit: positive means that the limit is violated.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer, modal
from sysid.control_analysis.loop_state_space import ClosedLoop
from sysid.control_analysis.loop_transfer import ComplexArray, Margins
from sysid.control_analysis.modal import Modes
from sysid.design.specification import Spec

Array = NDArray[np.float64]
ConstraintViolation = dict[str, float]
"""Relative violation by the name of the constraint."""

STEP_S = 0.5
"""Sample interval (s) of the response to a constant load."""
LOAD_RESPONSE_TIMES = 2.0
"""Length of the simulated load response, as a multiple of the time in which it must be over."""


class Bounds(NamedTuple):
    """Required damping ratio, gain margin (dB), phase margin (deg) and largest sensitivity."""

    damping: float
    gm_db: float
    pm_deg: float
    max_sensitivity: float


class PlaneAnalysis(NamedTuple):
    """Margins and modes of the loops of one plane."""

    margins: Mapping[str, Margins]
    """Margins by the place where the loop is opened."""
    modes: Modes
    """Modes of the closed loop."""
    loop: str
    """Name of the closed loop in `modal.OBSERVED_STATES`."""


def analyse(loops: Mapping[str, ComplexArray], closed: ClosedLoop, loop: str) -> PlaneAnalysis:
    """Return the analysis of one plane.

    Parameters
    ----------
    loops : Mapping
        Open-loop transfer functions on `loop_transfer.GRID_RADPS` by the place where the loop is
        opened.
    closed : ClosedLoop
        Closed loop.
    loop : str
        Its name in `modal.OBSERVED_STATES`.

    Returns
    -------
    PlaneAnalysis
        Margins and modes.
    """
    margins = {name: loop_transfer.margins(cut) for name, cut in loops.items()}
    return PlaneAnalysis(margins, modal.modes_of(closed), loop)


def nominal(spec: Spec) -> Bounds:
    """Return the bounds that a specification sets for the nominal model."""
    return Bounds(
        damping=spec.damping,
        gm_db=spec.gm_db,
        pm_deg=spec.pm_deg,
        max_sensitivity=spec.max_sensitivity,
    )


def min_bounds(spec: Spec) -> Bounds:
    """Return the bounds for every sampled vehicle; those of the nominal model are stricter.

    Parameters
    ----------
    spec : Spec
        Specification of the design.

    Returns
    -------
    Bounds
        Least damping ratio, gain margin (dB) and phase margin (deg); the sensitivity is unbounded.
    """
    return Bounds(
        damping=spec.damping,
        gm_db=spec.robust_gm_db,
        pm_deg=spec.robust_pm_deg,
        max_sensitivity=math.inf,
    )


def worst_of_samples(samples: Iterable[ConstraintViolation]) -> ConstraintViolation:
    """Return the largest violation of each sampled vehicle.

    Parameters
    ----------
    samples : iterable of ConstraintViolation
        Violations of each vehicle.

    Returns
    -------
    dict
        One violation per vehicle, numbered from 1.
    """
    return {
        f"limits of sampled vehicle {number}": max(violations.values())
        for number, violations in enumerate(samples, start=1)
    }


def violations(plane: PlaneAnalysis, bounds: Bounds) -> ConstraintViolation:
    """Return the violations of margins and damping of one plane.

    Parameters
    ----------
    plane : PlaneAnalysis
        Margins and modes of its loops.
    bounds : Bounds
        Required margins and damping ratio.

    Returns
    -------
    dict
        Those of `margin_violations` and `damping_violations`.
    """
    return {
        **margin_violations(plane.margins, bounds),
        **damping_violations(plane.modes, plane.loop, bounds),
    }


def margin_violations(margins: Mapping[str, Margins], bounds: Bounds) -> ConstraintViolation:
    """Return the violations of gain margin, phase margin and sensitivity of loops.

    Parameters
    ----------
    margins : Mapping
        Margins by the place where the loop is opened; it is part of the constraint's name.
    bounds : Bounds
        Required margins.

    Returns
    -------
    dict
        1 - GM / GM_min, 1 - PM / PM_min and Ms / Ms_max - 1.
    """
    shares: ConstraintViolation = {}
    for name, achieved in margins.items():
        shares |= {
            f"gain margin at the {name}": 1.0 - achieved.gm_db / bounds.gm_db,
            f"phase margin at the {name}": 1.0 - achieved.pm_deg / bounds.pm_deg,
            f"sensitivity at the {name}": achieved.max_sensitivity / bounds.max_sensitivity - 1.0,
        }
    return shares


def damping_violations(modes: Modes, loop: str, bounds: Bounds) -> ConstraintViolation:
    """Return the damping violation of the visible modes, by the state they are visible in.

    Parameters
    ----------
    modes : Modes
        Modes of the closed loop.
    loop : str
        heading, pitch or depth.
    bounds : Bounds
        Required damping ratio.

    Returns
    -------
    dict
        1 - zeta / zeta_min with the smallest zeta = -Re(s) / |s| of the visible modes.
    """
    ratios = -modes.values.real / np.abs(modes.values)
    return {
        f"damping of the {name} loop": 1.0 - float(np.min(ratios[visible])) / bounds.damping
        for name, visible in modal.visible_modes(modes, loop).items()
    }


def impulse_violation(modes: Modes, state: int, name: str, spec: Spec) -> ConstraintViolation:
    """Return the violation of the overshoot of one state after an impulsive moment.

    Parameters
    ----------
    modes : Modes
        Modes of the closed loop.
    state : int
        Index of the state.
    name : str
        Name of the loop.
    spec : Spec
        `impulse_overshoot` and, for the length of the response, `integral_settling_s`.

    Returns
    -------
    dict
        overshoot / impulse_overshoot - 1.

    Notes
    -----
    With A = V diag(lambda) V^-1 and e_r the rate, x_k(t) = sum_i V_ki (V^-1 e_r)_i exp(lambda_i t).
    The overshoot is -min x_k / max x_k: damping ratios of single modes do not limit the sum of a
    pair of poles and the slow pole of the integrator.
    """
    impulse = np.zeros(modes.values.size, dtype=np.complex128)
    impulse[modal.RATE_STATE] = 1.0
    shares = modes.right[state] * np.linalg.solve(modes.right, impulse)
    times = np.arange(0.0, spec.integral_settling_s, STEP_S)
    with np.errstate(over="ignore", invalid="ignore"):  # an unstable loop overshoots any limit
        response = (np.exp(np.outer(times, modes.values)) @ shares).real
    overshoot = -float(np.min(response)) / float(np.max(response))
    limit = spec.impulse_overshoot
    return {f"overshoot after an impulse of the {name} loop": overshoot / limit - 1.0}


def load_violation(
    modes: Modes, surface: Array, state: int, name: str, spec: Spec
) -> ConstraintViolation:
    """Return the violation of the residual error after a constant load.

    Parameters
    ----------
    modes : Modes
        Modes of the closed loop.
    surface : ndarray
        Direction in which the load drives the first states, (n,).
    state : int
        Index of the state whose error counts.
    name : str
        Name of the loop.
    spec : Spec
        `integral_settling_s` (s) and `integral_residual`.

    Returns
    -------
    dict
        residual / integral_residual - 1.

    Notes
    -----
    Response to a constant load b from rest, with A = V diag(lambda) V^-1::

        x_k(t) = sum_i V_ki (V^-1 b)_i (exp(lambda_i t) - 1) / lambda_i

    The residual is max |x_k| after `integral_settling_s`, divided by max |x_k| overall.
    """
    load = np.zeros(modes.values.size, dtype=np.complex128)
    load[: surface.size] = surface
    shares = modes.right[state] * np.linalg.solve(modes.right, load) / modes.values
    times = np.arange(0.0, LOAD_RESPONSE_TIMES * spec.integral_settling_s, STEP_S)
    with np.errstate(over="ignore", invalid="ignore"):  # an unstable loop has no residual
        response = np.abs(((np.exp(np.outer(times, modes.values)) - 1.0) @ shares).real)
    residual = float(np.max(response[int(spec.integral_settling_s / STEP_S) :]) / np.max(response))
    return {f"residual of a load in the {name} loop": residual / spec.integral_residual - 1.0}
