"""``ground params``: read and set a vehicle's parameters."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign, new_file, print_result, remark
from ground.errors import InputError
from mavlink_io.printable import printable

if TYPE_CHECKING:
    from ground.client.param_rollback import ParamChange

UNDO = "`ground params rollback` undoes it"

app = typer.Typer(no_args_is_help=True, help="Read and set a vehicle's parameters.")


@app.command("list")
def list_all(connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Every parameter and its value."""
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        values = vehicle.parameters()
    print_result(
        values,
        "\n".join(f"{printable(name):16s} {value:g}" for name, value in values.items()),
        json,
    )


@app.command()
def get(name: str, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """One parameter."""
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        value = vehicle.parameter(name)
    print_result({name: value}, f"{value:g}", json)


@app.command("set")
def set_one(
    name: str, value: float, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False
) -> None:
    """Set one parameter and read it back."""
    if not math.isfinite(value):
        raise InputError(f"{name} = {value:g}: expected a number")
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        stored = vehicle.set_parameter(name, value)
    print_result({name: stored}, f"{name} = {stored:g}", json)


@app.command()
def save(file: Path, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Write every parameter to a file."""
    from ground.client import param_file
    from ground.client.vehicle import connected

    target = new_file(file)
    with connected(connect, sign) as vehicle:
        values = vehicle.parameters()
    param_file.save(target, values)
    print_result(
        {"file": str(file), "parameters": len(values)}, f"{file}: {len(values)} parameters", json
    )


@app.command()
def load(
    file: Path,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL.json", help="Refuse gains that were designed on another model."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Set the parameters of a file, read them back, and keep what was there before for rollback."""
    from ground.client import param_file

    lines = param_file.load_lines(file)
    promised = _model_sha256(file, model)
    steps = upload(
        connect, sign, {name: line.value for name, line in lines.items()}, str(file), promised
    )
    _print_changes(
        steps,
        {name: line.reason for name, line in lines.items()},
        f"{file}: {len(steps)} parameters set; {UNDO}",
        json,
    )


@app.command()
def rollback(
    file: Annotated[
        Path | None, typer.Argument(help="A record of changes; default: this vehicle's own.")
    ] = None,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    force: Annotated[
        bool, typer.Option("--force", help="Even where somebody changed a value since.")
    ] = False,
    json: Json = False,
) -> None:
    """Put back what the last load, or redesign --upload, has replaced, and read it back."""
    from ground.client import param_rollback
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        undone, steps = param_rollback.rollback(vehicle, file, force=force)
    _print_changes(steps, {}, f"{undone.source}: undone, {len(steps)} parameters put back", json)


def upload(
    address: str,
    key_file: Path | None,
    values: Mapping[str, float],
    source: str,
    model_sha256: str = "",
) -> "tuple[ParamChange, ...]":
    """Set the values of a file or design as one change, on the vehicle at an address. Raises as
    ``param_rollback.upload``."""
    from ground.client import param_rollback
    from ground.client.vehicle import connected

    with connected(address, key_file) as vehicle:
        if vehicle.armed:
            remark("she is under way: loops take new gains without a bump, trims at once")
        return param_rollback.upload(vehicle, values, source, model_sha256)


def format_changes(steps: "Sequence[ParamChange]", reasons: Mapping[str, str]) -> list[str]:
    """Each parameter with its value before and now, and why."""
    return [
        f"  {printable(s.name):16s} {s.before:10.5g} -> {s.after:10.5g} "
        f" {printable(reasons.get(s.name, ''))}".rstrip()
        for s in steps
    ]


def _print_changes(
    steps: "Sequence[ParamChange]", reasons: Mapping[str, str], head: str, json: bool
) -> None:
    values = {
        s.name: {"before": s.before, "now": s.after, "reason": reasons.get(s.name, "")}
        for s in steps
    }
    print_result({"parameters": values}, "\n".join([*format_changes(steps, reasons), head]), json)


def _model_sha256(file: Path, model: Path | None) -> str:
    """The digest of the model that a file's gains were designed on. Raises BadInputError where it
    is not ``model``."""
    from ground.client import param_file

    if model is None:
        return param_file.model_sha256_of(file)
    from ground.campaign import refit

    promised, found = param_file.read_baseline(file), refit.sha256_of_model(model)
    if promised is None or promised.model_sha256 != found:
        on = f"model {promised.model_sha256[:12]}" if promised else "no model that it names"
        raise InputError(
            f"{file}: was designed on {on}, and {model} is {found[:12]}; redesign on that one"
        )
    return found
