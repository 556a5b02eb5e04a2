"""Tailcone that explains all nine printed poles best, for each reading of the transfer function.

Readings differ in the actuator's second-order lag and in the form of the delay. The delay is
searched, and the lag where a reading does not define it. Poles are those of
``sysid.control_analysis.loop_transfer``.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from sysid.control_analysis import loop_state_space
from sysid.control_analysis.loop_state_space import Approximation
from sysid.control_analysis.loop_transfer import Lag
from sysid.reproduction.paper_poles.poles import (
    CONTROLLERS,
    LAG,
    close_loop,
    dominant,
    models,
)
from sysid.reproduction.paper_tables import TABLE_4

Array = NDArray[np.float64]
Printed = Mapping[tuple[str, str], complex]


class Form(NamedTuple):
    """Representation of a delay in a transfer function."""

    name: str
    approximation: Approximation


NO_DELAY = Form("none", 1)
FORMS = (
    Form("Pade 1", 1),
    Form("Pade 2", 2),
    Form("Ogata 2", (1.0, 1 / 2, 1 / 8)),
    Form("as printed", (9 / 2, 1 / 9, 1 / 20)),
    Form("exact", 6),
)
"""Forms of the delay.

Ogata 2: Taylor series of second order over its mirror image. Exact: Pade 6, within 1e-5 rad of the
delay over the poles' frequencies and the delays that are tried.
"""
FIGURE_4 = "s^2/9 + 4s/10 + 1"
STATED = "as stated"
LAGS = {
    FIGURE_4: Lag(0.0, 3.0, 0.6),
    "s^2/3 + 4s/10 + 1": Lag(0.0, math.sqrt(3.0), 0.2 * math.sqrt(3.0)),
    "3s^2 + 4s/10 + 1": Lag(0.0, 1.0 / math.sqrt(3.0), 0.2 / math.sqrt(3.0)),
    "none": Lag(0.0, 60.0, 1.0),
}
"""Denominators of the lag, by name.

They are: cut-off frequency of figure 4; one power missing; as printed; a lag too fast to matter.
"""
DELAYS_S = np.arange(0.1, 1.01, 0.1)
MIN_DELAY_S, MAX_DELAY_S, DELAY_STEP_S = 0.0, 1.1, 0.02
FREE_FREQUENCY = "free, damping 0.6"
FREE_DAMPING = "free, at least 0.2"
MIN_FREQUENCY_RADPS, MAX_FREQUENCY_RADPS, MIN_DAMPING, MAX_DAMPING = 1.0, 20.0, 0.2, 1.2
UNEXPLAINED_SHARE = 0.1
"""Relative error above which a row counts as unexplained."""
INTERVAL_MISFIT_RATIO = math.exp(3.84 / (4.0 * len(TABLE_4)))
"""Ratio of misfits at the ends of the delay's 95 % interval to the smallest misfit.

It assumes independent normal errors: two real numbers per row, n ln(sum of squares) increased by
3.84.
"""


class TransferReading(NamedTuple):
    """Best tailcone of one reading."""

    lag_name: str
    form: str
    lag: Lag
    misfit_radps: float
    """Rms distance of printed and computed poles over the nine rows (rad/s)."""
    delays_s: tuple[float, float]
    """95 % interval of the delay (s) with the lag fixed."""
    remain: tuple[tuple[str, str], ...]
    """Rows with an error above `UNEXPLAINED_SHARE`."""


def readings(printed: Printed = TABLE_4) -> list[TransferReading]:
    """Return the readings of the transfer function with their best delays.

    Parameters
    ----------
    printed : Mapping
        Printed poles (rad/s) by (loop, model/controller).

    Returns
    -------
    list of TransferReading
        The stated tailcone; then all forms behind figure 4's lag, the best form behind the other
        lags, and free lags.
    """
    search = TailconeSearch(printed)
    figure_4_lag = LAGS[FIGURE_4]
    results = [
        search.reading(STATED, FORMS[1], LAG),
        search.reading(FIGURE_4, NO_DELAY, figure_4_lag),
    ]
    for name, lag in LAGS.items():
        candidates = [(form, search.best_delay(lag, form)) for form in FORMS]
        reported = (
            candidates
            if lag is figure_4_lag
            else [min(candidates, key=lambda candidate: search.misfit(candidate[1], candidate[0]))]
        )
        results += [search.reading(name, form, delayed) for form, delayed in reported]
    exact = FORMS[-1]
    results += [
        search.reading(name, exact, search.best_lag(exact, name == FREE_DAMPING))
        for name in (FREE_FREQUENCY, FREE_DAMPING)
    ]
    return results


class TailconeSearch:
    """Misfits of candidate tailcones to printed poles.

    Parameters
    ----------
    printed : Printed
        Printed poles, by row; by default those of table 4 of the paper.
    """

    def __init__(self, printed: Printed = TABLE_4) -> None:
        self._printed, self._models = printed, models()

    def reading(self, name: str, form: Form, lag: Lag) -> TransferReading:
        """Return the result of one tailcone.

        Parameters
        ----------
        name : str
            Name of the lag, for the table.
        form : Form
            Form of the transfer function.
        lag : Lag
            Delay, natural frequency and damping.

        Returns
        -------
        TransferReading
            Misfit, interval of the delay and rows that the tailcone does not explain.
        """
        errors = self._misses(lag, form)
        remain = tuple(
            row
            for row, error in errors.items()
            if not error <= UNEXPLAINED_SHARE * abs(self._printed[row])
        )
        return TransferReading(
            lag_name=name,
            form=form.name,
            lag=lag,
            misfit_radps=self.misfit(lag, form),
            delays_s=self._interval(lag, form),
            remain=remain,
        )

    def best_delay(self, lag: Lag, form: Form) -> Lag:
        """Return the lag with the delay of the smallest misfit.

        Parameters
        ----------
        lag : Lag
            Lag whose natural frequency and damping are kept.
        form : Form
            Form of the transfer function.

        Returns
        -------
        Lag
            Lag with the best delay.
        """

        def misfit(delay_s: float) -> float:
            """Return the misfit with this delay."""
            return self.misfit(lag._replace(delay_s=delay_s), form)

        coarse = float(min(DELAYS_S, key=misfit))
        step = float(DELAYS_S[1] - DELAYS_S[0])
        fine = minimize_scalar(
            misfit, bounds=(coarse - step, coarse + step), options={"xatol": 1e-3}
        )
        return lag._replace(delay_s=float(fine.x))

    def best_lag(self, form: Form, any_damping: bool) -> Lag:
        """Return the best delay and natural frequency, and the best damping if it is free.

        Parameters
        ----------
        form : Form
            Form of the transfer function.
        any_damping : bool
            Whether the damping ratio is free; otherwise it is 0.6.

        Returns
        -------
        Lag
            Lag of the smallest misfit.
        """

        def lag(x: Array) -> Lag:
            """Return the lag of the search variables."""
            return Lag(float(x[0]), math.exp(x[1]), float(x[2]) if any_damping else 0.6)

        bounds = [
            (MIN_DELAY_S, MAX_DELAY_S),
            (math.log(MIN_FREQUENCY_RADPS), math.log(MAX_FREQUENCY_RADPS)),
        ]
        bounds += [(MIN_DAMPING, MAX_DAMPING)] if any_damping else []
        starts = [(0.1, math.log(3.0), 0.6), (0.5, math.log(6.0), 0.5)]
        ends = [
            minimize(
                lambda x: self.misfit(lag(x), form),
                start[: len(bounds)],
                method="Nelder-Mead",
                bounds=bounds,
                options={"xatol": 1e-4, "fatol": 1e-6, "maxfev": 250},
            )
            for start in starts
        ]
        return lag(min(ends, key=lambda end: float(end.fun)).x)

    def misfit(self, lag: Lag, form: Form) -> float:
        """Return the misfit of a lag.

        Parameters
        ----------
        lag : Lag
            Delay, natural frequency and damping.
        form : Form
            Form of the transfer function.

        Returns
        -------
        float
            Root mean square of the pole errors over the rows, in rad/s.
        """
        return math.sqrt(float(np.mean(np.square(list(self._misses(lag, form).values())))))

    def _misses(self, lag: Lag, form: Form) -> dict[tuple[str, str], float]:
        """Return the error by row; a loop without an oscillatory pair has the error |pole|."""
        errors = {}
        for (loop, case), pole in self._printed.items():
            closed = close_loop(
                loop, self._models[case[0]], lag, CONTROLLERS[case[2]], form.approximation
            )
            error = abs(dominant(loop_state_space.poles(closed)) - pole)
            errors[loop, case] = abs(pole) if math.isnan(error) else error
        return errors

    def _interval(self, lag: Lag, form: Form) -> tuple[float, float]:
        """Return the delays up to which the misfit stays below its 95 % bound."""
        if form is NO_DELAY:
            return 0.0, 0.0
        max_misfit = INTERVAL_MISFIT_RATIO * self.misfit(lag, form)

        def end(step_s: float) -> float:
            """Return the last delay within the bound in one direction."""
            delay_s = lag.delay_s
            while (
                MIN_DELAY_S <= delay_s + step_s <= MAX_DELAY_S
                and self.misfit(lag._replace(delay_s=delay_s + step_s), form) <= max_misfit
            ):
                delay_s += step_s
            return delay_s

        return end(-DELAY_STEP_S), end(DELAY_STEP_S)
