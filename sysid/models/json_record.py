"""Base class of the records that are written to JSON files, and the schemas of such files."""

import codecs
import json
from math import isfinite
from typing import Annotated, Any, TypeVar, get_args, get_origin

import msgspec

from mavlink_io.text_files import TOO_NESTED, parse_json

T = TypeVar("T")
NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Fraction = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


class JsonRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Immutable record of a JSON file; an unknown or missing key is an error."""


class _Head(msgspec.Struct):
    """The key that is decoded first; other keys are ignored."""

    format: int = 0


def format_of(text: bytes) -> int:
    """Return the value of the key ``format``.

    Parameters
    ----------
    text : bytes
        Content of a JSON file.

    Returns
    -------
    int
        Number of the format; 0 if the key is missing.

    Raises
    ------
    msgspec.MsgspecError
        The content is no JSON object, or the format is no integer.
    """
    return decode(text, _Head).format


def decode(text: bytes, kind: type[T]) -> T:
    """Return the record in the content of a JSON file.

    Parameters
    ----------
    text : bytes
        Content of a JSON file.
    kind : type
        Type of the record.

    Returns
    -------
    object
        The record.

    Raises
    ------
    msgspec.MsgspecError
        The content is no JSON of this type, or is nested too deeply.
    """
    try:
        return msgspec.json.decode(text.removeprefix(codecs.BOM_UTF8), type=kind)
    except RecursionError:
        raise msgspec.DecodeError(TOO_NESTED) from None
    except UnicodeDecodeError as error:
        raise msgspec.DecodeError(f"is no text in UTF-8: {error.reason}") from None


def explain(text: bytes, kind: Any) -> str:
    """Return why `decode` refuses a JSON text: the first wrong value.

    Parameters
    ----------
    text : bytes
        Content of a JSON file.
    kind : type
        Type of the record.

    Returns
    -------
    str
        Key, value and what is expected; empty if the text is no JSON, or no value is wrong.
    """
    try:
        value = parse_json(text)  # which reads NaN and Infinity, too
    except json.JSONDecodeError:
        return ""
    return _first_not_finite(value, "") or _first_wrong(value, kind, "")


def _first_not_finite(value: Any, key: str) -> str:
    """Return key and value of the first number that is not finite; empty for none."""
    if isinstance(value, float) and not isfinite(value):
        return f"{key} = {value}: expected a finite number"
    entries = (
        [(entry, _join(key, name)) for name, entry in value.items()]
        if isinstance(value, dict)
        else [(entry, f"{key}[{i}]") for i, entry in enumerate(value)]
        if isinstance(value, list)
        else []
    )
    return next(filter(None, (_first_not_finite(*entry) for entry in entries)), "")


def _join(key: str, name: str) -> str:
    """Return the key of an entry of a table or list."""
    return name if not key else f"{key}{name}" if name.startswith("[") else f"{key}.{name}"


def _first_wrong(value: Any, kind: Any, key: str) -> str:
    """Return key, value and expectation of the first wrong value in a value; empty for none."""
    entries = [(v, k, _join(key, name)) for v, k, name in _entries(value, kind)]
    if text := next(filter(None, (_first_wrong(*entry) for entry in entries)), ""):
        return text
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError as problem:
        expectation, _, place = str(problem).replace("`", "").partition(" - at $")
        shown = "" if place or isinstance(value, dict | list) else f" = {value!r}"
        where = f"{key}{place}".strip(".") or "top level"
        return f"{where}{shown}: {expectation[0].lower()}{expectation[1:]}"
    return ""


def _entries(value: Any, kind: Any) -> list[tuple[Any, Any, str]]:
    """Return value, type and name of each entry of a table or list."""
    arguments = get_args(kind)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct) and isinstance(value, dict):
        fields = msgspec.structs.fields(kind)
        return [(value[f.name], f.type, f.name) for f in fields if f.name in value]
    if get_origin(kind) is dict and isinstance(value, dict):
        return [(entry, arguments[1], name) for name, entry in value.items()]
    if get_origin(kind) is tuple and isinstance(value, list):
        return [(entry, arguments[0], f"[{i}]") for i, entry in enumerate(value)]
    if len(arguments) == 2 and type(None) in arguments and value is not None:
        return _entries(value, arguments[arguments[0] is type(None)])
    return []


def encode(record: JsonRecord) -> bytes:
    """Return the content of a record's file.

    Parameters
    ----------
    record : JsonRecord
        Content of the file.

    Returns
    -------
    bytes
        Indented JSON, UTF-8, with a newline at the end.
    """
    return msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n"


def schema_of(record: type[JsonRecord], title: str) -> bytes:
    """Return the JSON Schema (draft 2020-12) of a file.

    Parameters
    ----------
    record : type
        Type of the file's content.
    title : str
        Title of the schema.

    Returns
    -------
    bytes
        The schema as indented JSON, UTF-8, with a newline at the end.
    """
    header = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    definitions = msgspec.json.schema(record)
    return msgspec.json.format(msgspec.json.encode(header | definitions), indent=1) + b"\n"
