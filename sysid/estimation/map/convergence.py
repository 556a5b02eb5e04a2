"""Criteria by which a fit has failed; the numbers of a failed fit must not be used."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map.gauss_newton import Z_LIMIT
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


class SearchCosts(NamedTuple):
    """Costs at which the searches of a fit ended."""

    cost: float
    """Cost of the fit."""
    others: Sequence[float]
    """Costs of the searches from other starts."""

    @property
    def elsewhere(self) -> int:
        """Number of other searches whose cost differs by more than ``START_COST_TOLERANCE``."""
        return sum(abs(c - self.cost) > START_COST_TOLERANCE * self.cost for c in self.others)

    @property
    def is_unique(self) -> bool:
        """Whether at most ``MAX_SHARE_ELSEWHERE`` of the other searches ended elsewhere."""
        return self.elsewhere <= MAX_SHARE_ELSEWHERE * len(self.others)

    @property
    def description(self) -> str:
        """Number of searches that ended elsewhere, and the largest difference, as text."""
        largest = max(abs(c / self.cost - 1.0) for c in self.others)
        return (
            f"{self.elsewhere} of {len(self.others)} other starts end elsewhere, their costs up to"
            f" {largest:.1%} away"
        )


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
    costs = SearchCosts(cost, start_costs)
    if not costs.is_unique:
        reasons.append(f"{costs.description}: {MORE_THAN_ONE}")
    if at_edge:
        reasons.append(
            f"the fit ended at the edge of the possible vehicles ({', '.join(at_edge)}); the logs"
            " may be of another vehicle or another tailcone: give its own file as the prior"
        )
    if at_bounds:
        reasons.append(
            f"{', '.join(at_bounds)} at a bound, {Z_LIMIT:g} prior standard deviations away:"
            f" the prior is wrong: {_remedy(at_bounds)}"
        )
    reasons += [
        reason
        for plane, (prior_covariance, posterior_covariance) in spreads.items()
        if (reason := _uninformed_numbers(plane, prior_covariance, posterior_covariance))
    ]
    return tuple(reasons)


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
