"""MAVSDK and MAVProxy run their checks over UDP, a noisy serial line, and at every speed."""

from collections.abc import Iterator

import pytest

from autopilot.telemetry import streams
from tests.clients.checklist import failed, score
from tests.clients.fixture import ACTS, Act, all_at_once
from tests.clients.streams import SENSES

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]
CHECKS = {"mavsdk": 85, "mavproxy": 63}
SHORT = {"mavsdk": 19, "mavproxy": 15}
"""At 0.2x, where a dive takes minutes, short lists; ``make test-clients`` runs the full lists."""
NOISE_SPOILS = {"vehicle": 20, "ground": 1}
"""Minimum number of bytes from each end, so that the line was noisy enough."""


AT_ONCE = (("udp", "serial", "udp 0.2x"), ("udp 10x",), ("udp 50x",))
"""Links on which the clients run at the same time: slow vehicles wait, fast ones need a core each.

Ten vehicles at once starve each other on two cores, and clients then miss their time limits.
"""


@pytest.fixture(scope="module")
def acts(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[tuple[str, str], Act]]:
    """Run the clients of one entry of ``AT_ONCE``, each with its own vehicle."""
    stages = {
        (client, where): ACTS[where](
            client, tmp_path_factory.mktemp("act"), *(["--short"] if where == "udp 0.2x" else [])
        )
        for client in CHECKS
        for where in request.param
    }
    with all_at_once(stages) as acts:
        yield acts


def test_every_stream_of_the_vehicle_is_on_the_lists() -> None:
    assert {stream.message.name for stream in streams.STREAMS} | {"HEARTBEAT"} == set(SENSES)


def test_every_link_is_tested() -> None:
    assert sorted(where for group in AT_ONCE for where in group) == sorted(ACTS)


@pytest.mark.parametrize(
    ("acts", "where"),
    [pytest.param(group, where, id=where) for group in AT_ONCE for where in group],
    indirect=["acts"],
)
@pytest.mark.parametrize("client", CHECKS)
def test_every_check_passes(
    acts: dict[tuple[str, str], Act], client: str, where: str, capsys: pytest.CaptureFixture[str]
) -> None:
    act = acts[client, where]
    found = act.verdicts()
    with capsys.disabled():
        print(f"\n{client} over {where}: {score(found)}", end=" ")
    assert failed(found) == {}
    assert len(found) == (SHORT if where == "udp 0.2x" else CHECKS)[client]
    if act.line is not None:
        assert all(act.line.spoilt(end) >= least for end, least in NOISE_SPOILS.items())
