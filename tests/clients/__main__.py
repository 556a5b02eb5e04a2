"""Run every client on every link at every speed with the full lists, and print pass counts.

Usage: python -m tests.clients [--link LINK]... [--client CLIENT]... [--lists] [--out FILE.json]
[--record]

Exit status 1 when a check failed.
``--record`` stores the results, from which the tables of the documentation are made; ``--lists``
also calls MAVSDK's actions and types MAVProxy's commands.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.clients import documented
from tests.clients.checklist import failed, score
from tests.clients.fixture import (
    ACTS,
    PROGRAMS,
    Verdicts,
    all_at_once,
    clients_on,
    mavproxy_command_results,
    mavsdk_action_results,
)

AT_ONCE = 5
"""Number of clients that run at the same time."""


def run_checks(where: str, clients: list[str]) -> dict[str, Verdicts]:
    """Run clients five at once, each with its own vehicle."""
    verdicts: dict[str, Verdicts] = {}
    for first in range(0, len(clients), AT_ONCE):
        verdicts |= run_at_once(where, clients[first : first + AT_ONCE])
    return verdicts


def run_at_once(where: str, clients: list[str]) -> dict[str, Verdicts]:
    with tempfile.TemporaryDirectory() as folder:
        homes = {client: Path(folder) / client for client in clients}
        for home in homes.values():
            home.mkdir()
        with all_at_once(
            {client: ACTS[where](client, home) for client, home in homes.items()}
        ) as acts:
            return {client: act.verdicts() for client, act in acts.items()}


def record(results: dict[str, dict[str, Verdicts]]) -> None:
    """Store the results for the tables of the documentation; other links keep theirs."""
    stored = dict(documented.load())
    checks = stored["checks"]
    for where, by_client in results.items():
        checks.setdefault(where, {}).update(
            {client: documented.passed_checks(verdicts) for client, verdicts in by_client.items()}
        )
    stored["checks"] = {
        where: {client: checks[where][client] for client in PROGRAMS if client in checks[where]}
        for where in ACTS
        if where in checks
    }
    documented.store(stored)


def record_lists() -> dict[str, str]:
    """Store the results of MAVSDK's actions and MAVProxy's commands; return what differs."""
    with tempfile.TemporaryDirectory() as folder:
        lists = {
            "mavsdk action": mavsdk_action_results(),
            "mavproxy command": mavproxy_command_results(Path(folder)),
        }
    stored = dict(documented.load())
    for name, outcomes in lists.items():
        stored[name] = {key: outcome["result"] for key, outcome in sorted(outcomes.items())}
    stored["mavsdk reason"] |= {
        key: outcome["reason"]
        for key, outcome in sorted(lists["mavsdk action"].items())
        if outcome.get("reason")
    }
    documented.store(stored)
    return {
        f"{name}: {key}": outcome["why"]
        for name, outcomes in lists.items()
        for key, outcome in outcomes.items()
        if outcome["why"]
    }


def main(
    out: Path | None, links: list[str], clients: list[str], *, recorded: bool, lists: bool
) -> int:
    console, table = Console(), Table("link", *clients, title="checks passed")
    results = {}
    for where in links:
        results[where] = run_checks(where, [c for c in clients_on(where) if c in clients])
        scores = (score(results[where][c]) if c in results[where] else "" for c in clients)
        table.add_row(where, *scores)
        if recorded:
            record({where: results[where]})
    console.print(table)
    problems = {
        f"{client} over {where}: {check}": why
        for where, clients in results.items()
        for client, verdicts in clients.items()
        for check, why in failed(verdicts).items()
    }
    if lists:
        problems |= record_lists()
    for check, why in problems.items():
        console.print(f"{check}: {why}", highlight=False)
    if out is not None:
        out.write_text(json.dumps(results, indent=1))
    return 1 if problems else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, metavar="FILE.json")
    parser.add_argument("--link", action="append", choices=ACTS)
    parser.add_argument("--client", action="append", choices=PROGRAMS)
    parser.add_argument("--lists", action="store_true")
    parser.add_argument("--record", action="store_true")
    options = parser.parse_args()
    links, clients = options.link or list(ACTS), options.client or list(PROGRAMS)
    sys.exit(main(options.out, links, clients, recorded=options.record, lists=options.lists))
