"""Minimisation of an objective under nonlinear constraints with COBYLA.

COBYLA is a derivative-free trust-region method with linear models (Powell), here from nlopt.
Margins and damping ratios are minima over crossings and modes, whose derivatives jump: methods with
gradients end early.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import nlopt
import numpy as np
from numpy.typing import NDArray

from autopilot.control.params import PARAMETERS
from sysid.design.constraints import ConstraintViolation
from sysid.design.specification import DesignInfeasibleError

Array = NDArray[np.float64]

CONSTRAINT_TOLERANCE = 2e-3
"""Relative violation below which a constraint is satisfied; the optimum lies on constraints."""
MAX_VIOLATION = 3.0
"""Upper clip of violations: figures of an unstable loop are unbounded and carry no information."""
RESTARTS, MIN_IMPROVEMENT = 3, 0.005
"""Maximum number of restarts, and the relative improvement that a restart must give."""
GAIN_RANGE = (6e-6, 400.0)
"""Least and largest value of a free gain; parameters of the autopilot have ranges of their own."""
PARAMETER_RANGES = {row.name: (row.minimum, row.maximum) for row in PARAMETERS}
"""Least and largest value of each parameter of the autopilot."""
SEARCH_TOLERANCE = 0.5 * CONSTRAINT_TOLERANCE
"""Relative violation up to which a search takes a point for feasible."""
FIRST_RADIUS, LAST_RADIUS = 0.3, 3e-3
"""Trust-region radii in the logarithm of the gains."""
MAX_EVALUATIONS = 120
"""Maximum number of evaluations of a search."""


class CostAndConstraints(NamedTuple):
    """Objective and constraint violations of one set of gains."""

    objective: float
    """Normalised cost, of the order of one; smaller is better."""
    violations: ConstraintViolation
    """Relative violation by constraint; positive is a violation."""


class ConstrainedProblem(NamedTuple):
    """Fixed gains, starting points of the free gains, and the function that evaluates gains."""

    fixed: Mapping[str, float]
    starts: Sequence[Mapping[str, float]]
    evaluate: Callable[[Mapping[str, float]], CostAndConstraints]


def solve(search: ConstrainedProblem) -> dict[str, float]:
    """Return the free gains of the first start that ends within the constraints and below 1.

    An objective of 1 is that of the reference gains. If every start ends above it, the best end
    within the constraints is returned.

    Parameters
    ----------
    search : ConstrainedProblem
        Problem to solve.

    Returns
    -------
    dict
        Free gains by name.

    Raises
    ------
    DesignInfeasibleError
        No start ends within the constraints; the message names the worst constraint.
    """
    ends, feasible = [], []
    for start in search.starts:
        end = _restart_until_converged(start, search)
        ends.append(end)
        if _max_violation(end.evaluated.violations) <= CONSTRAINT_TOLERANCE:
            feasible.append(end)
            if end.evaluated.objective <= 1.0:
                break
    if feasible:
        return min(feasible, key=lambda end: end.evaluated.objective).gains
    nearest = min((end.evaluated.violations for end in ends), key=_max_violation)
    worst, violation = max(nearest.items(), key=lambda item: item[1])
    raise DesignInfeasibleError(
        f"no gains meet the specification: the best ones violate the {worst} by"
        f" {100 * violation:.1f} %"
    )


def within_range(name: str, value: float) -> float:
    """Return a value limited to the range of a parameter of the autopilot.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : float
        Value in the parameter's unit.

    Returns
    -------
    float
        Nearest value of the range.
    """
    minimum, maximum = PARAMETER_RANGES[name]
    return min(maximum, max(minimum, value))


class _End(NamedTuple):
    """Result of one search."""

    gains: dict[str, float]
    evaluated: CostAndConstraints


def _restart_until_converged(start: Mapping[str, float], search: ConstrainedProblem) -> _End:
    """Restart from the last result while that improves it: the models of a search go stale."""
    end = _minimise_from(start, search)
    for _ in range(RESTARTS):
        restarted = _minimise_from(end.gains, search)
        improved = (
            _max_violation(end.evaluated.violations) > CONSTRAINT_TOLERANCE
            or restarted.evaluated.objective < (1.0 - MIN_IMPROVEMENT) * end.evaluated.objective
        )
        if _max_violation(restarted.evaluated.violations) > CONSTRAINT_TOLERANCE or not improved:
            break
        end = restarted
    return end


def _minimise_from(start: Mapping[str, float], search: ConstrainedProblem) -> _End:
    """Minimise over the logarithms of the gains; return the best point that was evaluated."""
    names, evaluated = tuple(start), dict[bytes, _End]()
    least, greatest = np.transpose([_range(name) for name in names])
    lowest, highest = np.log(least), np.log(greatest)
    first = np.clip(np.log(list(start.values())), lowest, highest)

    def at(logs: Array) -> _End:
        """Return gains, cost and violations; objective and constraints share an evaluation."""
        key = logs.tobytes()
        if key not in evaluated:
            values = np.clip(np.exp(logs), least, greatest)  # exp(log(100)) is more than 100
            gains = dict(zip(names, values.tolist(), strict=True))
            evaluated[key] = _End(gains, search.evaluate({**search.fixed, **gains}))
        return evaluated[key]

    def objective(logs: Array, _: Array) -> float:
        """Return the objective."""
        return at(logs).evaluated.objective

    def constrain(result: Array, logs: Array, _: Array) -> None:
        """Set `result` to finite violations."""
        violations = np.array(list(at(logs).evaluated.violations.values()))
        result[:] = np.nan_to_num(np.clip(violations, -1.0, MAX_VIOLATION), nan=MAX_VIOLATION)

    method = nlopt.opt(nlopt.LN_COBYLA, len(names))
    method.set_min_objective(objective)
    constraints = len(at(first).evaluated.violations)
    method.add_inequality_mconstraint(constrain, np.full(constraints, SEARCH_TOLERANCE))
    method.set_lower_bounds(lowest)
    method.set_upper_bounds(highest)
    method.set_initial_step(FIRST_RADIUS)
    method.set_xtol_abs(LAST_RADIUS)
    method.set_maxeval(MAX_EVALUATIONS)
    with suppress(nlopt.RoundoffLimited):
        method.optimize(first)
    return min(evaluated.values(), key=_rank)


def _rank(end: _End) -> tuple[float, float]:
    """Return the order of results: feasible ones first, by their objective."""
    violation = _max_violation(end.evaluated.violations)
    return max(violation, SEARCH_TOLERANCE), end.evaluated.objective


def _range(name: str) -> tuple[float, float]:
    """Return the least and the largest value of a free gain."""
    minimum, maximum = PARAMETER_RANGES.get(name, GAIN_RANGE)
    return max(GAIN_RANGE[0], minimum), min(GAIN_RANGE[1], maximum)


def _max_violation(violations: ConstraintViolation) -> float:
    """Return the largest relative violation; infinite if one is not a number."""
    return max(math.inf if math.isnan(value) else value for value in violations.values())
