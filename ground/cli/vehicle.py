"""``ground vehicle``: describe a vehicle of one's own, check her, and give her first gains."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import Json, new_file, print_result, say
from ground.errors import BAD_INPUT, InputError, OperationError

app = typer.Typer(
    no_args_is_help=True,
    help="Describe a vehicle from her geometry, check her, design her first gains.",
)

Vehicle = Annotated[
    str, typer.Argument(metavar="NAME|FILE", help="A shipped vehicle's name, or a vehicle file.")
]


@app.command()
def new(
    out: Annotated[
        Path, typer.Option(metavar="FILE.toml", help="Where to write; never overwrites.")
    ],
    geometry: Annotated[
        str | None, typer.Argument(metavar="GEOMETRY.toml", help="What is known of her.")
    ] = None,
    hull: Annotated[
        str | None, typer.Option(help="Or start from series58, myring or cylinder,")
    ] = None,
    tail: Annotated[str, typer.Option(help="steered by duct, cruciform or x,")] = "cruciform",
    length_m: Annotated[float | None, typer.Option(help="this long overall")] = None,
    diameter_m: Annotated[float | None, typer.Option(help="and this wide.")] = None,
) -> None:
    """Write a whole vehicle file from geometry: every coefficient with its formula and source
    beside it."""
    asked = [str(geometry)] if geometry else []
    asked += ["--out", str(out), "--tail", tail]
    for option, value in (("--hull", hull), ("--length-m", length_m), ("--diameter-m", diameter_m)):
        asked += [option, str(value)] if value is not None else []
    say(_run_simulator_tool("new", *asked))


@app.command()
def check(vehicle: Vehicle, json: Json = False) -> None:
    """Refuse an impossible vehicle; print how a possible one floats, flies and swings, and her
    linear planes."""
    say(_run_simulator_tool("check", vehicle, *(["--json"] if json else [])))


@app.command()
def gains(
    vehicle: Vehicle,
    out: Annotated[Path, typer.Option(metavar="GAINS.param")] = Path("gains.param"),
    json: Json = False,
) -> None:
    """Design the gains of a first dive from the vehicle file alone, and set them beside the
    paper's."""
    from ground.campaign import prototype

    target = new_file(out)
    found = prototype.design(vehicle)
    found.write_params(target)
    print_result(
        {"file": str(target), **prototype.as_json(found)},
        f"{prototype.format_text(found)}\n\n{target}",
        json,
    )


def _run_simulator_tool(*command: str) -> str:
    """What the simulator's own tool prints. Vehicles are the simulator's: ground asks, and does not
    look inside."""
    done = subprocess.run(
        [sys.executable, "-m", "sitl.vehicle", *command],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 0:
        return done.stdout.rstrip("\n")
    said = (done.stderr.strip().splitlines() or ["no reason given"])[-1].removeprefix("vehicle: ")
    raise InputError(said) if done.returncode == BAD_INPUT else OperationError(said)
