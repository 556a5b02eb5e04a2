"""Write a complete vehicle file: every key with its unit, and a comment with formula and source."""

from __future__ import annotations

import json
from typing import Any

from msgspec.structs import fields

from sitl.vehicle.file_schema import VehicleConfig
from sitl.vehicle.fill_missing import Completed
from sitl.vehicle.slender_body import Derivation

HEAD = """\
# {name}: derived from geometry; what is marked "given" was given. Replace any number by a better
# one and its comment by where it comes from.
# Axes: x forward, y port, z up, origin on the hull axis at mid-length.
"""
"""Comment at the top of the file."""
DIGITS = 9
"""Significant digits of a number."""


def write(vehicle: Completed) -> str:
    """Return a completed vehicle file as TOML text.

    Parameters
    ----------
    vehicle : Completed
        Tables with all keys, and the derivation of each derived key.

    Returns
    -------
    str
        TOML text; a comment beside each key has its formula, inputs and source.
    """
    tables = vehicle.tables
    lines = [HEAD.format(name=tables["name"]), f"name = {_value(tables['name'])}"]
    if "effective" in tables:
        lines.append(f"effective = {_value(tables['effective'])}")
    for field in fields(VehicleConfig):
        table = tables.get(field.name)
        if isinstance(table, dict):
            lines += ["", f"[{field.name}]", *_table(field.name, table, vehicle.steps)]
    return "\n".join(lines) + "\n"


def _table(name: str, table: dict[str, Any], steps: dict[tuple[str, str], Derivation]) -> list[str]:
    """Return the lines of one table, with aligned comments."""
    assignments = {key: f"{key} = {_value(value)}" for key, value in table.items()}
    width = min(44, max(len(line) for line in assignments.values()))
    return [
        f"{line:{width}}  # {_comment(steps.get((name, key)))}" for key, line in assignments.items()
    ]


def _comment(step: Derivation | None) -> str:
    """Return the comment of a key: its derivation, or "given"."""
    if step is None:
        return "given"
    constant = step.formula.replace(".", "").isdigit()
    parts = ["" if constant else step.formula, step.inputs, step.source]
    return "; ".join(part for part in parts if part)


def _value(value: Any) -> str:
    """Return a TOML literal."""
    if isinstance(value, float):
        digits = f"{value:.{DIGITS}g}"
        return digits if any(mark in digits for mark in ".e") else f"{digits}.0"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    return json.dumps(value)
