"""DroneKit, pymavlink, node-mavlink, and MAVProxy with its own ArduSub modes, each on one link.

``make test-clients`` runs each program on every link; here they run at the same time.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.clients import documented
from tests.clients.checklist import failed, score
from tests.clients.fixture import ACTS, PROGRAMS, Act, afloat, all_at_once
from tests.clients.mavproxy_checks import ARDUSUB
from tests.helpers import node
from tests.helpers.pty_pair import ENDS
from tests.helpers.subprocesses import free_port, process

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]
LINKS = {"dronekit": "tcp", "pymavlink": "udp", "node": "lossy"}
ARDUSUB_MAVPROXY = "mavproxy as ArduSub"
MIN_LOSS = 0.05
"""Minimum fraction of frames from each end that the noisy line must lose."""


@contextlib.contextmanager
def mavproxy_as_ardusub(folder: Path) -> Iterator[Act]:
    """Start MAVProxy with its own names of ArduSub's modes."""
    address = f"127.0.0.1:{free_port()}"
    arguments = ("-m", "tests.clients.mavproxy_checks", str(folder), f"udpin:{address}")
    options = ("--autopilot-id", "ardupilot")
    with (
        afloat(f"udpout:{address}", options=options) as vehicle,
        process(*arguments, "--ardusub") as program,
    ):
        yield Act(program, None, vehicle)


@pytest.fixture(scope="module")
def acts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Act]]:
    """Start all programs; node-mavlink only where its packages can be installed."""
    stages = {
        client: ACTS[where](client, tmp_path_factory.mktemp(client))
        for client, where in LINKS.items()
        if not (PROGRAMS[client].in_javascript and node.mavlink_failure())
    }
    stages[ARDUSUB_MAVPROXY] = mavproxy_as_ardusub(tmp_path_factory.mktemp("mavproxy"))
    with all_at_once(stages) as started:
        yield started


@pytest.mark.parametrize("client", [*LINKS, ARDUSUB_MAVPROXY])
def test_tool_passes_every_check(
    acts: dict[str, Act], client: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if client not in acts:
        pytest.skip(node.mavlink_failure())
    act = acts[client]
    verdicts = act.verdicts()
    with capsys.disabled():
        print(f"\n{client}: {score(verdicts)}", end=" ")
    assert failed(verdicts) == {}
    if client == ARDUSUB_MAVPROXY:
        assert len(verdicts) == len(ARDUSUB)
        return
    recorded = documented.load()["checks"][LINKS[client]][client]
    assert documented.passed_checks(verdicts) == recorded
    if act.line is not None:
        assert all(act.line.lost_frames(end) > MIN_LOSS for end in ENDS)
