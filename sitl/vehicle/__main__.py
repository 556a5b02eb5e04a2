"""``python -m sitl.vehicle``: write a vehicle file from geometry, and check a vehicle file.

The initial geometry follows from length and diameter, with the usual proportions of its kind.
"""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import typer

from mavlink_io.errors import CaribouError, exit_with_error
from mavlink_io.printable import printable, printable_lines
from mavlink_io.user_data_dir import write_output
from sitl import vehicle_check
from sitl.vehicle import check as checks
from sitl.vehicle import config
from sitl.vehicle.config import VehicleFileError
from sitl.vehicle.export import write

Kind = Literal["series58", "myring", "cylinder"]
Steering = Literal["duct", "cruciform", "x"]

DUCT_DIAMETER, DUCT_CHORD = 0.78, 0.23
"""Duct diameter and chord over hull diameter, from Caribou."""
FIN_SPAN, FIN_CHORD = 0.50, 0.45
"""Fin span and chord over hull diameter.

REMUS 100: 0.45 and 0.39; Explorer: 0.52 and 0.52.
"""
app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
)


@app.command()
def check(
    vehicle: Annotated[str, typer.Argument(metavar="NAME|FILE")],
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object on stdout and nothing else.")
    ] = False,
) -> None:
    """Check a vehicle file; print trim, speeds, linear planes and poles, or the error."""
    report = vehicle_check.check(vehicle)
    print(
        json.dumps(_as_json(report), indent=1)
        if as_json
        else printable_lines(checks.format_text(report))
    )


@app.command()
def new(
    out: Annotated[
        Path, typer.Option(metavar="FILE.toml", help="New file; never overwrites an existing one.")
    ],
    geometry: Annotated[
        str | None, typer.Argument(metavar="GEOMETRY.toml", help="Vehicle file with known keys.")
    ] = None,
    hull: Annotated[str | None, typer.Option(metavar="|".join(get_args(Kind)))] = None,
    tail: Annotated[str, typer.Option(metavar="|".join(get_args(Steering)))] = "cruciform",
    length_m: Annotated[float | None, typer.Option()] = None,
    diameter_m: Annotated[float | None, typer.Option()] = None,
) -> None:
    """Write a complete vehicle file from geometry; every coefficient has formula and source."""
    if (geometry is None) == (hull is None):
        raise VehicleFileError(
            "give either GEOMETRY.toml, or --hull with --length-m and --diameter-m"
        )
    described = (
        config.describe(geometry)
        if geometry
        else _start(out.stem, hull or "", tail, length_m, diameter_m)
    )
    text = write(described)
    config.parse(text, str(out))
    if os.path.lexists(out):
        raise VehicleFileError(f"{out}: exists; give a new name")
    try:
        write_output(out, text)
    except OSError as error:
        raise VehicleFileError(f"{out}: {error.strerror}") from None
    check = shlex.join(["ground", "vehicle", "check", str(out)])
    message = f"{out}: {len(described.steps)} numbers derived; next: {check}"
    print(printable(message))


def _start(
    name: str, hull: str, tail: str, length_m: float | None, diameter_m: float | None
) -> config.Completed:
    """Return a complete vehicle from kind, length and diameter; raise for invalid options."""
    for option, value, known in (
        ("--hull", hull, Kind),
        ("--tail", tail, Steering),
    ):
        if value not in get_args(known):
            raise VehicleFileError(f"{option} {value}: expected {', '.join(get_args(known))}")
    if length_m is None or diameter_m is None:
        missing = "--length-m" if length_m is None else "--diameter-m"
        raise VehicleFileError(f"{missing}: is missing; --hull needs --length-m and --diameter-m")
    if not 0.0 < diameter_m < length_m:
        raise VehicleFileError(
            f"--length-m {length_m} --diameter-m {diameter_m}: expected longer than wide"
        )
    tables = starter_tables(name, hull, tail, length_m, diameter_m)  # type: ignore[arg-type]
    return config.finish(tables, name)


def starter_tables(
    name: str, kind: Kind, steering: Steering, length_m: float, diameter_m: float
) -> dict[str, Any]:
    """Return the tables of a minimal vehicle file."""
    steer = (
        {"duct": {"diameter_m": DUCT_DIAMETER * diameter_m, "chord_m": DUCT_CHORD * diameter_m}}
        if steering == "duct"
        else {
            "fins": {
                "layout": steering,
                "span_m": FIN_SPAN * diameter_m,
                "root_chord_m": FIN_CHORD * diameter_m,
            }
        }
    )
    return {"name": name, "hull": {"shape": kind, **_hull(kind, length_m, diameter_m)}, **steer}


def _hull(kind: Kind, length_m: float, diameter_m: float) -> dict[str, float]:
    """Return the hull table of a kind, without its ``shape``."""
    if kind == "series58":
        return {
            "base_length_m": length_m,
            "diameter_m": diameter_m,
            "midbody_length_m": 0.0,
            "nose_radius": 0.5,
            "tail_radius": 0.1,
            "prismatic": 0.65,
            "max_section": 0.4,
        }
    if kind == "myring":
        nose, tail = min(1.0 * diameter_m, 0.25 * length_m), min(2.5 * diameter_m, 0.4 * length_m)
        return {
            "nose_length_m": nose,
            "mid_length_m": length_m - nose - tail,
            "tail_length_m": tail,
            "diameter_m": diameter_m,
        }
    return {"length_m": length_m, "diameter_m": diameter_m}


def _as_json(value: object) -> object:
    """Return NamedTuples as dictionaries and infinite numbers as None, for JSON."""
    if hasattr(value, "_asdict"):
        return {key: _as_json(entry) for key, entry in value._asdict().items()}
    if isinstance(value, list | tuple):
        return [_as_json(entry) for entry in value]
    return None if isinstance(value, float) and abs(value) == float("inf") else value


def main() -> None:
    """Run the command line."""
    try:
        app()
    except CaribouError as error:
        exit_with_error("vehicle", error)


if __name__ == "__main__":
    main()
