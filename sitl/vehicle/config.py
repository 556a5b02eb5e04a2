"""Read vehicle files: strictly decoded TOML; omitted keys are derived from the given ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mavlink_io import toml_io
from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import read_text
from sitl.vehicle import fill_missing, hull
from sitl.vehicle.file_schema import (
    Ballast,
    Coefficients,
    Cylinder,
    Damping,
    Description,
    DropWeight,
    DuctGeometry,
    FinGeometry,
    HullGeometry,
    Instruments,
    Myring,
    OperatingPoint,
    Power,
    ProfileHull,
    PropellerCurve,
    Series58,
    Tailcone,
    VehicleConfig,
    VehicleFileError,
    WaterProperties,
)
from sitl.vehicle.fill_missing import Completed

__all__ = [
    "SHIPPED",
    "Ballast",
    "Coefficients",
    "Completed",
    "Cylinder",
    "Damping",
    "DropWeight",
    "DuctGeometry",
    "FinGeometry",
    "HullGeometry",
    "Instruments",
    "Myring",
    "OperatingPoint",
    "Power",
    "ProfileHull",
    "PropellerCurve",
    "Series58",
    "Tailcone",
    "VehicleConfig",
    "VehicleFileError",
    "WaterProperties",
    "check",
    "check_drop_weight",
    "describe",
    "finish",
    "load",
    "parse",
]

SHIPPED = ("caribou_nominal", "caribou_truth", "remus100", "xfin_auv")
"""Names of the vehicle files that are part of this package."""
MAX_SLENDERNESS = 100.0
"""Length over diameter that no vehicle reaches: Caribou 7, gliders and torpedoes up to 25."""


def load(name_or_path: str | Path) -> VehicleConfig:
    """Read a shipped vehicle by name, or a vehicle file by path.

    Parameters
    ----------
    name_or_path : str or Path
        One of ``SHIPPED``, or the path of a TOML file.

    Returns
    -------
    VehicleConfig
        The vehicle with all keys; SI units, body FLU axes.

    Raises
    ------
    VehicleFileError
        The file is missing, is not valid TOML, has an unknown or missing key, or a value is out of
        range.
    """
    source, text, folder = _read(name_or_path)
    return parse(text, source, folder)


def describe(name_or_path: str | Path) -> Completed:
    """Return the tables of a vehicle file, with the derivation of each key that it omits.

    Parameters
    ----------
    name_or_path : str or Path
        One of ``SHIPPED``, or the path of a TOML file.

    Returns
    -------
    Completed
        Tables with all keys, and the derivations.

    Raises
    ------
    VehicleFileError
        The file is missing, is not valid TOML, or has an invalid key or value.
    """
    source, text, folder = _read(name_or_path)
    return _complete(text, source, folder)


def parse(text: str, source: str, folder: Path | None = None) -> VehicleConfig:
    """Decode the text of a vehicle file.

    Parameters
    ----------
    text : str
        TOML text.
    source : str
        Name of the file in error messages.
    folder : Path, optional
        Folder of the CSV file with the hull's profile; default is the current one.

    Returns
    -------
    VehicleConfig
        The vehicle with all keys; SI units, body FLU axes.

    Raises
    ------
    VehicleFileError
        The text is not valid TOML, or has an invalid key or value.
    """
    completed = _complete(text, source, folder)
    try:
        config = toml_io.convert(completed.tables, VehicleConfig, source, VehicleFileError)
    except VehicleFileError as error:
        raise VehicleFileError(f"{error}{_derivation_of(str(error), source, completed)}") from None
    check(config, source)
    return config


def _derivation_of(message: str, source: str, completed: Completed) -> str:
    """Return how the wrong key was derived, as text; "" if the file gives it."""
    for (table, key), step in completed.steps.items():
        if message.startswith(f"{source}: {table}.{key} = "):
            inputs = f" with {step.inputs}" if step.inputs else ""
            return f"; derived, as {step.formula}{inputs}: give it, or check these"
    return ""


def _read(name_or_path: str | Path) -> tuple[str, str, Path]:
    """Return (name for error messages, text, folder) of a vehicle file."""
    shipped = name_or_path in SHIPPED
    path = Path(__file__).with_name(f"{name_or_path}.toml") if shipped else Path(name_or_path)
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        names = f"{', '.join(SHIPPED[:-1])} or {SHIPPED[-1]}"
        raise VehicleFileError(
            f"{path}: cannot be read ({reason}); give {names}, or a TOML file"
            f"{did_you_mean(str(name_or_path), SHIPPED)}"
        ) from None
    return (path.name if shipped else str(path)), text, path.parent


def _complete(text: str, source: str, folder: Path | None) -> Completed:
    """Read and complete the text of a vehicle file."""
    tables = toml_io.read(text, source, VehicleFileError)
    try:
        return finish(tables, source, folder)
    except VehicleFileError:
        raise
    except (ArithmeticError, ValueError) as error:  # derived from a length of 1e-320 m or 1e300 m
        raise VehicleFileError(
            f"{source}: its lengths and masses give no vehicle ({error}); give SI units"
        ) from None


def finish(tables: dict[str, Any], source: str, folder: Path | None = None) -> Completed:
    """Validate the tables of a vehicle file and derive the missing keys.

    Parameters
    ----------
    tables : dict
        Tables as read from TOML; the hull table is replaced in place.
    source : str
        Name of the file in error messages.
    folder : Path, optional
        Folder of the CSV file with the hull's profile; default is the current one.

    Returns
    -------
    Completed
        Tables with all keys, and the derivations.

    Raises
    ------
    VehicleFileError
        An invalid key or value, or neither a duct nor fins.
    """
    if isinstance(shape := tables.get("hull"), dict):
        tables["hull"] = _with_points({"shape": "series58", **shape}, source, folder)
    described: Any = toml_io.convert(tables, Description, source, VehicleFileError)
    _check_shape(described.hull, source)
    if "duct" not in tables and "fins" not in tables:
        raise VehicleFileError(
            f"{source}: neither a table duct nor fins: expected one of them, to steer by"
        )
    return fill_missing.complete(tables, described.hull)


def _with_points(shape: dict[str, Any], source: str, folder: Path | None) -> dict[str, Any]:
    """Return the hull table with the points of its profile in place of the name of a CSV file."""
    if shape["shape"] != "profile" or not isinstance(name := shape.pop("file", None), str):
        return shape
    path = (folder or Path()) / name
    try:
        rows = [line.split(",") for line in read_text(path).splitlines() if line.strip()]
        points = [[float(cell) for cell in row] for row in rows[not _is_number(rows[0][0]) :]]
    except (OSError, UnicodeDecodeError, ValueError, IndexError) as error:
        raise VehicleFileError(
            f"{source}: hull.file = {name!r}: {getattr(error, 'strerror', None) or error}; "
            "expected a CSV file of distance from the nose and radius, in metres"
        ) from None
    return {**shape, "points_m": points}


def _is_number(text: str) -> bool:
    """Return True if ``text`` is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _check_shape(shape: HullGeometry, source: str) -> None:
    """Raise ``VehicleFileError`` for a hull that is geometrically impossible."""
    match shape:
        case Myring() if (
            shape.nose_offset_m >= shape.nose_length_m or shape.tail_offset_m >= shape.tail_length_m
        ):
            raise VehicleFileError(
                f"{source}: hull.nose_offset_m and tail_offset_m: expected less than nose and tail"
            )
        case Cylinder() if hull.outline(shape).middle_m < 0.0:
            raise VehicleFileError(
                f"{source}: hull.length_m = {shape.length_m}: expected more than its two caps"
                " together"
            )
        case ProfileHull() if not _is_ascending(shape):
            raise VehicleFileError(
                f"{source}: hull.points_m: expected finite distances from the nose that grow, and"
                " width"
            )
    length = hull.length_m(shape)
    if not 1.0 < length / shape.diameter_m <= MAX_SLENDERNESS:
        raise VehicleFileError(
            f"{source}: hull: {length:.4g} m long and {shape.diameter_m:.4g} m wide: expected"
            f" longer than wide, and at most {MAX_SLENDERNESS:g} times as long as wide"
        )


def _is_ascending(shape: ProfileHull) -> bool:
    """Return True if the distances increase and the largest radius is positive and finite."""
    steps = [
        after[0] - before[0]
        for before, after in zip(shape.points_m[:-1], shape.points_m[1:], strict=True)
    ]
    return all(0.0 < step < float("inf") for step in steps) and 0.0 < shape.diameter_m < float(
        "inf"
    )


def check(config: VehicleConfig, source: str) -> None:
    """Check that values which are in range do not contradict each other.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle with all keys.
    source : str
        Name of the file in error messages.

    Raises
    ------
    VehicleFileError
        Two values contradict each other, or the shape of the hull is impossible.
    """
    _check_shape(config.hull, source)
    duct, fins, propeller, tail = config.duct, config.fins, config.propeller, config.tailcone
    for key in ("rudder_bias_deg", "elevator_bias_deg", "step_deg", "backlash_deg"):
        if abs(angle_deg := getattr(tail, key)) >= tail.travel_deg:
            raise VehicleFileError(
                f"{source}: tailcone.{key} = {angle_deg}: expected less than"
                f" tailcone.travel_deg = {tail.travel_deg}"
            )
    if tail.lost_step_chance > 0.0 and tail.step_deg == 0.0:
        raise VehicleFileError(
            f"{source}: tailcone.lost_step_chance = {tail.lost_step_chance}: "
            "expected tailcone.step_deg above 0 with it, or there is no step to lose"
        )
    _check_sizes(config, source)
    for name, wing in (("duct", duct), ("fins", fins)):
        if wing is not None and wing.separated_deg <= wing.stall_deg:
            raise VehicleFileError(
                f"{source}: {name}.separated_deg = {wing.separated_deg}: "
                f"expected more than {name}.stall_deg = {wing.stall_deg}"
            )
    if duct is not None and propeller.diameter_m >= duct.diameter_m:
        raise VehicleFileError(
            f"{source}: propeller.diameter_m = {propeller.diameter_m}: "
            f"expected less than duct.diameter_m = {duct.diameter_m}, it turns inside"
        )
    if fins is None and duct is not None and not duct.vectored:
        raise VehicleFileError(
            f"{source}: duct.vectored = false: expected true, or fins to steer by"
        )
    if fins is not None and fins.x_m < -hull.length_m(config.hull) / 2 - fins.root_chord_m:
        raise VehicleFileError(
            f"{source}: fins.x_m = {fins.x_m}: expected on the hull, "
            f"which ends at {-hull.length_m(config.hull) / 2:.4g}"
        )
    if config.ballast.net_buoyancy_n <= -config.ballast.mass_kg * config.water.gravity_mps2:
        raise VehicleFileError(
            f"{source}: ballast.net_buoyancy_n = {config.ballast.net_buoyancy_n}: expected more"
            " than minus the weight"
        )
    check_drop_weight(config, source)


def _check_sizes(config: VehicleConfig, source: str) -> None:
    """Raise ``VehicleFileError`` for a duct or fins that are longer than the hull."""
    length_m = hull.length_m(config.hull)
    sizes = {"duct": ("diameter_m", "chord_m"), "fins": ("span_m", "root_chord_m", "tip_chord_m")}
    for table, keys in sizes.items():
        if (wing := getattr(config, table)) is None:
            continue
        for key in keys:
            if (size_m := getattr(wing, key)) >= length_m:
                raise VehicleFileError(
                    f"{source}: {table}.{key} = {size_m}: expected less than the hull's length of"
                    f" {length_m:.4g} m"
                )


def check_drop_weight(config: VehicleConfig, source: str) -> None:
    """Check that the drop weight is a small part of the vehicle.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle with all keys.
    source : str
        Name of the file in error messages.

    Raises
    ------
    VehicleFileError
        The weight is half of the vehicle's mass or more.
    """
    weight, mass_kg = config.drop_weight, config.ballast.mass_kg
    if weight is not None and weight.mass_kg >= 0.5 * mass_kg:
        raise VehicleFileError(
            f"{source}: drop_weight.mass_kg = {weight.mass_kg:g}: expected less than"
            f" half of the vehicle's {mass_kg:.4g} kg"
        )
