"""Strict decoding of TOML files: an error names file, key, value and what is expected."""

from __future__ import annotations

import tomllib
from enum import StrEnum
from math import isfinite
from typing import Any, TypeVar, get_args, get_origin

import msgspec

from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import parse_toml

T = TypeVar("T", bound=msgspec.Struct)


def decode(text: str, kind: type[T], source: str, error: type[ValueError]) -> T:
    """Decode TOML text into msgspec Structs.

    Parameters
    ----------
    text : str
        TOML text.
    kind : type
        Struct type of the top level.
    source : str
        Name of the file in error messages.
    error : type
        Exception type to raise.

    Returns
    -------
    Struct
        An instance of ``kind``.

    Raises
    ------
    ValueError
        Of type ``error``: not valid TOML, an unknown or missing key, or a value out of range.
    """
    return convert(read(text, source, error), kind, source, error)


def read(text: str, source: str, error: type[ValueError]) -> dict[str, Any]:
    """Return the tables of a TOML text without validation.

    Parameters
    ----------
    text : str
        TOML text.
    source : str
        Name of the file in error messages.
    error : type
        Exception type to raise for text that is not TOML.

    Returns
    -------
    dict
        The tables.
    """
    try:
        return parse_toml(text)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{source}: not valid TOML: {problem}") from None


def convert(tables: dict[str, Any], kind: type[T], source: str, error: type[ValueError]) -> T:
    """Return tables as an instance of a Struct type.

    Parameters
    ----------
    tables : dict
        Tables of a TOML file.
    kind : type
        Struct type of the top level.
    source : str
        Name of the file in error messages.
    error : type
        Exception type to raise for an unknown or missing key, or a value out of range.

    Returns
    -------
    Struct
        An instance of ``kind``.
    """
    if problem_text := _unknown_or_not_finite(tables, kind, ""):
        raise error(f"{source}: {problem_text}")
    try:
        return msgspec.convert(tables, kind)
    except msgspec.ValidationError as problem:
        raise error(f"{source}: {_explain(problem, tables)}") from None


def _unknown_or_not_finite(table: dict[str, Any], kind: type[msgspec.Struct], prefix: str) -> str:
    """Return an error text for an unknown key, word or non-finite number, or "".

    TOML allows inf and nan. msgspec neither lists the known keys nor rejects non-finite numbers.
    """
    fields = {field.encode_name: field.type for field in msgspec.structs.fields(kind)}
    tag = kind.__struct_config__.tag_field
    for key, value in table.items():
        if key == tag:
            continue
        if key not in fields:
            return (
                f"{prefix}{key} = {value!r}: unknown key; known here: {', '.join(fields)}"
                f"{did_you_mean(key, fields)}"
            )
        if isinstance(value, str) and (choices := _choices(fields[key])) and value not in choices:
            return (
                f"{prefix}{key} = {value!r}: expected {' or '.join(choices)}"
                f"{did_you_mean(value, choices)}"
            )
        if isinstance(value, float) and not isfinite(value):
            return f"{prefix}{key} = {value}: expected a finite number"
        if range_text := _outside_range(value, fields[key]):
            return f"{prefix}{key} = {value!r}: expected {range_text}"
        for inner, name in _tables_of(value, f"{prefix}{key}"):
            if problem_text := _wrong_inside(inner, fields[key], f"{name}."):
                return problem_text
    return ""


def _outside_range(value: Any, annotation: Any) -> str:
    """Return both limits of a number that is outside of them, else ""."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    for kind in (annotation, *get_args(annotation)):
        for limits in getattr(kind, "__metadata__", ()):
            if isinstance(limits, msgspec.Meta) and _is_outside(value, limits):
                text = _format_range(limits)
                return f"{kind.__origin__.__name__} {text}" if text else ""
    return ""


def _is_outside(value: float, limits: msgspec.Meta) -> bool:
    """Return True if a number is below or above its limits."""
    return (
        (limits.ge is not None and value < limits.ge)
        or (limits.gt is not None and value <= limits.gt)
        or (limits.le is not None and value > limits.le)
        or (limits.lt is not None and value >= limits.lt)
    )


def _format_range(limits: msgspec.Meta) -> str:
    """Return the limits of a number as text; "" unless there are two, as msgspec names one."""
    lower = [(">=", limits.ge), (">", limits.gt)]
    upper = [("<=", limits.le), ("<", limits.lt)]
    texts = [
        f"{sign} {limit:g}" for pair in (lower, upper) for sign, limit in pair if limit is not None
    ]
    return " and ".join(texts) if len(texts) == 2 else ""


def _tables_of(value: Any, name: str) -> list[tuple[dict[str, Any], str]]:
    """Return the tables in a value (itself, or the entries of a list), each with its name."""
    listed = (
        [(value, name)]
        if not isinstance(value, list)
        else [(v, f"{name}[{i}]") for i, v in enumerate(value)]
    )
    return [(table, name) for table, name in listed if isinstance(table, dict)]


def _wrong_inside(table: dict[str, Any], annotation: Any, prefix: str) -> str:
    """Return the same error text for an inner table, whose tag selects one of several types."""
    if get_origin(annotation) is dict:
        inner = (
            (value, f"{prefix}{key}.") for key, value in table.items() if isinstance(value, dict)
        )
        return next(
            filter(
                None,
                (_wrong_inside(value, get_args(annotation)[1], name) for value, name in inner),
            ),
            "",
        )
    kinds = [kind for kind in get_args(annotation) or (annotation,) if _is_struct(kind)]
    if len(kinds) > 1:
        field = kinds[0].__struct_config__.tag_field
        tags = {kind.__struct_config__.tag: kind for kind in kinds}
        given = table.get(field)
        if not isinstance(given, str) or given not in tags:
            suggestion = did_you_mean(str(given), map(str, tags))
            return f"{prefix}{field} = {given!r}: expected {', '.join(tags)}{suggestion}"
        kinds = [tags[given]]
    return _unknown_or_not_finite(table, kinds[0], prefix) if kinds else ""


def _choices(annotation: Any) -> list[str]:
    """Return the words that a ``Literal`` or an enum of texts allows."""
    if isinstance(annotation, type) and issubclass(annotation, StrEnum):
        return [str(member) for member in annotation]
    inner = get_args(annotation)
    return [word for word in inner if isinstance(word, str)] or [
        word for kind in inner for word in _choices(kind)
    ]


def _is_struct(kind: Any) -> bool:
    """Return True for a msgspec Struct type."""
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _explain(problem: msgspec.ValidationError, tables: dict[str, Any]) -> str:
    """Return key, value and reason from "Expected `float` > 0 - at `$.hull.diameter_m`"."""
    expectation, _, path = str(problem).partition(" - at `$")
    expectation = expectation.replace("`", "")
    # "[...]" is msgspec's name of any entry in a table with free keys.
    key = path.rstrip("`").lstrip(".").partition("[...]")[0]
    value: Any = tables
    for part in filter(None, key.split(".")):
        name, _, index = part.partition("[")
        value = value[name][int(index.rstrip("]"))] if index.rstrip("]").isdigit() else value[name]
    if isinstance(value, dict) and expectation.startswith("Object missing"):
        missing = expectation.replace("Object missing required field", "missing key")
        return f"{key or 'top level'}: {missing}"
    return f"{key} = {value!r}: {expectation[0].lower()}{expectation[1:]}"
