"""Strict decoding of TOML files: an error names file, key, value and what would be right."""

from __future__ import annotations

import tomllib
from math import isfinite
from typing import Any, TypeVar

import msgspec

T = TypeVar("T", bound=msgspec.Struct)


def decode(text: str, kind: type[T], source: str, error: type[ValueError]) -> T:
    """``text`` as a ``kind``, a tree of msgspec Structs; ``source`` names it in errors, which are of type ``error``."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{source}: not valid TOML: {problem}") from None
    if wrong := _unknown_or_not_finite(tables, kind, ""):
        raise error(f"{source}: {wrong}")
    try:
        return msgspec.convert(tables, kind)
    except msgspec.ValidationError as problem:
        raise error(f"{source}: {_explain(problem, tables)}") from None


def _unknown_or_not_finite(table: dict[str, Any], kind: type[msgspec.Struct], prefix: str) -> str:
    """msgspec names neither the keys that would be right nor numbers that are not finite; TOML allows inf and nan."""
    fields = {field.name: field.type for field in msgspec.structs.fields(kind)}
    for key, value in table.items():
        if key not in fields:
            return f"{prefix}{key} = {value!r}: unknown key; known here: {', '.join(fields)}"
        if isinstance(value, float) and not isfinite(value):
            return f"{prefix}{key} = {value}: expected a finite number"
        if isinstance(value, dict) and isinstance(fields[key], type):
            wrong = _unknown_or_not_finite(value, fields[key], f"{prefix}{key}.")
            if wrong:
                return wrong
    return ""


def _explain(problem: msgspec.ValidationError, tables: dict[str, Any]) -> str:
    """msgspec's "Expected `float` > 0 - at `$.hull.diameter_m`" with key and value in front."""
    what, _, where = str(problem).partition(" - at `$")
    what = what.replace("`", "")
    key = where.rstrip("`").lstrip(".")
    value: Any = tables
    for part in filter(None, key.split(".")):
        value = value[part.partition("[")[0]]
    if isinstance(value, dict) and what.startswith("Object missing"):
        return f"{key or 'top level'}: {what.replace('Object missing required field', 'missing key')}"
    return f"{key} = {value!r}: {what[0].lower()}{what[1:]}"
