"""Base class of the records that are written to JSON files, and the schemas of such files."""

import msgspec


class JsonRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Immutable record of a JSON file; an unknown or missing key is an error."""


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
