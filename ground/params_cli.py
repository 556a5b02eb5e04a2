"""``ground params``: read and set a vehicle's parameters."""

import math
from pathlib import Path

import typer

from ground.console import GROUND_LINK, Address, Json, Sign, give, new_file
from ground.errors import BadInputError, FailedError

app = typer.Typer(no_args_is_help=True, help="Read and set a vehicle's parameters.")


@app.command("list")
def list_all(connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Every parameter and its value."""
    from ground.vehicle import connected

    with connected(connect, sign) as vehicle:
        values = vehicle.parameters()
    give(values, "\n".join(f"{name:16s} {value:g}" for name, value in values.items()), json)


@app.command()
def get(name: str, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """One parameter."""
    from ground.vehicle import connected

    with connected(connect, sign) as vehicle:
        value = vehicle.parameter(name)
    give({name: value}, f"{value:g}", json)


@app.command("set")
def set_one(name: str, value: float, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Set one parameter and read it back."""
    if not math.isfinite(value):
        raise BadInputError(f"{name} = {value:g}: expected a number")
    set_and_read_back(connect, sign, {name: value})
    give({name: value}, f"{name} = {value:g}", json)


@app.command()
def save(file: Path, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Write every parameter to a file."""
    from ground import gains
    from ground.vehicle import connected

    target = new_file(file)
    with connected(connect, sign) as vehicle:
        values = vehicle.parameters()
    gains.save(target, values)
    give({"file": str(file), "parameters": len(values)}, f"{file}: {len(values)} parameters", json)


@app.command()
def load(file: Path, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Set the parameters of a file and read them back."""
    from ground import gains

    values = gains.load(file)
    set_and_read_back(connect, sign, values)
    give({"file": str(file), "parameters": len(values)}, f"{file}: {len(values)} parameters set", json)


def set_and_read_back(address: str, key_file: Path | None, values: dict[str, float]) -> None:
    """Set parameters of the vehicle at an address. Raises FailedError where she stored something else."""
    from ground.vehicle import connected

    with connected(address, key_file) as vehicle:
        for name, value in values.items():
            stored = vehicle.set_parameter(name, value)
            if not abs(stored - value) <= 1e-6 * max(1.0, abs(value)):
                raise FailedError(f"{name}: the vehicle stored {stored:g} in place of {value:g}")
