"""Run every client on every link at every speed with the full lists, and print pass counts.

Usage: python -m tests.clients [--link LINK]... [--out FILE.json] [--record]

Exit status 1 when a check failed.
``--record`` stores the results, from which the tables of the documentation are made.
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
    mavsdk_action_results,
)


def run_checks(where: str) -> dict[str, Verdicts]:
    """Run both clients at once, each with its own vehicle."""
    with tempfile.TemporaryDirectory() as folder:
        homes = {client: Path(folder) / client for client in PROGRAMS}
        for home in homes.values():
            home.mkdir()
        with all_at_once(
            {client: ACTS[where](client, home) for client, home in homes.items()}
        ) as acts:
            return {client: act.verdicts() for client, act in acts.items()}


def record(results: dict[str, dict[str, Verdicts]]) -> None:
    """Store the results for the tables of the documentation; other links keep theirs."""
    actions = {name: outcome["result"] for name, outcome in mavsdk_action_results().items()}
    checks = documented.load()["checks"] | {
        where: {
            client: documented.passed_checks(verdicts) for client, verdicts in by_client.items()
        }
        for where, by_client in results.items()
    }
    stored = {"mavsdk action": dict(sorted(actions.items())), "checks": checks}
    documented.RESULTS.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")


def main(out: Path | None, links: list[str], *, recorded: bool) -> int:
    console, table = Console(), Table("link", *PROGRAMS, title="checks passed")
    results = {}
    for where in links:
        results[where] = run_checks(where)
        table.add_row(where, *(score(results[where][client]) for client in PROGRAMS))
    console.print(table)
    problems = {
        f"{client} over {where}: {check}": why
        for where, clients in results.items()
        for client, verdicts in clients.items()
        for check, why in failed(verdicts).items()
    }
    for check, why in problems.items():
        console.print(f"{check}: {why}", highlight=False)
    if recorded:
        record(results)
    if out is not None:
        out.write_text(json.dumps(results, indent=1))
    return 1 if problems else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, metavar="FILE.json")
    parser.add_argument("--link", action="append", choices=ACTS)
    parser.add_argument("--record", action="store_true")
    options = parser.parse_args()
    sys.exit(main(options.out, options.link or list(ACTS), recorded=options.record))
