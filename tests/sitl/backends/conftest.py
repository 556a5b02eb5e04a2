"""Fixtures of more than one test file."""

from collections.abc import Iterator

import pytest

from mavlink_io.transport import Transport, open_transport


@pytest.fixture
def ends() -> Iterator[tuple[Transport, Transport]]:
    """Return both ends of a link inside the process."""
    near, far = open_transport("memory:backend"), open_transport("memory:backend")
    yield near, far
    near.close()
    far.close()
