"""Check a scenario and print its content as JSON: ``python -m sitl.scenario_check NAME|FILE``.

Other programs use this to learn the sea state and the floor; they do not read scenario files.
"""

from __future__ import annotations

import json
import sys

import msgspec

from mavlink_io.errors import CaribouError, exit_with_error
from sitl import scenario


def main() -> None:
    """Print the scenario named on the command line, with every default filled in."""
    try:
        print(json.dumps(msgspec.to_builtins(scenario.load(sys.argv[1]))))
    except CaribouError as error:
        exit_with_error("sitl", error)


if __name__ == "__main__":
    main()
