"""Criteria by which a fit has failed; the numbers of a failed fit must not be used."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sysid.models.parameters import NAMES, PARAMETERS
from sysid.planes import Plane

Array = NDArray[np.float64]

START_COST_TOLERANCE = 0.01
"""Relative cost difference up to which another start counts as having reached the same minimum."""
MAX_SHARE_ELSEWHERE = 0.5
"""Largest share of the other starts whose search may end elsewhere, at a larger cost.

At 1 % of the cost the data reject such an end. A minimum that half of the searches find is missed
by all of eight with a probability of 0.4 %.
"""
MAX_PRIOR_SHARE = 0.95
"""Ratio of posterior to prior standard deviation above which a design number was not measured."""
MORE_THAN_ONE = "the tests admit more than one vehicle"
PRIOR_UNCERTAINTY = "tests leave the prior's uncertainty"
MENDED_BY_TESTS = (MORE_THAN_ONE, PRIOR_UNCERTAINTY)
"""Parts of the failures that further tests can mend. The others are errors of the prior or of the
logs."""
DESIGN_NUMBERS = ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s", "delay_s")
"""Numbers of a plane that control design uses, by their names in ``model.json``."""


def failures(
    cost: float,
    start_costs: Sequence[float],
    at_bounds: Sequence[str],
    spreads: Mapping[Plane, tuple[Array, Array]],
    at_edge: Sequence[str] = (),
) -> tuple[str, ...]:
    """Return the reasons why a fit has failed; empty for a fit that passes.

    Parameters
    ----------
    cost : float
        Cost of the fit.
    start_costs : sequence of float
        Costs at which the searches from other starts ended.
    at_bounds : sequence of str
        Names of parameters at a bound of the search.
    spreads : mapping of plane to two ndarrays, (5, 5)
        Covariances of DESIGN_NUMBERS before and after the data, for each tested plane.
    at_edge : sequence of str
        Names of parameters beyond whose value no vehicle is possible.

    Returns
    -------
    tuple of str
        One sentence for each failure.
    """
    reasons = []
    if not is_unique(cost, start_costs):
        reasons.append(f"{describe_other_ends(cost, start_costs)}: {MORE_THAN_ONE}")
    if at_edge:
        reasons.append(
            f"the fit ended at the edge of the possible vehicles ({', '.join(at_edge)}); the logs"
            " may be of another vehicle or another tailcone: give its own file as the prior"
        )
    if at_bounds:
        reasons.append(
            f"{', '.join(at_bounds)} at a bound, four prior standard deviations away: the prior is"
            f" wrong: {_remedy(at_bounds)}"
        )
    reasons += [
        reason
        for plane, (prior_covariance, posterior_covariance) in spreads.items()
        if (reason := _uninformed_numbers(plane, prior_covariance, posterior_covariance))
    ]
    return tuple(reasons)


def ends_elsewhere(cost: float, start_costs: Sequence[float]) -> int:
    """Return how many searches from other starts ended at another cost than the fit.

    Parameters
    ----------
    cost : float
        Cost of the fit.
    start_costs : sequence of float
        Costs at which the searches from other starts ended.

    Returns
    -------
    int
        Number of costs that differ by more than ``START_COST_TOLERANCE``.
    """
    return sum(abs(start_cost - cost) > START_COST_TOLERANCE * cost for start_cost in start_costs)


def is_unique(cost: float, start_costs: Sequence[float]) -> bool:
    """Return whether enough of the searches from other starts ended at the cost of the fit.

    Parameters
    ----------
    cost : float
        Cost of the fit.
    start_costs : sequence of float
        Costs at which the searches from other starts ended.

    Returns
    -------
    bool
        Whether at most ``MAX_SHARE_ELSEWHERE`` of them ended elsewhere.
    """
    return ends_elsewhere(cost, start_costs) <= MAX_SHARE_ELSEWHERE * len(start_costs)


def describe_other_ends(cost: float, start_costs: Sequence[float]) -> str:
    """Return how many searches ended elsewhere, and the largest difference of their costs.

    Parameters
    ----------
    cost : float
        Cost of the fit.
    start_costs : sequence of float
        Costs at which the searches from other starts ended; at least one.

    Returns
    -------
    str
        Text without a full stop.
    """
    largest = max(abs(start_cost / cost - 1.0) for start_cost in start_costs)
    return (
        f"{ends_elsewhere(cost, start_costs)} of {len(start_costs)} other starts end elsewhere,"
        f" their costs up to {largest:.1%} away"
    )


def _remedy(at_bounds: Sequence[str]) -> str:
    """Return what to do about parameters at a bound: of the body, of the tailcone, or of both."""
    parts = {PARAMETERS[NAMES.index(name)].part for name in at_bounds}
    remedies = {
        "body": "give the vehicle's own file (--prior, or --vehicle of a campaign)",
        "tailcone": (
            "measure the tailcone with `ground bench-test`, and give the result to `ground refit`"
            " (--bench-result) or its values in the vehicle file; if it cannot be measured, state"
            " there how uncertain its lag is (tailcone.lag_relative_sd, 0.3 for an assumed servo)"
        ),
        "sensors": "check the time stamps of attitude and depth",
    }
    return "; ".join(text for part, text in remedies.items() if part in parts)


def _uninformed_numbers(plane: Plane, prior_covariance: Array, posterior_covariance: Array) -> str:
    """Name the design numbers whose uncertainty the data did not reduce.

    Empty if there are none.
    """
    # A number with a prior variance of zero is at its limit (a delay of zero) and is skipped.
    variances = np.diag(prior_covariance)
    sd_ratios = np.sqrt(
        np.divide(
            np.diag(posterior_covariance),
            variances,
            out=np.zeros(len(variances)),
            where=variances > 0.0,
        )
    )
    uninformed = [
        f"{name} ({ratio:.0%})"
        for name, ratio in zip(DESIGN_NUMBERS, sd_ratios, strict=True)
        if ratio > MAX_PRIOR_SHARE
    ]
    return f"the {plane} {PRIOR_UNCERTAINTY} of {', '.join(uninformed)}" if uninformed else ""
