"""State directory of programs under test, and Hypothesis profiles.

The default profile always tries the same examples. The profile ``search``
(`make test PYTEST=--hypothesis-profile=search`) tries new ones; add a failing one to its test as an
``example``. No example has a deadline: the first call may compile a kernel.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True, scope="session")
def _state_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Set XDG_STATE_HOME to a temporary folder, so that no test writes to the user's."""
    folder = tmp_path_factory.mktemp("state")
    previous = os.environ.get("XDG_STATE_HOME")
    os.environ["XDG_STATE_HOME"] = str(folder)
    yield folder
    if previous is None:
        del os.environ["XDG_STATE_HOME"]
    else:
        os.environ["XDG_STATE_HOME"] = previous
