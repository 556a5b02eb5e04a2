"""`ground vehicle`: write a vehicle file, check it, and design its first gains."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import CommandGroup, Json, print_result, refuse_given, say
from ground.output_files import new_file
from mavlink_io.errors import BAD_INPUT, InputError, OperationError

app = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    help="Write a vehicle file from geometry, check it, design first gains.",
)

Vehicle = Annotated[
    str, typer.Argument(metavar="NAME|FILE", help="A shipped vehicle's name, or a vehicle file.")
]


@app.command()
def new(
    context: typer.Context,
    out: Annotated[
        Path, typer.Option(metavar="FILE.toml", help="Vehicle file to write; must not exist.")
    ],
    geometry: Annotated[
        str | None, typer.Argument(metavar="GEOMETRY.toml", help="Known dimensions and masses.")
    ] = None,
    hull: Annotated[
        str | None,
        typer.Option(help="Hull, without a file: series58, myring or cylinder."),
    ] = None,
    tail: Annotated[
        str, typer.Option(help="Steering with --hull: duct, cruciform or x.")
    ] = "cruciform",
    length_m: Annotated[float | None, typer.Option(help="Overall length with --hull, m.")] = None,
    diameter_m: Annotated[float | None, typer.Option(help="Diameter with --hull, m.")] = None,
) -> None:
    """Write a complete vehicle file from geometry, with formula and source of each coefficient."""
    if geometry:
        refuse_given(context, "--tail", "is for --hull; the steering is in GEOMETRY.toml")
    arguments = [str(geometry)] if geometry else []
    arguments += ["--out", str(out), "--tail", tail]
    for option, value in (("--hull", hull), ("--length-m", length_m), ("--diameter-m", diameter_m)):
        arguments += [option, str(value)] if value is not None else []
    say(_run_simulator_tool("new", *arguments))


@app.command()
def check(vehicle: Vehicle, json: Json = False) -> None:
    """Check a vehicle file; print buoyancy, level flight, oscillation modes and linear models.

    Fails if the vehicle is physically impossible.
    """
    say(_run_simulator_tool("check", vehicle, *(["--json"] if json else [])))


@app.command()
def gains(
    vehicle: Vehicle,
    out: Annotated[Path, typer.Option(metavar="GAINS.param")] = Path("gains.param"),
    json: Json = False,
) -> None:
    """Design the gains of a first dive from the vehicle file, and compare them with the paper's."""
    from ground.campaign import prototype

    target = new_file(out)
    design = prototype.design(vehicle)
    design.write_params(target)
    print_result(
        {"file": str(target), **prototype.as_json(design)},
        f"{prototype.format_text(design)}\n\n{target}",
        json,
    )


def _run_simulator_tool(*command: str) -> str:
    """Run `python -m sitl.vehicle` and return its output. Raises InputError, OperationError.

    `ground` may not import sitl, so the tool runs as a process.
    """
    process = subprocess.run(
        [sys.executable, "-m", "sitl.vehicle", *command],
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode == 0:
        return process.stdout.rstrip("\n")
    message = (process.stderr.strip().splitlines() or ["no reason given"])[-1].removeprefix(
        "vehicle: "
    )
    raise InputError(message) if process.returncode == BAD_INPUT else OperationError(message)
