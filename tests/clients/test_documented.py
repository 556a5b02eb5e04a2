"""The tables of clients in the documentation are those of the measured results."""

import pytest

from tests.clients import documented
from tests.clients.fixture import ACTS, clients_on
from tests.clients.mavsdk_actions import CALLS


@pytest.mark.parametrize("name", documented.TABLES)
def test_table_of_page_is_that_of_results(name: str) -> None:
    file, _ = documented.TABLES[name]
    page = (documented.DOCS / file).read_text(encoding="utf-8")
    assert documented.render(name, page, documented.load()) == page, (
        "run python -m tests.clients.documented"
    )


def test_results_cover_every_method_and_link() -> None:
    results = documented.load()
    assert set(results["mavsdk action"]) == {call.method for call in CALLS}
    assert list(results["checks"]) == list(ACTS) == list(documented.LINKS)
    for where, by_client in results["checks"].items():
        assert by_client
        assert set(by_client) <= set(clients_on(where))
    assert list(results["checks"]["udp"]) == clients_on("udp")


def test_failed_check_is_shown() -> None:
    """A result that is worse changes the tables."""
    results = documented.load()
    checks = dict(results["checks"]["udp"]["mavproxy"])
    first = next(iter(checks))
    worse = {
        **results,
        "mavsdk action": {**results["mavsdk action"], "arm": "TIMEOUT"},
        "mavproxy command": {**results["mavproxy command"], "arm": "failed"},
        "checks": {
            **results["checks"],
            "udp": {**results["checks"]["udp"], "mavproxy": {**checks, first: False}},
        },
    }
    assert f"{len(checks) - 1}/{len(checks)}" in documented.pass_table(worse)
    assert first in documented.client_table(worse)
    assert f"| MAVProxy 1.8.75 | UDP | {first} |" in documented.failure_table(worse)
    assert "| failed | `arm` |" in documented.command_table(worse)
    assert "| TIMEOUT | disarmed | `arm` |" in documented.action_table(worse)
