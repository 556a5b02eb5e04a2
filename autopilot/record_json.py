"""Nested records as JSON and back, by their type hints; floats keep every bit, NaN included."""

import json
import types
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.text_files import parse_json

T = TypeVar("T")

_REAL, _IMAGINARY = "real", "imag"


class RecordError(InputError):
    """The JSON does not have the structure of the record."""

    code = ErrorCode.STATE_FILE


def to_json(record: Any) -> str:
    """Return a NamedTuple as JSON: records are objects, tuples are arrays."""
    return json.dumps(_plain(record), separators=(",", ":"))


def from_json(kind: type[T], text: str) -> T:
    """Return the record of a type in a JSON text.

    Raises RecordError if a field is missing, is unknown or has another type.
    """
    try:
        value = parse_json(text)
    except json.JSONDecodeError as error:
        raise RecordError(f"no JSON: {error}") from None
    record: T = _typed(kind, value)
    return record


def _plain(value: Any) -> Any:
    """Return a value with objects, arrays and numbers in place of records, tuples and complex."""
    if isinstance(value, tuple):
        names = getattr(value, "_fields", None)
        if names is None:
            return [_plain(part) for part in value]
        return {name: _plain(part) for name, part in zip(names, value, strict=True)}
    if isinstance(value, complex):
        return {_REAL: value.real, _IMAGINARY: value.imag}
    return value


def _typed(kind: Any, value: Any) -> Any:
    """Return a JSON value as an object of a type. Raises RecordError."""
    if kind is float:
        return float(_checked(value, (int, float), kind))
    if kind in (int, str, bool):
        return _checked(value, (kind,), kind)
    if kind is Any:  # a record of a device: never stored
        return _checked(value, (type(None),), type(None))
    if kind is complex:
        parts = _object(value, (_REAL, _IMAGINARY), "complex")
        return complex(_typed(float, parts[_REAL]), _typed(float, parts[_IMAGINARY]))
    if get_origin(kind) in (Union, types.UnionType):
        return _typed_union(get_args(kind), value)
    if get_origin(kind) is tuple:
        return _typed_tuple(get_args(kind), value)
    hints = _field_types(kind)
    parts = _object(value, tuple(hints), kind.__name__)
    return kind(**{name: _typed(hint, parts[name]) for name, hint in hints.items()})


def _typed_union(kinds: tuple[Any, ...], value: Any) -> Any:
    """Return a value as the first type of a union that it fits. Raises RecordError."""
    if value is None and type(None) in kinds:
        return None
    for kind in kinds:
        if kind is not type(None):
            try:
                return _typed(kind, value)
            except RecordError:
                continue
    raise RecordError(f"{str(value)[:40]} is none of {kinds}")


def _typed_tuple(kinds: tuple[Any, ...], value: Any) -> tuple[Any, ...]:
    """Return an array as a tuple of fixed or of any length. Raises RecordError."""
    values = _checked(value, (list,), tuple)
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return tuple(_typed(kinds[0], part) for part in values)
    if len(values) != len(kinds):
        raise RecordError(f"{len(values)} values in place of {len(kinds)}")
    return tuple(_typed(kind, part) for kind, part in zip(kinds, values, strict=True))


def _checked(value: Any, kinds: tuple[type, ...], expected: type) -> Any:
    """Return a value of one of the types; a bool is no number. Raises RecordError."""
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        raise RecordError(f"{str(value)[:40]!r} is no {expected.__name__}")
    return value


def _object(value: Any, names: tuple[str, ...], kind: str) -> Mapping[str, Any]:
    """Return an object that has exactly the named keys. Raises RecordError."""
    if not isinstance(value, dict) or set(value) != set(names):
        raise RecordError(f"no {kind}")
    return value


@cache
def _field_types(kind: Callable[..., Any]) -> dict[str, Any]:
    """Return the type of each field of a NamedTuple."""
    return get_type_hints(kind)
