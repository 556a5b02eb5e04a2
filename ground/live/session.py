"""The live estimate of a dive: follows her frames, and shows what they tell as often as somebody
could read it."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rich.console import RenderableType

from ground.client.vehicle import StatusText
from ground.errors import InputError
from ground.live import estimate_view
from ground.live.estimate import PLANES, EstimateStatus, LiveEstimate
from mavlink_io.clock import Every
from mavlink_io.codec import Frame
from sysid.estimation.map.fit import STRIDE
from sysid.estimation.recursive import estimator, prior, report
from sysid.estimation.recursive.estimator import Knowledge
from sysid.estimation.recursive.prediction import START_STEPS, TestSamples
from sysid.models.model_file import ModelError
from sysid.refit import RefitError, VehicleFileError

LOOK_PERIOD_S = 0.5
"""Of the wall clock: at high speed a look has many seconds of a test to take in, and is the cheaper
for it."""


class LiveSession:
    """Made before the vehicle is connected, as it compiles what it needs; a vehicle must not wait
    for that."""

    def __init__(
        self,
        prior_name: str,
        show: Callable[[RenderableType], None] | None = None,
        announce: Callable[[str], None] | None = None,
    ) -> None:
        """``show`` gets a picture at every look, ``announce`` a line after each test.

        Raises:
            BadInputError: there is no such prior.
        """
        self._knowledge = _read_prior(prior_name)
        _compile_kernels(self._knowledge)
        self._show, self._announce = show, announce
        self._estimate: LiveEstimate | None = None
        self._standing = EstimateStatus({}, (), "")
        self._due = Every(LOOK_PERIOD_S)

    def begin(self, parameters: Mapping[str, float]) -> None:
        """The vehicle is there; ``parameters`` are those aboard, as far as they are known."""
        self._estimate = LiveEstimate(self._knowledge, parameters)

    def on_frame(self, frame: Frame) -> None:
        if self._estimate is not None:
            self._estimate.on_frame(frame)

    def on_text(self, text: StatusText) -> None:
        if self._estimate is not None:
            self._estimate.on_text(text)

    def poll(self, *, last: bool = False) -> None:
        if self._estimate is None or not (last or self._due.due()):
            return
        before = self._standing
        try:
            self._standing = self._estimate.poll()
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            # Who watches must not end the dive: it goes on without an estimate.
            self._standing, self._estimate = before._replace(testing=(), trouble=str(error)), None
        if self._show is not None and self._standing.readings:
            self._show(self.picture())
        for plane, found in self._standing.readings.items():
            over = plane not in self._standing.testing and before.readings.get(plane) != found
            if over and self._announce is not None:
                self._announce(estimate_view.line(found))

    def picture(self) -> RenderableType:
        """The table as things stand."""
        return estimate_view.table(self._standing)

    def as_json(self) -> dict[str, Any]:
        """What has been told in the end."""
        return estimate_view.as_json(self._standing)


def _read_prior(prior_name: str) -> Knowledge:
    try:
        return prior.knowledge(prior_name)
    except (ModelError, RefitError, VehicleFileError) as error:
        raise InputError(f"--prior: {error}") from None


def _compile_kernels(knowledge: Knowledge) -> None:
    """Have everything compiled that a test will need, by a second of standing still."""
    for plane in PLANES:
        rows, outputs = START_STEPS + 2, 2 if plane == "yaw" else 3
        thrust = np.full(rows, knowledge.prior.config.operating_point.thrust_fraction)
        steps = TestSamples(np.zeros((rows, outputs)), np.zeros((rows, STRIDE)), thrust)
        told = estimator.finish(estimator.update(estimator.begin(knowledge, plane, 0.0), steps))
        report.read(told.prior, told.information, plane, 1.0)
