"""Component metadata: agreement with the published schemas and the parameter table."""

import json
import re
from typing import Any

from autopilot.control import excitation
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
    "values": list,
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


SWITCHES = {"LOG_DISARMED", "LOG_ENABLE", "LQG_ENABLE", "MAV_FORWARD", "MIS_SEQ0_HOME"}
SWITCHES |= {"ROLL_COMP", "SURF_DROP_EN", "SYS_FAILURE_EN"}
NUMBERS = {"MAV_SYS_ID", "SID_RUNS_1", "SID_RUNS_2", "SID_SEED"}
"""Integers whose values have no names."""


def test_every_enumeration_names_all_its_values() -> None:
    rows = {row.name: row for row in PARAMETERS if row.integer}
    described = {
        row["name"]: {entry["value"]: entry["description"] for entry in row.get("values", ())}
        for row in json.loads(component_metadata.parameters_json())["parameters"]
    }
    assert {name for name, values in described.items() if values} == rows.keys() - NUMBERS
    for name in rows.keys() - NUMBERS - {"SID_AXIS"}:
        assert set(described[name]) == set(range(int(rows[name].maximum) + 1)), name
    assert set(described["SID_AXIS"]) == {0, *excitation.AXES}
    assert described["SID_AXIS"][112] == "rudder, loop on"
    assert described["FENCE_ACTION"][2] == "RTL (nearest rally point, or home)"
    assert described["MIS_END_ACT"] == {0: "HOLD", 1: "SURFACE", 2: "disarm"}
    assert all(described[name][0] == "Off" for name in SWITCHES)
