"""Configure all tests: their order, a temporary state directory and the Hypothesis profiles.

The default profile always tries the same examples. `make test PYTEST=--hypothesis-profile=search`
tries new ones; add a failing example to its test with ``example``. Examples have no deadline
because kernels are compiled on their first call.
"""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# As in the ``ground`` command, before numpy is imported: products of BLAS round otherwise with
# another number of threads, and a refit here has to give the bytes of a campaign's model.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("repeatable")

LONGEST_FIRST = (
    "tests/clients/test_checklists.py",
    "tests/ground/campaign/test_run.py",
    "tests/ground/test_command_line.py",
    "tests/processes/test_onboard_log.py",
    "tests/processes/test_hardware.py",
    "tests/test_navigation_closed_loop.py",
    "tests/clients/test_link_faults.py",
    "tests/processes/test_offboard.py",
    "tests/processes/test_links.py",
    "tests/processes/test_design_test.py",
)
"""Files that take more than 20 s, in the order of their wall time."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files, then the other processes, so that no worker ends alone."""

    def rank(item: pytest.Item) -> tuple[int, bool]:
        file = item.nodeid.partition("::")[0]
        place = LONGEST_FIRST.index(file) if file in LONGEST_FIRST else len(LONGEST_FIRST)
        return place, item.get_closest_marker("process") is None

    items.sort(key=rank)


@pytest.fixture(autouse=True, scope="session")
def _hangup_ends_programs() -> None:
    """Let SIGHUP have its default effect on programs under test, also where `nohup` ran pytest."""
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(autouse=True, scope="session")
def _state_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Let programs under test store logs and keys in a temporary folder."""
    folder = tmp_path_factory.mktemp("state")
    previous = os.environ.get("XDG_STATE_HOME")
    os.environ["XDG_STATE_HOME"] = str(folder)
    yield folder
    if previous is None:
        del os.environ["XDG_STATE_HOME"]
    else:
        os.environ["XDG_STATE_HOME"] = previous
