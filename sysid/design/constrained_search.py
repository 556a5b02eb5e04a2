"""The smallest objective within limits: COBYQA, which needs no derivatives and keeps to nonlinear
constraints."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import NonlinearConstraint, minimize

from sysid.design.constraints import ConstraintViolation
from sysid.design.specification import DesignInfeasibleError

Array = NDArray[np.float64]

CONSTRAINT_TOLERANCE = 2e-3
"""A limit missed by less than this share of itself counts as met: the optimum lies on its
limits."""
MAX_VIOLATION = 3.0
"""Misses beyond it are all alike: a loop that falls apart has figures without end."""
RESTARTS, MIN_IMPROVEMENT = 3, 0.005
"""How often at most, and for what share of the objective at least."""
COBYQA_OPTIONS = {"initial_tr_radius": 0.3, "final_tr_radius": 3e-3, "maxfev": 120}


class CostAndConstraints(NamedTuple):
    """What a set of gains is worth."""

    objective: float
    """About one; small is good."""
    misses: ConstraintViolation


class ConstrainedProblem(NamedTuple):
    """What stays, what moves from where, and how it is judged."""

    fixed: Mapping[str, float]
    starts: Sequence[Mapping[str, float]]
    judge: Callable[[Mapping[str, float]], CostAndConstraints]


def solve(search: ConstrainedProblem) -> dict[str, float]:
    """The gains that moved, from the first start that ends within the limits. Raises DesignRefused
    where none does."""
    ends = []
    for start in search.starts:
        ends.append(_restart_until_converged(start, search))
        if _max_violation(ends[-1].judged.misses) <= CONSTRAINT_TOLERANCE:
            return ends[-1].gains
    nearest = min((end.judged.misses for end in ends), key=_max_violation)
    worst, miss = max(nearest.items(), key=lambda item: item[1])
    raise DesignInfeasibleError(
        f"no gains meet the specification: the best found miss the {worst} by {100 * miss:.1f} %"
    )


class _End(NamedTuple):
    gains: dict[str, float]
    judged: CostAndConstraints


def _restart_until_converged(start: Mapping[str, float], search: ConstrainedProblem) -> _End:
    """From where a search ended the next one sets out, as long as that brings something: its models
    grow stale."""
    end = _minimise_from(start, search)
    for _ in range(RESTARTS):
        again = _minimise_from(end.gains, search)
        better = (
            _max_violation(end.judged.misses) > CONSTRAINT_TOLERANCE
            or again.judged.objective < (1.0 - MIN_IMPROVEMENT) * end.judged.objective
        )
        if _max_violation(again.judged.misses) > CONSTRAINT_TOLERANCE or not better:
            break
        end = again
    return end


def _minimise_from(start: Mapping[str, float], search: ConstrainedProblem) -> _End:
    """On the logarithms of the gains. COBYQA asks for the limits again at every point it still
    builds on, ten times for each that is new: every point is judged once."""
    names, known = tuple(start), dict[bytes, CostAndConstraints]()

    def gains_at(logs: Array) -> dict[str, float]:
        return dict(zip(names, np.exp(np.clip(logs, -12.0, 6.0)).tolist(), strict=True))

    def judged(logs: Array) -> CostAndConstraints:
        key = logs.tobytes()
        if key not in known:
            known[key] = search.judge({**search.fixed, **gains_at(logs)})
        return known[key]

    def constrained(logs: Array) -> Array:
        missed = np.array(list(judged(logs).misses.values()))
        return np.asarray(np.nan_to_num(np.clip(missed, -1.0, MAX_VIOLATION), nan=MAX_VIOLATION))

    found = minimize(
        lambda logs: judged(logs).objective,
        np.log(list(start.values())),
        method="COBYQA",
        constraints=NonlinearConstraint(constrained, -np.inf, 0.0),
        options=COBYQA_OPTIONS,
    )
    return _End(gains_at(found.x), judged(np.asarray(found.x)))


def _max_violation(misses: ConstraintViolation) -> float:
    return max(misses.values())
