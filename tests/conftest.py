"""What every test keeps off, the state directory of whoever runs it; and the examples of
properties.

A checkout always tries the same ones; `make test PYTEST=--hypothesis-profile=search` tries new ones
each time, and what it finds becomes an ``example`` of its test. None is timed: a kernel compiled on
first call is no defect."""

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
    """Programs under test keep their logs and keys in a folder of this run."""
    folder = tmp_path_factory.mktemp("state")
    kept = os.environ.get("XDG_STATE_HOME")
    os.environ["XDG_STATE_HOME"] = str(folder)
    yield folder
    if kept is None:
        del os.environ["XDG_STATE_HOME"]
    else:
        os.environ["XDG_STATE_HOME"] = kept
