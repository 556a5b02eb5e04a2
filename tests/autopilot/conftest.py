"""Fixtures of more than one test file."""

from collections.abc import Iterator

import pytest

from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io.transport import MemoryTransport, open_transport
from tests.autopilot.qgroundcontrol import Connection, connect


@pytest.fixture(params=[AutopilotId.GENERIC, AutopilotId.PX4])
def qgc(request: pytest.FixtureRequest) -> Connection:
    """Return a QGroundControl connected to a vehicle, for each identity with PX4's modes."""
    return connect(request.param)


@pytest.fixture
def ends() -> Iterator[tuple[MemoryTransport, MemoryTransport]]:
    """Return both ends of a HIL link inside the process."""
    near, far = open_transport("memory:hil"), open_transport("memory:hil")
    assert isinstance(near, MemoryTransport)
    assert isinstance(far, MemoryTransport)
    yield near, far
    near.close()
    far.close()
