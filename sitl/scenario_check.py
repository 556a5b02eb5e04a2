"""Check a scenario and print its content as JSON: ``python -m sitl.scenario_check NAME|FILE``.

Other programs use this to learn the sea state and the floor; they do not read scenario files.
"""

from __future__ import annotations

import json
import sys

import msgspec

from sitl import scenario
from sitl.scenario_types import ScenarioError

BAD_INPUT = 2


def main() -> None:
    """Print the scenario named on the command line, with every default filled in."""
    try:
        print(json.dumps(msgspec.to_builtins(scenario.load(sys.argv[1]))))
    except ScenarioError as error:
        print(f"sitl: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT)


if __name__ == "__main__":
    main()
