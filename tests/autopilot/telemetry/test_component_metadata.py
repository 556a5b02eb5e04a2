"""Component metadata: agreement with the published schemas and the parameter table."""

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
"""Properties and types of general.schema.json and parameter.schema.json that are used here.

Source: mavlink/mavlink, component_metadata; the schemas allow no other properties."""


def check(description: dict[str, Any], allowed: dict[str, Any], required: tuple[str, ...]) -> None:
    assert set(required) <= set(description) <= set(allowed)
    for key, value in description.items():
        assert isinstance(value, allowed[key]), key


def test_general_json_matches_schema() -> None:
    general = json.loads(component_metadata.general_json())
    check(general, GENERAL, ("version", "metadataTypes"))
    assert general["version"] == 1
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.\d+)?", general["firmwareVersion"])
    (parameters,) = general["metadataTypes"]
    check(parameters, METADATA_TYPE, ("type", "uri"))
    assert (parameters["type"], parameters["uri"]) == (1, "mftp:///metadata/parameters.json")
    assert parameters["fileCrc"] == crc32(component_metadata.parameters_json())


def test_parameters_json_matches_schema() -> None:
    described = json.loads(component_metadata.parameters_json())
    assert set(described) == {"version", "parameters"}
    assert described["version"] == 1, "what QGroundControl reads; the schema's 3 it refuses"
    rows = {row["name"]: row for row in described["parameters"]}
    assert set(rows) == {row.name for row in PARAMETERS}
    for row in PARAMETERS:
        description = rows[row.name]
        check(description, PARAMETER, ("name",))
        assert re.fullmatch(r"[.\-a-zA-Z0-9_{}]{1,16}", description["name"])
        assert description["type"] == "Float", "all travel as REAL32"
        assert (description["min"], description["max"], description["default"]) == (
            row.minimum,
            row.maximum,
            row.default,
        )
        assert (description["units"], description["shortDesc"]) == (row.unit, row.doc)
        assert description.get("increment") == (1 if row.integer else None)
    assert rows["MAV_SYS_ID"]["rebootRequired"]
    assert "rebootRequired" not in rows["HDG_P"]


def test_every_parameter_group_has_title() -> None:
    groups = {
        row["group"] for row in json.loads(component_metadata.parameters_json())["parameters"]
    }
    assert not [group for group in groups if group.isupper()]
