"""Base class of the records that are written to JSON files."""

import msgspec


class JsonRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Immutable record of a JSON file; an unknown or missing key is an error."""
