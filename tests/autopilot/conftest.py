"""Fixtures of more than one test file."""

import pytest

from autopilot.telemetry.identity import AutopilotId
from tests.autopilot.qgroundcontrol import Connection, connect


@pytest.fixture(params=list(AutopilotId))
def qgc(request: pytest.FixtureRequest) -> Connection:
    """Return a QGroundControl connected to a vehicle, for each autopilot type."""
    return connect(request.param)
