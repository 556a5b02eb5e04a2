"""JSON Schemas of the project's files, derived from their record classes.

Usage: ``python -m sysid.schema > docs/model.schema.json``.
"""

import sys

import msgspec

from sysid.json_record import JsonRecord
from sysid.models.model_file import FORMAT, IdentifiedModel


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


def schema() -> bytes:
    """Return the JSON Schema of the ``model.json`` that this version reads and writes."""
    return schema_of(IdentifiedModel, f"model.json, format {FORMAT}: an identified vehicle")


if __name__ == "__main__":
    sys.stdout.buffer.write(schema())
