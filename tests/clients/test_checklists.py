"""MAVSDK and MAVProxy, as they are, go down their whole lists: over UDP and over a noisy 57600 baud line."""

from collections.abc import Iterator

import pytest

from tests.clients.checklist import failed, score
from tests.clients.scene import Act, all_at_once, over_serial, over_udp

pytestmark = [pytest.mark.process, pytest.mark.timeout(500)]
CHECKS = {"mavsdk": 77, "mavproxy": 58}
TRANSPORTS = {"udp": over_udp, "serial": over_serial}


@pytest.fixture(scope="module")
def acts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[tuple[str, str], Act]]:
    """All four at once, each with a vehicle of its own: clients spend their time waiting."""
    stages = {
        (client, transport): start(client, tmp_path_factory.mktemp(f"{client}-{transport}"))
        for client in CHECKS
        for transport, start in TRANSPORTS.items()
    }
    with all_at_once(stages) as acts:
        yield acts


@pytest.mark.parametrize("transport", TRANSPORTS)
@pytest.mark.parametrize("client", CHECKS)
def test_every_check_passes(
    acts: dict[tuple[str, str], Act], client: str, transport: str, capsys: pytest.CaptureFixture[str]
) -> None:
    act = acts[client, transport]
    found = act.verdicts()
    with capsys.disabled():
        print(f"\n{client} over {transport}: {score(found)}", end=" ")
    assert failed(found) == {}
    assert len(found) == CHECKS[client]
    if act.line is not None:
        assert act.line.spoilt("vehicle") > 20
        assert act.line.spoilt("ground") > 0
