"""The smallest objective within limits: COBYQA, which needs no derivatives and keeps to nonlinear
constraints."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import NonlinearConstraint, minimize

from sysid.design.constraints import Misses
from sysid.design.specification import DesignRefused

Array = NDArray[np.float64]

SLACK = 2e-3
"""A limit missed by less than this share of itself counts as met: the optimum lies on its
limits."""
WORST_MISS = 3.0
"""Misses beyond it are all alike: a loop that falls apart has figures without end."""
RESTARTS, GAIN = 3, 0.005
"""How often at most, and for what share of the objective at least."""
STEPS = {"initial_tr_radius": 0.3, "final_tr_radius": 3e-3, "maxfev": 120}


class Judged(NamedTuple):
    """What a set of gains is worth."""

    objective: float
    """About one; small is good."""
    misses: Misses


class Search(NamedTuple):
    """What stays, what moves from where, and how it is judged."""

    fixed: Mapping[str, float]
    starts: Sequence[Mapping[str, float]]
    judge: Callable[[Mapping[str, float]], Judged]


def solve(search: Search) -> dict[str, float]:
    """The gains that moved, from the first start that ends within the limits. Raises DesignRefused
    where none does."""
    ends = []
    for start in search.starts:
        ends.append(_settled(start, search))
        if _largest(ends[-1].judged.misses) <= SLACK:
            return ends[-1].gains
    nearest = min((end.judged.misses for end in ends), key=_largest)
    worst, miss = max(nearest.items(), key=lambda item: item[1])
    raise DesignRefused(
        f"no gains meet the specification: the best found miss the {worst} by {100 * miss:.1f} %"
    )


class _End(NamedTuple):
    gains: dict[str, float]
    judged: Judged


def _settled(start: Mapping[str, float], search: Search) -> _End:
    """From where a search ended the next one sets out, as long as that brings something: its models
    grow stale."""
    end = _from(start, search)
    for _ in range(RESTARTS):
        again = _from(end.gains, search)
        better = (
            _largest(end.judged.misses) > SLACK
            or again.judged.objective < (1.0 - GAIN) * end.judged.objective
        )
        if _largest(again.judged.misses) > SLACK or not better:
            break
        end = again
    return end


def _from(start: Mapping[str, float], search: Search) -> _End:
    """On the logarithms of the gains. COBYQA asks for the limits again at every point it still
    builds on, ten times for each that is new: every point is judged once."""
    names, known = tuple(start), dict[bytes, Judged]()

    def gains_at(logs: Array) -> dict[str, float]:
        return dict(zip(names, np.exp(np.clip(logs, -12.0, 6.0)).tolist(), strict=True))

    def judged(logs: Array) -> Judged:
        key = logs.tobytes()
        if key not in known:
            known[key] = search.judge({**search.fixed, **gains_at(logs)})
        return known[key]

    def constrained(logs: Array) -> Array:
        missed = np.array(list(judged(logs).misses.values()))
        return np.asarray(np.nan_to_num(np.clip(missed, -1.0, WORST_MISS), nan=WORST_MISS))

    found = minimize(
        lambda logs: judged(logs).objective,
        np.log(list(start.values())),
        method="COBYQA",
        constraints=NonlinearConstraint(constrained, -np.inf, 0.0),
        options=STEPS,
    )
    return _End(gains_at(found.x), judged(np.asarray(found.x)))


def _largest(misses: Misses) -> float:
    return max(misses.values())
