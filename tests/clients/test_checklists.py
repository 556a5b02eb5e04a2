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
"""At 0.2x, where a dive takes minutes, short lists; ``make clients`` runs the full lists."""
NOISE_SPOILS = {"vehicle": 20, "ground": 1}
"""Minimum number of bytes from each end, so that the line was noisy enough."""


@pytest.fixture(scope="module")
def acts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[tuple[str, str], Act]]:
    """Run all clients at once, each with its own vehicle, because clients mostly wait."""
    stages = {
        (client, where): start(
            client, tmp_path_factory.mktemp("act"), *(["--short"] if where == "udp 0.2x" else [])
        )
        for client in CHECKS
        for where, start in ACTS.items()
    }
    with all_at_once(stages) as acts:
        yield acts


def test_every_stream_of_the_vehicle_is_on_the_lists() -> None:
    assert {stream.message.name for stream in streams.STREAMS} | {"HEARTBEAT"} == set(SENSES)


@pytest.mark.parametrize("where", ACTS)
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
