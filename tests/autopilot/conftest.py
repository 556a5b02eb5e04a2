"""Fixtures of more than one file."""

import pytest

from autopilot.telemetry.identity import AutopilotId
from tests.autopilot.qgroundcontrol import Connection, connect


@pytest.fixture(params=list(AutopilotId))
def qgc(request: pytest.FixtureRequest) -> Connection:
    """QGroundControl connected to a vehicle of each personality."""
    return connect(request.param)
