"""Component metadata: what parameters mean, as JSON that ground stations fetch over FTP.

Sources: https://mavlink.io/en/services/component_metadata.html, and the schemas of
mavlink/mavlink's folder ``component_metadata``: general.schema.json, parameter.schema.json. Both
files say version 1 as PX4's do: QGroundControl reads no other (CompInfoGeneral::setJson,
CompInfoParam::setJson), though the second schema asks for 3 or more."""

import json
from functools import cache
from typing import Any

from autopilot.control.params import PARAMETERS, ParamInfo
from autopilot.telemetry.identity import version
from mavlink_io.services.ftp.payload import crc32

GENERAL_PATH, PARAMETERS_PATH = "/metadata/general.json", "/metadata/parameters.json"
_FORMAT = 1
_PARAMETER_TYPE = 1
"""COMP_METADATA_TYPE_PARAMETER."""
_GROUPS = {
    "ACT": "Actuators",
    "DPT": "Depth loop",
    "EST": "Estimator",
    "FS": "Failsafe",
    "GAIN": "Speed",
    "HDG": "Heading loop",
    "HLTH": "Health",
    "LAW": "Laws",
    "LOG": "Onboard log",
    "MAG": "Estimator",
    "MAV": "MAVLink",
    "MIS": "Mission",
    "NAV": "Navigation",
    "OFB": "Offboard",
    "PTCH": "Pitch loop",
    "ROLL": "Actuators",
    "RTL": "Return",
    "SID": "Identification",
    "SPD": "Speed",
    "STB": "Stabilize",
    "STN": "Station",
    "SURF": "Depth loop",
    "SYS": "System",
    "THR": "Speed",
    "TRIM": "Actuators",
}
"""By what a name begins with; others are called by that."""
_REBOOT_REQUIRED = frozenset(("MAV_SYS_ID",))


def uri(path: str) -> str:
    """Where a file lies, for whoever has only the text to go by."""
    return f"mftp://{path}"


@cache
def parameters_json() -> bytes:
    """Every parameter with its range, unit and meaning."""
    return _json({"version": _FORMAT, "parameters": [_describe(row) for row in PARAMETERS]})


@cache
def general_json() -> bytes:
    """What other files there are. Only real releases have a version of the form that the schema
    asks for."""
    numbers = version().split(".")
    release = version() if len(numbers) == 3 and all(n.isdecimal() for n in numbers) else "0.0.0"
    there = {
        "type": _PARAMETER_TYPE,
        "uri": uri(PARAMETERS_PATH),
        "fileCrc": crc32(parameters_json()),
    }
    return _json(
        {
            "version": _FORMAT,
            "vendorName": "Caribou",
            "modelName": "Caribou AUV",
            "firmwareVersion": release,
            "metadataTypes": [there],
        }
    )


def general_crc() -> int:
    """By which a client knows whether it has the files already."""
    return crc32(general_json())


def component_metadata(time_boot_ms: int) -> tuple[Any, ...]:
    """COMPONENT_METADATA's fields in wire order."""
    return time_boot_ms, general_crc(), uri(GENERAL_PATH)


def _describe(row: ParamInfo) -> dict[str, Any]:
    described: dict[str, Any] = {
        "name": row.name,
        "type": "Float",
        "group": _GROUPS.get(row.name.split("_", 1)[0], row.name.split("_", 1)[0]),
        "category": "Standard",
        "shortDesc": row.doc,
        "units": row.unit,
        "default": row.default,
        "min": row.minimum,
        "max": row.maximum,
    }
    if row.integer:
        described |= {"decimalPlaces": 0, "increment": 1}
    if row.name in _REBOOT_REQUIRED:
        described["rebootRequired"] = True
    return described


def _json(content: Any) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()
