"""The JSON Schema of ``model.json`` from its records: ``python -m sysid.schema >
docs/model.schema.json``."""

import sys

import msgspec

from sysid.models.model_file import FORMAT, IdentifiedModel


def schema() -> bytes:
    """JSON Schema 2020-12 of the format that this version reads and writes."""
    found = msgspec.json.schema(IdentifiedModel)
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"model.json, format {FORMAT}: an identified vehicle",
    }
    return msgspec.json.format(msgspec.json.encode(head | found), indent=1) + b"\n"


if __name__ == "__main__":
    sys.stdout.buffer.write(schema())
