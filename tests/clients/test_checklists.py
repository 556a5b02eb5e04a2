"""MAVSDK and MAVProxy run their checks over UDP, a noisy serial line, and at every speed."""

import contextlib
from collections.abc import Callable, Iterator

import pytest

from autopilot.telemetry import streams
from tests.clients import documented
from tests.clients.checklist import failed, score
from tests.clients.fixture import ACTS, Act, all_at_once
from tests.clients.streams import SENSES
from tests.clients.test_other_tools import LINKS as OTHER_LINKS

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]
CHECKS = {"mavsdk": 86, "mavproxy": 66}
SHORT = {"mavsdk": 19, "mavproxy": 15}
"""At 0.2x, where a dive takes minutes, short lists; ``make test-clients`` runs the full lists."""
NOISE_SPOILS = {"vehicle": 20, "ground": 1}
"""Minimum number of bytes from each end, so that the line was noisy enough."""
AT_ONCE = (("udp", "serial", "udp 0.2x"), ("udp 10x",), ("udp 50x",))
"""Links on which the clients run at the same time: slow vehicles wait, fast ones need a core each.

Ten vehicles at once starve each other on two cores, and clients then miss their time limits.
"""
Acts = Callable[[str, str], Act]


@pytest.fixture(scope="module")
def find_act(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Acts]:
    """Start the clients of one entry of ``AT_ONCE`` when the first of them is asked for.

    The clients of the entry before are ended. Each client has its own vehicle.
    """
    started: dict[tuple[str, str], Act] = {}
    with contextlib.ExitStack() as stack:

        def find(client: str, where: str) -> Act:
            if (client, where) not in started:
                stack.close()
                started.clear()
                (group,) = (group for group in AT_ONCE if where in group)
                stages = {
                    (each, link): ACTS[link](
                        each,
                        tmp_path_factory.mktemp("act"),
                        *(["--short"] if link == "udp 0.2x" else []),
                    )
                    for each in CHECKS
                    for link in group
                }
                started.update(stack.enter_context(all_at_once(stages)))
            return started[client, where]

        yield find


def test_every_stream_of_the_vehicle_is_on_the_lists() -> None:
    assert {stream.message.name for stream in streams.STREAMS} | {"HEARTBEAT"} == set(SENSES)


def test_every_link_is_tested() -> None:
    links = {where for group in AT_ONCE for where in group}
    assert links | set(OTHER_LINKS.values()) == set(ACTS)


@pytest.mark.parametrize("client", CHECKS)
@pytest.mark.parametrize("where", [where for group in AT_ONCE for where in group])
def test_every_check_passes(
    find_act: Acts, client: str, where: str, capsys: pytest.CaptureFixture[str]
) -> None:
    act = find_act(client, where)
    verdicts = act.verdicts()
    with capsys.disabled():
        print(f"\n{client} over {where}: {score(verdicts)}", end=" ")
    assert failed(verdicts) == {}
    assert len(verdicts) == (SHORT if where == "udp 0.2x" else CHECKS)[client]
    if where != "udp 0.2x":
        assert documented.passed_checks(verdicts) == documented.load()["checks"][where][client]
    if act.line is not None:
        assert all(act.line.spoilt(end) >= least for end, least in NOISE_SPOILS.items())
