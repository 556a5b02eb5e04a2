"""The tailcone that explains all nine printed poles best, for each reading of the printed transfer
function.

Readings differ in the actuator's second-order lag and in the delay's form; the delay is searched,
and the lag where a reading leaves it open. Poles are the loops' own
(``sysid.control_analysis.loop_transfer``)."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Approximation, Lag
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
    """How a delay is put into a transfer function."""

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
"""Ogata 2: a delay's Taylor series of the second order over its mirror image. Exact: Pade 6, within
1e-5 rad of the delay over the poles' frequencies and the delays that are tried."""
FIGURE_4 = "s^2/9 + 4s/10 + 1"
STATED = "as stated"
LAGS = {
    FIGURE_4: Lag(0.0, 3.0, 0.6),
    "s^2/3 + 4s/10 + 1": Lag(0.0, math.sqrt(3.0), 0.2 * math.sqrt(3.0)),
    "3s^2 + 4s/10 + 1": Lag(0.0, 1.0 / math.sqrt(3.0), 0.2 / math.sqrt(3.0)),
    "none": Lag(0.0, 60.0, 1.0),
}
"""Denominators: with the cut-off of figure 4; with a power lost; as printed; and a lag too fast to
matter."""
DELAYS_S = np.arange(0.1, 1.01, 0.1)
MIN_DELAY_S, MAX_DELAY_S, DELAY_STEP_S = 0.0, 1.1, 0.02
FREE_FREQUENCY = "free, damping 0.6"
FREE_DAMPING = "free, at least 0.2"
MIN_FREQUENCY_RADPS, MAX_FREQUENCY_RADPS, MIN_DAMPING, MAX_DAMPING = 1.0, 20.0, 0.2, 1.2
UNEXPLAINED_SHARE = 0.1
"""A row remains unexplained beyond this share of its printed pole."""
INTERVAL_MISFIT_RATIO = math.exp(3.84 / (4.0 * len(TABLE_4)))
"""The rms misfit at the ends of a delay's 95 % interval over its least, were the misfits
independent and normal: two real numbers a row, n ln(sum of squares) up by 3.84."""


class TransferReading(NamedTuple):
    lag_name: str
    form: str
    lag: Lag
    misfit_radps: float
    """Distance of printed from reckoned poles, rms over the nine rows."""
    delays_s: tuple[float, float]
    """Delays that explain the rows hardly worse, the lag kept: 95 %, were the misfits noise."""
    remain: tuple[tuple[str, str], ...]
    """Rows missed by more than a tenth."""


def readings(printed: Printed = TABLE_4) -> list[TransferReading]:
    """The stated tailcone; then the best delay of all forms behind figure 4's lag, of the best form
    behind others."""
    search = TailconeSearch(printed)
    known = LAGS[FIGURE_4]
    found = [search.reading(STATED, FORMS[1], LAG), search.reading(FIGURE_4, NO_DELAY, known)]
    for name, lag in LAGS.items():
        tried = [(form, search.best_delay(lag, form)) for form in FORMS]
        shown = (
            tried
            if lag is known
            else [min(tried, key=lambda each: search.misfit(each[1], each[0]))]
        )
        found += [search.reading(name, form, delayed) for form, delayed in shown]
    exact = FORMS[-1]
    found += [
        search.reading(name, exact, search.best_lag(exact, name == FREE_DAMPING))
        for name in (FREE_FREQUENCY, FREE_DAMPING)
    ]
    return found


class TailconeSearch:
    """Misfits of candidate tailcones to printed poles."""

    def __init__(self, printed: Printed = TABLE_4) -> None:
        self._printed, self._models = printed, models()

    def reading(self, name: str, form: Form, lag: Lag) -> TransferReading:
        misses = self._misses(lag, form)
        remain = tuple(
            row
            for row, miss in misses.items()
            if not miss <= UNEXPLAINED_SHARE * abs(self._printed[row])
        )
        return TransferReading(
            name, form.name, lag, self.misfit(lag, form), self._interval(lag, form), remain
        )

    def best_delay(self, lag: Lag, form: Form) -> Lag:
        def misfit(delay_s: float) -> float:
            return self.misfit(lag._replace(delay_s=delay_s), form)

        coarse = float(min(DELAYS_S, key=misfit))
        step = float(DELAYS_S[1] - DELAYS_S[0])
        fine = minimize_scalar(
            misfit, bounds=(coarse - step, coarse + step), options={"xatol": 1e-3}
        )
        return lag._replace(delay_s=float(fine.x))

    def best_lag(self, form: Form, any_damping: bool) -> Lag:
        """Delay and natural frequency searched together, and the damping where it is free."""

        def lag(x: Array) -> Lag:
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
        """Rms over the rows, rad/s."""
        return math.sqrt(float(np.mean(np.square(list(self._misses(lag, form).values())))))

    def _misses(self, lag: Lag, form: Form) -> dict[tuple[str, str], float]:
        """Distances by row; a loop without an oscillating pair is as far off as the pole itself."""
        found = {}
        for (loop, case), pole in self._printed.items():
            whole = close_loop(
                loop, self._models[case[0]], lag, CONTROLLERS[case[2]], form.approximation
            )
            miss = abs(dominant(loop_transfer.poles(whole)) - pole)
            found[loop, case] = abs(pole) if math.isnan(miss) else miss
        return found

    def _interval(self, lag: Lag, form: Form) -> tuple[float, float]:
        """As far as the misfit stays below WIDER times what it is."""
        if form is NO_DELAY:
            return 0.0, 0.0
        most = INTERVAL_MISFIT_RATIO * self.misfit(lag, form)

        def end(step_s: float) -> float:
            delay_s = lag.delay_s
            while (
                MIN_DELAY_S <= delay_s + step_s <= MAX_DELAY_S
                and self.misfit(lag._replace(delay_s=delay_s + step_s), form) <= most
            ):
                delay_s += step_s
            return delay_s

        return end(-DELAY_STEP_S), end(DELAY_STEP_S)
