"""`ground params`: read and set the parameters of a vehicle."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign, new_file, print_result, remark
from mavlink_io.errors import InputError
from mavlink_io.printable import printable

if TYPE_CHECKING:
    from ground.client.param_rollback import ParamChange

UNDO = "`ground params rollback` undoes it"
"""Hint after a change of parameters."""

app = typer.Typer(no_args_is_help=True, help="Read and set a vehicle's parameters.")


@app.command("list")
def list_all(connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """List all parameters with their values."""
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
    """Print one parameter."""
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
    """Write all parameters to a file."""
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
    """Set the parameters of a file, read them back, and store the old values for rollback."""
    from ground.client import param_file

    lines = param_file.load_lines(file)
    model_sha256 = _model_sha256(file, model)
    values = {name: line.value for name, line in lines.items()}
    changes = upload(connect, sign, values, str(file), model_sha256)
    _print_changes(
        changes,
        {name: line.reason for name, line in lines.items()},
        f"{file}: {len(changes)} parameters set; {UNDO}",
        json,
    )


@app.command()
def rollback(
    file: Annotated[
        Path | None,
        typer.Argument(help="Record of changes. Default: this vehicle's last."),
    ] = None,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    force: Annotated[
        bool, typer.Option("--force", help="Also restore values that were changed since.")
    ] = False,
    json: Json = False,
) -> None:
    """Restore the values that the last `params load` or `redesign --upload` replaced."""
    from ground.client import param_rollback
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        record, changes = param_rollback.rollback(vehicle, file, force=force)
    _print_changes(
        changes, {}, f"{record.source}: undone, {len(changes)} parameters restored", json
    )


def upload(
    address: str,
    key_file: Path | None,
    values: Mapping[str, float],
    source: str,
    model_sha256: str = "",
) -> "tuple[ParamChange, ...]":
    """Set parameters on the vehicle at an address as one change that can be undone.

    Raises as `param_rollback.upload`.
    """
    from ground.client import param_rollback
    from ground.client.vehicle import connected

    with connected(address, key_file) as vehicle:
        if vehicle.armed:
            remark("the vehicle is armed: new gains apply without a bump, new trims at once")
        return param_rollback.upload(vehicle, values, source, model_sha256)


def format_changes(changes: "Sequence[ParamChange]", reasons: Mapping[str, str]) -> list[str]:
    """Return one line per parameter: name, old value, new value, reason."""
    return [
        f"  {printable(change.name):16s} {change.before:10.5g} -> {change.after:10.5g} "
        f" {printable(reasons.get(change.name, ''))}".rstrip()
        for change in changes
    ]


def _print_changes(
    changes: "Sequence[ParamChange]", reasons: Mapping[str, str], summary: str, json: bool
) -> None:
    """Print the changes and a last line."""
    values = {
        change.name: {
            "before": change.before,
            "now": change.after,
            "reason": reasons.get(change.name, ""),
        }
        for change in changes
    }
    text = "\n".join([*format_changes(changes, reasons), summary])
    print_result({"parameters": values}, text, json)


def _model_sha256(file: Path, model: Path | None) -> str:
    """Return the SHA-256 of the model that the gains in a file were designed on.

    Raises InputError if `model` is given and is another one.
    """
    from ground.client import param_file

    if model is None:
        return param_file.model_sha256_of(file)
    from ground.campaign import refit

    baseline, model_sha256 = param_file.read_baseline(file), refit.sha256_of_model(model)
    if baseline is None or baseline.model_sha256 != model_sha256:
        digest = baseline.model_sha256[:12] if baseline else "unknown"
        raise InputError(
            f"{file}: was designed on model {digest}, and {model} is model {model_sha256[:12]}; "
            f"redesign on {model}"
        )
    return model_sha256
