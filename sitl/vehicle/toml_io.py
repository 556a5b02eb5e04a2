"""Strict decoding of TOML files: an error names file, key, value and what would be right."""

from __future__ import annotations

import tomllib
from math import isfinite
from typing import Any, TypeVar, get_args, get_origin

import msgspec

T = TypeVar("T", bound=msgspec.Struct)


def decode(text: str, kind: type[T], source: str, error: type[ValueError]) -> T:
    """``text`` as a ``kind``, a tree of msgspec Structs; ``source`` names it in errors, which are
    of type ``error``."""
    return convert(read(text, source, error), kind, source, error)


def read(text: str, source: str, error: type[ValueError]) -> dict[str, Any]:
    """The tables of ``text``, not yet checked."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{source}: not valid TOML: {problem}") from None


def convert(tables: dict[str, Any], kind: type[T], source: str, error: type[ValueError]) -> T:
    """``tables`` as a ``kind``."""
    if wrong := _unknown_or_not_finite(tables, kind, ""):
        raise error(f"{source}: {wrong}")
    try:
        return msgspec.convert(tables, kind)
    except msgspec.ValidationError as problem:
        raise error(f"{source}: {_explain(problem, tables)}") from None


def _unknown_or_not_finite(table: dict[str, Any], kind: type[msgspec.Struct], prefix: str) -> str:
    """msgspec names neither the keys that would be right nor numbers that are not finite; TOML
    allows inf and nan."""
    fields = {field.name: field.type for field in msgspec.structs.fields(kind)}
    tag = kind.__struct_config__.tag_field
    for key, value in table.items():
        if key == tag:
            continue
        if key not in fields:
            return f"{prefix}{key} = {value!r}: unknown key; known here: {', '.join(fields)}"
        if isinstance(value, str) and (choices := _choices(fields[key])) and value not in choices:
            return f"{prefix}{key} = {value!r}: expected {' or '.join(choices)}"
        if isinstance(value, float) and not isfinite(value):
            return f"{prefix}{key} = {value}: expected a finite number"
        for inside, name in _tables_of(value, f"{prefix}{key}"):
            if wrong := _wrong_inside(inside, fields[key], f"{name}."):
                return wrong
    return ""


def _tables_of(value: Any, name: str) -> list[tuple[dict[str, Any], str]]:
    """The tables that a value is or lists, each with its name."""
    listed = (
        [(value, name)]
        if not isinstance(value, list)
        else [(v, f"{name}[{i}]") for i, v in enumerate(value)]
    )
    return [(table, name) for table, name in listed if isinstance(table, dict)]


def _wrong_inside(table: dict[str, Any], annotation: Any, prefix: str) -> str:
    """The same of a table within, which may be one of several kinds, told apart by their tag."""
    if get_origin(annotation) is dict:
        inside = (
            (value, f"{prefix}{key}.") for key, value in table.items() if isinstance(value, dict)
        )
        return next(
            filter(
                None,
                (_wrong_inside(value, get_args(annotation)[1], name) for value, name in inside),
            ),
            "",
        )
    kinds = [kind for kind in get_args(annotation) or (annotation,) if _is_struct(kind)]
    if len(kinds) > 1:
        field = kinds[0].__struct_config__.tag_field
        tags = {kind.__struct_config__.tag: kind for kind in kinds}
        if table.get(field) not in tags:
            return f"{prefix}{field} = {table.get(field)!r}: expected {', '.join(tags)}"
        kinds = [tags[table[field]]]
    return _unknown_or_not_finite(table, kinds[0], prefix) if kinds else ""


def _choices(annotation: Any) -> list[str]:
    """The words that a ``Literal`` allows."""
    inside = get_args(annotation)
    return [word for word in inside if isinstance(word, str)] or [
        word for kind in inside for word in _choices(kind)
    ]


def _is_struct(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _explain(problem: msgspec.ValidationError, tables: dict[str, Any]) -> str:
    """msgspec's "Expected `float` > 0 - at `$.hull.diameter_m`" with key and value in front."""
    what, _, where = str(problem).partition(" - at `$")
    what = what.replace("`", "")
    key = (
        where.rstrip("`").lstrip(".").partition("[...]")[0]
    )  # so msgspec calls any entry of a table of free keys
    value: Any = tables
    for part in filter(None, key.split(".")):
        name, _, index = part.partition("[")
        value = value[name][int(index.rstrip("]"))] if index.rstrip("]").isdigit() else value[name]
    if isinstance(value, dict) and what.startswith("Object missing"):
        return (
            f"{key or 'top level'}: {what.replace('Object missing required field', 'missing key')}"
        )
    return f"{key} = {value!r}: {what[0].lower()}{what[1:]}"
