"""Tables of the documentation from measured results, so that a page cannot claim more.

Usage: python -m tests.clients.documented [--check]. ``results.json`` has the results of the last
``make test-clients``; the tests that run the clients compare their own results with it.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tests.clients.mavsdk_actions import CALLS, HOLD, MANUAL, Call

RESULTS = Path(__file__).with_name("results.json")
DOCS = Path(__file__).parents[2] / "docs"
BEGIN, END = "<!-- {name}: python -m tests.clients.documented -->\n", "<!-- end of {name} -->\n"
MODE_NAMES = {HOLD: "HOLD", MANUAL: "MANUAL"}
CLIENTS = {"mavsdk": "MAVSDK 4.1", "mavproxy": "MAVProxy 1.8.75"}
LINKS = {
    "udp": "UDP",
    "serial": "serial, 57600 baud, 3e-4 of the bytes lost and 3e-4 corrupted each way",
    "udp 0.2x": "UDP, vehicle time 0.2x",
    "udp 10x": "UDP, vehicle time 10x",
    "udp 50x": "UDP, vehicle time 50x",
}
Results = Mapping[str, Any]


def load() -> Results:
    """Return the committed results."""
    results: Results = json.loads(RESULTS.read_text(encoding="utf-8"))
    return results


def passed_checks(verdicts: Mapping[str, Mapping[str, Any]]) -> dict[str, bool]:
    """Return whether each check of a client passed."""
    return {name: bool(verdict["pass"]) for name, verdict in verdicts.items()}


def _state(call: Call) -> str:
    """Return the state of the vehicle before a call."""
    return "disarmed" if call.armed_in is None else f"armed in {MODE_NAMES[call.armed_in]}"


def action_table(results: Results) -> str:
    """Return MAVSDK's methods by result and state."""
    groups: dict[tuple[str, str], list[str]] = {}
    for call in CALLS:
        key = results["mavsdk action"][call.method], _state(call)
        groups.setdefault(key, []).append(f"`{call.method}`")
    lines = ["| result | before the call | methods |", "|---|---|---|"]
    for (result, state), methods in sorted(groups.items(), key=lambda row: row[0][0] != "SUCCESS"):
        lines.append(f"| {result} | {state} | {', '.join(methods)} |")
    return "\n".join(lines) + "\n"


def pass_table(results: Results) -> str:
    """Return the number of passed checks of each client on each link."""
    lines = [f"| link | {' | '.join(CLIENTS.values())} |", "|---" * (1 + len(CLIENTS)) + "|"]
    for link, by_client in results["checks"].items():
        scores = (
            f"{sum(by_client[client].values())}/{len(by_client[client])}" for client in CLIENTS
        )
        lines.append(f"| {LINKS[link]} | {' | '.join(scores)} |")
    return "\n".join(lines) + "\n"


def client_table(results: Results) -> str:
    """Return what each client can do, with the measured counts."""
    action = results["mavsdk action"]
    works = sum(result == "SUCCESS" for result in action.values())
    udp = results["checks"]["udp"]
    failed = {
        client: [name for name, passed in udp[client].items() if not passed] for client in CLIENTS
    }
    rows = [
        (
            CLIENTS["mavsdk"],
            f"{sum(udp['mavsdk'].values())} of {len(udp['mavsdk'])} checks over UDP; {works} of"
            f" {len(action)} methods of `action` ([list](#mavsdks-actions))",
            "; ".join(
                [
                    *failed["mavsdk"],
                    "signed links",
                    f"the {len(action) - works} other actions",
                    "writing files",
                ]
            ),
        ),
        (
            CLIENTS["mavproxy"],
            f"{sum(udp['mavproxy'].values())} of {len(udp['mavproxy'])} checks over UDP;"
            " `ground modes export-mavproxy` once for mode names",
            "; ".join(failed["mavproxy"]),
        ),
        (
            "QGroundControl",
            "not run; its requirements as read in its source are tested message by message"
            " (`tests/autopilot/test_qgroundcontrol*.py`)",
            "mode buttons, unless started as `autopilot --autopilot-id px4`; then its setup pages"
            " miss PX4's parameters",
        ),
    ]
    lines = ["| tool | works | does not |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


TABLES: dict[str, tuple[str, Callable[[Results], str]]] = {
    "clients": ("mavlink.md", client_table),
    "MAVSDK actions": ("mavlink.md", action_table),
    "checks": ("clients.md", pass_table),
}
"""File and content of each table."""


def render(name: str, page: str, results: Results) -> str:
    """Return a page with its table from the results. Raises ValueError without such a table."""
    begin, end = BEGIN.format(name=name), END.format(name=name)
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return before + begin + TABLES[name][1](results) + end + after


def main(check: bool) -> int:
    """Write the tables; with ``check`` only report the pages that differ."""
    results, different = load(), set()
    for name, (file, _) in TABLES.items():
        path = DOCS / file
        page = path.read_text(encoding="utf-8")
        if (new := render(name, page, results)) != page:
            different.add(file)
            if not check:
                path.write_text(new, encoding="utf-8")
    print("changed:" if different else "no change", *sorted(different))
    return 1 if check and different else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    sys.exit(main(parser.parse_args().check))
