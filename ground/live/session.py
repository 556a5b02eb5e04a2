"""Estimate a vehicle live during a dive and display the estimate at a readable rate."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rich.console import RenderableType

from ground.client.vehicle import StatusText
from ground.live import estimate_view
from ground.live.estimate import EstimateStatus, LiveEstimate
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame
from mavlink_io.errors import InputError
from sysid.estimation.map.datasets import STRIDE
from sysid.estimation.recursive import estimator, intervals, prior, report
from sysid.estimation.recursive.estimator import Knowledge
from sysid.estimation.recursive.prediction import START_STEPS, TestSamples
from sysid.planes import PLANES

LOOK_PERIOD_S = 0.5
"""Time between two evaluations, by the wall clock (s).

At high simulation speed one evaluation processes many seconds of a test, which costs less per
second of the test.
"""


class LiveSession:
    """Live estimate of one vehicle during a dive.

    Create it before the vehicle is connected: it compiles its kernels, and a vehicle must not wait
    for that.

    Parameters
    ----------
    prior_name : str
        Name or file of the prior.
    show : callable, optional
        Function that receives the display after every evaluation.
    announce : callable, optional
        Function that receives one line after each test.

    Raises
    ------
    InputError
        The prior does not exist or cannot be read.
    """

    def __init__(
        self,
        prior_name: str,
        show: Callable[[RenderableType], None] | None = None,
        announce: Callable[[str], None] | None = None,
    ) -> None:
        self._knowledge = _read_prior(prior_name)
        _compile_kernels(self._knowledge)
        self._show, self._announce = show, announce
        self._estimate: LiveEstimate | None = None
        self._status = EstimateStatus({}, (), "")
        self._due = Interval(LOOK_PERIOD_S)

    def begin(self, parameters: Mapping[str, float]) -> None:
        """Start the estimate of a vehicle; ``parameters`` are its known parameters."""
        self._estimate = LiveEstimate(self._knowledge, parameters)

    def on_frame(self, frame: Frame) -> None:
        """Add a frame to the estimate."""
        if self._estimate is not None:
            self._estimate.on_frame(frame)

    def on_text(self, text: StatusText) -> None:
        """Add a text of the vehicle, which may mark a test, to the estimate."""
        if self._estimate is not None:
            self._estimate.on_text(text)

    def poll(self, *, last: bool = False) -> None:
        """Update the estimate when due or at the ``last`` call; an error ends the estimate only."""
        if self._estimate is None or not (last or self._due.due()):
            return
        before = self._status
        try:
            self._status = self._estimate.poll()
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            # An error of the estimate must not end the dive: it continues without an estimate.
            self._status, self._estimate = before._replace(testing=(), trouble=str(error)), None
        if self._show is not None and self._status.readings:
            self._show(self.picture())
        for plane, reading in self._status.readings.items():
            finished = plane not in self._status.testing and before.readings.get(plane) != reading
            if finished and self._announce is not None:
                self._announce(estimate_view.line(reading))

    def picture(self) -> RenderableType:
        """Return the table of the current estimate."""
        return estimate_view.table(self._status)

    def panel(self) -> dict[str, Any]:
        """Return the current estimate for the live page."""
        return estimate_view.as_panel(self._status)

    def as_json(self) -> dict[str, Any]:
        """Return the current estimate as JSON values."""
        return estimate_view.as_json(self._status)


def _read_prior(prior_name: str) -> Knowledge:
    """Return the prior of a name or file. Raises InputError."""
    try:
        return prior.knowledge(prior_name)
    except InputError as error:
        raise type(error)(f"--prior: {error}") from None


def _compile_kernels(knowledge: Knowledge) -> None:
    """Compile all kernels that a test needs, with a short data set of zeros."""
    for plane, traits in PLANES.items():
        rows, outputs = START_STEPS + 2, traits.n_outputs
        thrust = np.full(rows, knowledge.prior.config.operating_point.thrust_fraction)
        steps = TestSamples(np.zeros((rows, outputs)), np.zeros((rows, STRIDE)), thrust)
        knowledge_after = estimator.finish(
            estimator.update(estimator.begin(knowledge, plane, 0.0), steps)
        )
        report.read(knowledge_after.prior, intervals.estimate(knowledge_after), plane, 1.0)
