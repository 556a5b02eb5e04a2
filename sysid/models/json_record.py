"""Base class of the records that are written to JSON files, and the schemas of such files."""

from typing import TypeVar

import msgspec

from mavlink_io.text_files import TOO_NESTED

T = TypeVar("T")


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
        return msgspec.json.decode(text, type=kind)
    except RecursionError:
        raise msgspec.DecodeError(TOO_NESTED) from None
    except UnicodeDecodeError as error:
        raise msgspec.DecodeError(f"is no text in UTF-8: {error.reason}") from None


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
