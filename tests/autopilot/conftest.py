"""Fixtures of more than one test file."""

import pytest

from autopilot.telemetry.autopilot_id import AutopilotId
from tests.autopilot.qgroundcontrol import Connection, connect


@pytest.fixture(params=[AutopilotId.GENERIC, AutopilotId.PX4])
def qgc(request: pytest.FixtureRequest) -> Connection:
    """Return a QGroundControl connected to a vehicle, for each identity with PX4's modes."""
    return connect(request.param)
