"""A vehicle file with nothing left out: every number with its unit in the key and its formula and
source beside it."""

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
DIGITS = 9


def write(vehicle: Completed) -> str:
    """The text of the file."""
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
    written = {key: f"{key} = {_value(value)}" for key, value in table.items()}
    width = min(44, max(len(line) for line in written.values()))
    return [
        f"{line:{width}}  # {_comment(steps.get((name, key)))}" for key, line in written.items()
    ]


def _comment(step: Derivation | None) -> str:
    if step is None:
        return "given"
    constant = step.formula.replace(".", "").isdigit()
    told = ["" if constant else step.formula, step.inputs, step.source]
    return "; ".join(part for part in told if part)


def _value(value: Any) -> str:
    """A TOML literal."""
    if isinstance(value, float):
        digits = f"{value:.{DIGITS}g}"
        return digits if any(mark in digits for mark in ".e") else f"{digits}.0"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    return json.dumps(value)
