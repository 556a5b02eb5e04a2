"""`ground params`: read and set the parameters of a vehicle."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.connection import connected
from ground.cli.options import (
    GROUND_LINK,
    Address,
    CommandGroup,
    Json,
    Modem,
    Prior,
    Sign,
    VehicleId,
    print_result,
    remark,
)
from ground.output_files import new_file
from mavlink_io.errors import InputError
from mavlink_io.printable import printable

if TYPE_CHECKING:
    from ground.client.param_rollback import ParamChange

UNDO = "`ground params rollback` undoes it"
"""Hint after a change of parameters."""

app = typer.Typer(
    cls=CommandGroup, no_args_is_help=True, help="Read and set a vehicle's parameters."
)


@app.command("list")
def list_all(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """List all parameters with their values."""
    with connected(connect, sign, vehicle_id, modem) as vehicle:
        values = vehicle.parameters()
    print_result(
        values,
        "\n".join(f"{printable(name):16s} {value:g}" for name, value in values.items()),
        json,
    )


@app.command()
def get(
    name: str,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Print one parameter."""
    with connected(connect, sign, vehicle_id, modem) as vehicle:
        value = vehicle.parameter(name)
    print_result({name: value}, f"{value:g}", json)


@app.command("set")
def set_one(
    name: str,
    value: float,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Set one parameter and read it back."""
    if not math.isfinite(value):
        raise InputError(f"{name} = {value:g}: expected a number")

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        stored = vehicle.set_parameter(name, value)
    print_result({name: stored}, f"{name} = {stored:g}", json)


@app.command()
def save(
    file: Path,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Write all parameters to a file."""
    from ground.client import param_file

    target = new_file(file)
    with connected(connect, sign, vehicle_id, modem) as vehicle:
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
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL.json",
            help="Model on which the gains are checked, and refused if it is another one than they"
            " were designed on. Default: model.json in the folder of the gains.",
        ),
    ] = None,
    prior: Prior = None,
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Also load gains with too little margin or damping on their model."
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Set the parameters of a file, read them back, and store the old values for rollback.

    Gains of a design are refused if they have too little margin or damping on their model.
    """
    from ground.client import param_file

    lines = param_file.load_lines(file)
    values = {name: line.value for name, line in lines.items()}
    _check_gains(file, values, model, prior, force=force)
    changes = upload(
        connect,
        sign,
        values,
        source=str(file),
        model_sha256=param_file.model_sha256_of(file),
        system=vehicle_id,
        modem_s=modem,
    )
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
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    force: Annotated[
        bool, typer.Option("--force", help="Also restore values that were changed since.")
    ] = False,
    json: Json = False,
) -> None:
    """Restore the values that the last `params load` or `redesign --upload` replaced."""
    from ground.client import param_rollback

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        record, changes = param_rollback.rollback(vehicle, file, force=force)
    _print_changes(
        changes, {}, f"{record.source}: undone, {len(changes)} parameters restored", json
    )


def upload(
    address: str,
    key_file: Path | None,
    values: Mapping[str, float],
    *,
    source: str,
    model_sha256: str = "",
    system: int | None = None,
    modem_s: float | None = None,
) -> "tuple[ParamChange, ...]":
    """Set parameters on the vehicle at an address as one change that can be undone.

    Raises as `param_rollback.upload`.
    """
    from ground.client import param_rollback

    with connected(address, key_file, system, modem_s) as vehicle:
        if vehicle.armed:
            remark("the vehicle is armed: new gains apply without a bump, new trims at once")
        return param_rollback.upload(vehicle, values, source, model_sha256)


def format_changes(changes: "Sequence[ParamChange]", reasons: Mapping[str, str]) -> list[str]:
    """Return a line per changed parameter (old, new, reason), and the number of the others."""
    lines = [
        f"  {printable(change.name):16s} {change.before:10.5g} -> {change.after:10.5g} "
        f" {printable(reasons.get(change.name, ''))}".rstrip()
        for change in changes
        if change.after != change.before
    ]
    unchanged = len(changes) - len(lines)
    return [*lines, f"  {unchanged} unchanged"] if unchanged else lines


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


def _check_gains(
    file: Path, values: Mapping[str, float], model: Path | None, prior: str | None, *, force: bool
) -> None:
    """Check gains on their model; with `force`, remark why they would be refused.

    Raises InputError and UnsafeGainsError.
    """
    from ground.client import param_file
    from sysid.monitor.performance_spec import BaselineError

    try:
        if param_file.read_header(file) is None and model is None:
            return  # no gains of a design: the check is not imported
    except BaselineError as error:
        if model is not None:
            raise
        remark(f"{error}; the gains are not checked")
        return
    from ground.campaign.gains_check import UnsafeGainsError, check_gains

    try:
        if reason := check_gains(file, values, model, prior):
            remark(reason)
    except UnsafeGainsError as error:
        if not force:
            raise UnsafeGainsError(f"{error}, or load them with --force") from None
        remark(f"{error}; loaded by --force")
