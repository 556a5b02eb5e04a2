"""What parameters mean, as ground stations fetch it: the published schemas' demands, and the
table's own numbers."""

import json
import re
from typing import Any

from autopilot.control.params import PARAMETERS
from autopilot.telemetry import component_metadata
from mavlink_io.services.ftp.payload import crc32

GENERAL: dict[str, Any] = {
    "version": int,
    "vendorName": str,
    "modelName": str,
    "firmwareVersion": str,
    "metadataTypes": list,
}
METADATA_TYPE: dict[str, Any] = {"type": int, "uri": str, "fileCrc": int}
PARAMETER: dict[str, Any] = {
    "name": str,
    "type": str,
    "shortDesc": str,
    "units": str,
    "default": (int, float),
    "decimalPlaces": int,
    "min": (int, float),
    "max": (int, float),
    "increment": (int, float),
    "rebootRequired": bool,
    "group": str,
    "category": str,
}
"""Properties and types of general.schema.json and parameter.schema.json (mavlink/mavlink,
component_metadata), those of them that are used here; the schemas allow no others."""


def check(found: dict[str, Any], allowed: dict[str, Any], required: tuple[str, ...]) -> None:
    assert set(required) <= set(found) <= set(allowed)
    for key, value in found.items():
        assert isinstance(value, allowed[key]), key


def test_the_general_file_is_as_its_schema_demands() -> None:
    general = json.loads(component_metadata.general_json())
    check(general, GENERAL, ("version", "metadataTypes"))
    assert general["version"] == 1
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.\d+)?", general["firmwareVersion"])
    (parameters,) = general["metadataTypes"]
    check(parameters, METADATA_TYPE, ("type", "uri"))
    assert (parameters["type"], parameters["uri"]) == (1, "mftp:///metadata/parameters.json")
    assert parameters["fileCrc"] == crc32(component_metadata.parameters_json())


def test_every_parameter_is_described_as_the_schema_demands() -> None:
    described = json.loads(component_metadata.parameters_json())
    assert set(described) == {"version", "parameters"}
    assert described["version"] == 1, "what QGroundControl reads; the schema's 3 it refuses"
    rows = {row["name"]: row for row in described["parameters"]}
    assert set(rows) == {row.name for row in PARAMETERS}
    for row in PARAMETERS:
        found = rows[row.name]
        check(found, PARAMETER, ("name",))
        assert re.fullmatch(r"[.\-a-zA-Z0-9_{}]{1,16}", found["name"])
        assert found["type"] == "Float", "all travel as REAL32"
        assert (found["min"], found["max"], found["default"]) == (
            row.minimum,
            row.maximum,
            row.default,
        )
        assert (found["units"], found["shortDesc"]) == (row.unit, row.doc)
        assert found.get("increment") == (1 if row.integer else None)
    assert rows["MAV_SYS_ID"]["rebootRequired"]
    assert "rebootRequired" not in rows["HDG_P"]


def test_every_group_has_a_name() -> None:
    groups = {
        row["group"] for row in json.loads(component_metadata.parameters_json())["parameters"]
    }
    assert not [group for group in groups if group.isupper()]
