"""By how much loops miss what is asked of them, each limit as a share of itself: positive is a
miss."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer, modal
from sysid.control_analysis.modal import Modes
from sysid.design.specification import Spec

Array = NDArray[np.float64]
ConstraintViolation = dict[str, float]

STEP_S = 0.5
LOAD_RESPONSE_TIMES = 2.0
"""A load's answer is watched for so many times the time in which it must be over."""


class Bounds(NamedTuple):
    """What is asked of stability."""

    damping: float
    gm_db: float
    pm_deg: float
    ms: float


def nominal(spec: Spec) -> Bounds:
    return Bounds(spec.damping, spec.gm_db, spec.pm_deg, spec.ms)


def margin_violations(
    loop: NDArray[np.complex128], name: str, bounds: Bounds
) -> ConstraintViolation:
    """Margins where a loop is opened."""
    found = loop_transfer.margins(loop)
    return {
        f"gain margin at the {name}": 1.0 - found.gm_db / bounds.gm_db,
        f"phase margin at the {name}": 1.0 - found.pm_deg / bounds.pm_deg,
        f"sensitivity at the {name}": found.ms / bounds.ms - 1.0,
    }


def damping_violations(found: Modes, loop: str, bounds: Bounds) -> ConstraintViolation:
    """Damping of the modes of a closed loop that show, by the state that they show in."""
    ratios = -found.values.real / np.abs(found.values)
    return {
        f"damping of the {name} loop": 1.0 - float(np.min(ratios[shown])) / bounds.damping
        for name, shown in modal.visible_modes(found, loop).items()
    }


def load_violation(
    found: Modes, surface: Array, state: int, name: str, spec: Spec
) -> ConstraintViolation:
    """What is left of a constant surface offset's largest error once its integrator should be done.

    ``surface``: how the offset drives the first states.
    """
    load = np.zeros(found.values.size, dtype=np.complex128)
    load[: surface.size] = surface
    shares = found.right[state] * np.linalg.solve(found.right, load) / found.values
    times = np.arange(0.0, LOAD_RESPONSE_TIMES * spec.finish_s, STEP_S)
    answer = np.abs(((np.exp(np.outer(times, found.values)) - 1.0) @ shares).real)
    left = float(np.max(answer[int(spec.finish_s / STEP_S) :]) / np.max(answer))
    return {f"rest of a load in the {name} loop": left / spec.finish_left - 1.0}
