"""JSON Schema of ``model.json``, derived from the record classes of `sysid.models.model_file`.

Usage: ``python -m sysid.schema > docs/model.schema.json``.
"""

import sys

import msgspec

from sysid.models.model_file import FORMAT, IdentifiedModel


def schema() -> bytes:
    """Return the JSON Schema (draft 2020-12) of the format that this version reads and writes.

    Returns
    -------
    bytes
        The schema as indented JSON, UTF-8, with a newline at the end.
    """
    definitions = msgspec.json.schema(IdentifiedModel)
    header = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"model.json, format {FORMAT}: an identified vehicle",
    }
    return msgspec.json.format(msgspec.json.encode(header | definitions), indent=1) + b"\n"


if __name__ == "__main__":
    sys.stdout.buffer.write(schema())
