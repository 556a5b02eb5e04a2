"""What the commands share: their options, how they take a new file, and how they give a result."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ground.errors import InputError
from ground.terminal import Rendered
from mavlink_io.printable import printable, printable_lines

Address = Annotated[
    str,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        help="The vehicle's link: udpin:HOST:PORT, "
        "udpout:HOST:PORT, tcp:HOST:PORT, serial:DEVICE:BAUD.",
    ),
]
Sign = Annotated[
    Path | None,
    typer.Option("--sign", metavar="KEYFILE", help="Sign the link: a passphrase or key."),
]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout and nothing else.")]
VehicleName = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="field, bench, remus100, xfin, or a vehicle file.")
]
ScenarioName = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE", help="calm, disturbed, swell, estuary, under_ice, or a scenario file."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Of every random stream.")]
Speed = Annotated[str, typer.Option(metavar="N|max", help="Times the wall clock.")]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL.json", help="What refit found.")]
Prior = Annotated[
    str | None,
    typer.Option(metavar="FILE", help="The vehicle file that the model was refitted from."),
]
SpecFile = Annotated[
    Path | None,
    typer.Option("--spec", metavar="FILE.toml", help="What is asked: `damping = 0.6` and so on."),
]
Force = Annotated[
    bool, typer.Option("--force", help="Design on a model whose own verdict is against it.")
]
GROUND_LINK = "udpin:127.0.0.1:14550"


def new_file(path: Path) -> Path:
    """The same path. Raises BadInputError where it would overwrite something or has no folder."""
    if path.exists():
        raise InputError(f"{path}: exists; give a new name")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    return path


def print_result(result: dict[str, Any], words: str, as_json: bool) -> None:
    """Print a result: as words, or as JSON."""
    say(to_json(result) if as_json else words)


def say(words: str) -> None:
    """Print lines on stdout: as `terminal.render` made them, else with control characters
    escaped."""
    print(words if isinstance(words, Rendered) else printable_lines(words))


def remark(words: object) -> None:
    """Print one line on stderr under this program's name."""
    print(f"ground: {printable(words)}", file=sys.stderr)


def to_json(result: dict[str, Any]) -> str:
    """Return a result as JSON in ASCII, with every control character escaped."""
    return json.dumps(result, indent=1, default=str).replace("\x7f", "\\u007f")
