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
CLIENTS = {
    "mavsdk": "MAVSDK 4.1",
    "mavproxy": "MAVProxy 1.8.75",
    "dronekit": "DroneKit 3.0",
    "pymavlink": "pymavlink 2.4.50",
    "node": "node-mavlink 2.3",
}
LINKS = {
    "udp": "UDP",
    "tcp": "TCP",
    "lossy": "serial, 57600 baud, 10 % of the frames lost each way",
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


def store(results: Results) -> None:
    """Replace the committed results."""
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


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


def reason_table(results: Results) -> str:
    """Return the texts with which the vehicle refuses MAVSDK's methods."""
    rows = [f"| `{method}` | {text} |" for method, text in results["mavsdk reason"].items()]
    return "\n".join(["| method | text of the vehicle |", "|---|---|", *rows]) + "\n"


COMMAND_RESULTS = {
    "works": "works",
    "refused": "refused (UNSUPPORTED or DENIED)",
    "no effect": "message without an answer, for which the vehicle has no use",
    "local": "about MAVProxy itself or parameters of ArduPilot",
    "failed": "failed",
}


def command_table(results: Results) -> str:
    """Return MAVProxy's commands by result."""
    lines = ["| result | commands |", "|---|---|"]
    for result, text in COMMAND_RESULTS.items():
        names = [n for n, outcome in results["mavproxy command"].items() if outcome == result]
        if names:
            lines.append(f"| {text} | {', '.join(f'`{name}`' for name in names)} |")
    return "\n".join(lines) + "\n"


def pass_table(results: Results) -> str:
    """Return the number of passed checks of each client on each link."""
    lines = [f"| link | {' | '.join(CLIENTS.values())} |", "|---" * (1 + len(CLIENTS)) + "|"]
    for link, by_client in results["checks"].items():
        scores = (_score(by_client.get(client, {})) for client in CLIENTS)
        lines.append(f"| {LINKS[link]} | {' | '.join(scores)} |")
    return "\n".join(lines) + "\n"


def _score(checks: Mapping[str, bool]) -> str:
    """Return the pass count; empty for a client that was not tried."""
    return f"{sum(checks.values())}/{len(checks)}" if checks else ""


def failure_table(results: Results) -> str:
    """Return the checks that failed, with client and link; "none" without one."""
    rows = [
        f"| {CLIENTS[client]} | {LINKS[link]} | {name} |"
        for link, by_client in results["checks"].items()
        for client, checks in by_client.items()
        for name, passed in checks.items()
        if not passed
    ]
    if not rows:
        return "none\n"
    return "\n".join(["| tool | link | failed check |", "|---|---|---|", *rows]) + "\n"


def client_table(results: Results) -> str:
    """Return what each client can do, with the measured counts."""
    action, commands = results["mavsdk action"], results["mavproxy command"]
    works = sum(result == "SUCCESS" for result in action.values())
    typed = sum(result == "works" for result in commands.values())
    sent = sum(result not in ("local", "no effect") for result in commands.values())
    rows = [
        (
            "mavsdk",
            f"{works} of {len(action)} methods of `action` ([list](#mavsdks-actions))",
            f"signed links; the {len(action) - works} other actions; writing files",
        ),
        (
            "mavproxy",
            f"{typed} of {sent} commands to a vehicle ([list](#mavproxys-commands));"
            " `ground modes export-mavproxy` once for mode names",
            f"the {sent - typed} other commands: refused",
        ),
        ("dronekit", "`autopilot --autopilot-id ardupilot`", "`simple_takeoff`, gimbal"),
        ("pymavlink", "`ground modes export-mavproxy` once for mode names", ""),
        ("node", "", ""),
    ]
    lines = ["| tool | works | does not |", "|---|---|---|"]
    for client, remark, lacking in rows:
        checks = results["checks"]["udp"].get(client, {})
        failed = [name for name, passed in checks.items() if not passed]
        passed = f"{sum(checks.values())} of {len(checks)} checks over UDP"
        can, cannot = "; ".join(filter(None, [passed, remark])), [*failed, lacking]
        lines.append(f"| {CLIENTS[client]} | {can} | {'; '.join(filter(None, cannot))} |")
    lines.append(
        "| QGroundControl, Cockpit | not run; their requirements as read in their sources are"
        " tested [message by message](ground_stations.md) | QGroundControl's mode buttons, unless"
        " started as `autopilot --autopilot-id px4`; then its setup pages miss PX4's parameters |"
    )
    return "\n".join(lines) + "\n"


TABLES: dict[str, tuple[str, Callable[[Results], str]]] = {
    "clients": ("mavlink.md", client_table),
    "MAVSDK actions": ("mavlink.md", action_table),
    "MAVSDK reasons": ("mavlink.md", reason_table),
    "MAVProxy commands": ("mavlink.md", command_table),
    "checks": ("clients.md", pass_table),
    "failed checks": ("clients.md", failure_table),
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
