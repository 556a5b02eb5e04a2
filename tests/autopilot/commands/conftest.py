"""A connected vehicle, and a wall clock that a test can advance."""

from collections.abc import Callable

import pytest

from autopilot.comms import ground_server, services, statustext
from mavlink_io.clock import wall_s
from tests.helpers.commands import FIX
from tests.helpers.fake_hil import Harness


@pytest.fixture
def harness() -> Harness:
    harness = Harness()
    harness.tick(3, fix=FIX)
    harness.serve()
    harness.station.pop_received()
    return harness


@pytest.fixture
def pass_time(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Return a function that advances the wall clock."""
    now = [wall_s()]
    for module in (ground_server, services, statustext):
        monkeypatch.setattr(module, "wall_s", lambda: now[0])

    def pass_time(seconds: float) -> None:
        """Return a function that advances the wall clock."""
        now[0] += seconds

    return pass_time
