"""Parameters at a bound of the search, and which of them are no failure of the fit.

A bound lies `Z_LIMIT` prior standard deviations from the prior. A parameter there means that the
prior is wrong, or that the parameter makes up for an error of the model's structure.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.models.parameters import ELEVATOR_RATIOS, NAMES

Array = NDArray[np.float64]

MAY_BE_ZERO = ("backlash",)
"""Ratios to the prior whose true value may be zero, which a ratio only reaches at its lower bound.

At its lower bound the assumed backlash of 0.2 deg is 0.0013 deg, less than any test shows.
"""
NONLINEAR = (
    "crossflow_cd",
    "crossflow_slope",
    "crossflow_ends",
    "crossflow_uncoupled",
    "rate_limit",
    "axial_drag",
    "lift_quadratic",
    "stall_angle",
)
"""Parameters that act in large or slow motion, and hardly change the response about the crossover.

They end at a bound where the structure of the model is not the vehicle's: a note, while the tests
decide whether the model is fit."""
ACROSS = ("Y_dr", "Y_vdot", "Z_wdot")
"""Side force of the rudder and added masses, which move the vehicle across its axis.

Tests show them only by a velocity that few logs hold. They end at a bound where they make up for
another error of the model: a note as well."""
LAG = "natural_frequency"
"""Parameter of the bandwidth of the servo."""
DRIVE_RATIOS = tuple(ELEVATOR_RATIOS.values())
"""Parameters by which the drive of the elevator differs from that of the rudder."""
ASSUMED_LAG_RATIO = 2.0
"""Ratio of the bounds of the natural frequency to its prior from which on the lag is an assumption.

At its upper bound the servo is faster than assumed, and the lag that remains cannot be
distinguished from a delay. The two drives may differ more than those of a known tailcone.
"""
_NOTES = {
    NONLINEAR: "large or slow motion (loss of speed in turns, drag of drift, stall) is not the"
    " model's; the static gain and the slow pole may differ by more than stated",
    ACROSS: "motion across the axis, which the tests do not show, makes up for another error of the"
    " model; the poles may differ by more than stated",
    (LAG,): "the servo is faster than the file assumes; for a more certain delay measure it with"
    " `ground bench-test`",
    DRIVE_RATIOS: "the drives of rudder and elevator differ, or are limited in rate; measure them"
    " with `ground bench-test`",
}
"""Parameters whose bound does not decide whether a fit has failed, and the note about each."""


class ReachedBounds(NamedTuple):
    """Parameters at a bound of the search."""

    decisive: tuple[str, ...]
    """Names of those that make a fit fail, in the order of ``NAMES``."""
    notes: tuple[str, ...]
    """Names and meaning of the others, one sentence for each group."""


def reached(z: Array, lag_relative_sd: float) -> ReachedBounds:
    """Return the parameters at a bound of the search.

    Parameters
    ----------
    z : ndarray, shape (n,)
        Estimate, in prior standard deviations from the prior and in the order of ``NAMES``.
    lag_relative_sd : float
        Relative standard deviation of the lag in the prior's file.

    Returns
    -------
    ReachedBounds
        Without those whose bound stands for a value of zero.
    """
    at_bound = [
        name
        for name, value in zip(NAMES, z, strict=True)
        if abs(value) > 0.99 * Z_LIMIT and not _is_zero(name, z)
    ]
    noted = [name for name in at_bound if _is_noted(name, z, lag_relative_sd)]
    return ReachedBounds(
        decisive=tuple(name for name in at_bound if name not in noted),
        notes=tuple(
            f"{', '.join(names)} at a bound of {Z_LIMIT:g} prior standard deviations: {meaning}"
            for group, meaning in _NOTES.items()
            if (names := [name for name in noted if name in group])
        ),
    )


def _is_zero(name: str, z: Array) -> bool:
    """Return whether a bound stands for a value of zero."""
    return name in MAY_BE_ZERO and bool(z[NAMES.index(name)] < 0.0)


def _is_noted(name: str, z: Array, lag_relative_sd: float) -> bool:
    """Return whether a parameter at a bound gives a note and no failure."""
    if name == LAG or name in DRIVE_RATIOS:
        is_assumed = math.exp(lag_relative_sd * Z_LIMIT) >= ASSUMED_LAG_RATIO
        return is_assumed and (name in DRIVE_RATIOS or bool(z[NAMES.index(name)] > 0.0))
    return name in NONLINEAR or name in ACROSS
