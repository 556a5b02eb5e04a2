"""Component metadata: descriptions of the parameters as JSON, offered over MAVLink FTP.

Sources: https://mavlink.io/en/services/component_metadata.html, and the schemas of
mavlink/mavlink's folder ``component_metadata``: general.schema.json, parameter.schema.json. Both
files have version 1, like those of PX4: QGroundControl reads no other version
(CompInfoGeneral::setJson, CompInfoParam::setJson), although the second schema requires 3 or
more.
"""

import json
import re
from functools import cache
from typing import Any

from autopilot.control import excitation
from autopilot.control.params import PARAMETERS, ParamInfo
from autopilot.telemetry.identity import version
from mavlink_io.services.ftp.payload import crc32

GENERAL_PATH, PARAMETERS_PATH = "/metadata/general.json", "/metadata/parameters.json"
_FORMAT = 1
"""Version of both files."""
_PARAMETER_TYPE = 1
"""COMP_METADATA_TYPE_PARAMETER."""
_GROUPS = {
    "ACT": "Actuators",
    "BAT": "Battery",
    "DPT": "Depth loop",
    "EST": "Estimator",
    "FENCE": "Geofence",
    "FS": "Failsafe",
    "GAIN": "Speed",
    "HDG": "Heading loop",
    "HLTH": "Health",
    "LOG": "Onboard log",
    "LQG": "LQG controllers",
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
    "TURN": "Navigation",
}
"""Group title by name prefix; the prefix is the title of other groups."""
_VALUE = re.compile(r"(?:^|[:,] )(\d+) ([^,;(]+(?:\([^)]*\))?)")
"""A value and its meaning in the description of a parameter."""
_REBOOT_REQUIRED = frozenset(("MAV_SYS_ID",))
"""Parameters that take effect after a restart."""


def uri(path: str) -> str:
    """Return the URI of a file on the vehicle."""
    return f"mftp://{path}"


@cache
def parameters_json() -> bytes:
    """Return all parameters with range, unit and description as JSON."""
    return _json({"version": _FORMAT, "parameters": [_describe(row) for row in PARAMETERS]})


@cache
def general_json() -> bytes:
    """Return the list of metadata files as JSON.

    The schema requires a version of three numbers; any other version is given as 0.0.0.
    """
    numbers = version().split(".")
    release = version() if len(numbers) == 3 and all(n.isdecimal() for n in numbers) else "0.0.0"
    parameter_file = {
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
            "metadataTypes": [parameter_file],
        }
    )


def general_crc() -> int:
    """Return the CRC-32 of the list; a client compares it with that of its cached copy."""
    return crc32(general_json())


def component_metadata(time_boot_ms: int) -> tuple[Any, ...]:
    """Return the fields of COMPONENT_METADATA in wire order."""
    return time_boot_ms, general_crc(), uri(GENERAL_PATH)


def _describe(row: ParamInfo) -> dict[str, Any]:
    """Return the JSON object of a parameter."""
    description: dict[str, Any] = {
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
        description |= {"decimalPlaces": 0, "increment": 1}
    if meanings := enumeration(row):
        description["values"] = [
            {"value": value, "description": meaning} for value, meaning in meanings.items()
        ]
    if row.name in _REBOOT_REQUIRED:
        description["rebootRequired"] = True
    return description


def enumeration(row: ParamInfo) -> dict[int, str]:
    """Return the meaning of each value of a parameter whose description lists them; else none.

    Parameters
    ----------
    row : ParamInfo
        Row of the table; its description has "0 HOLD, 1 SURFACE", or "1: ..." for a switch.
    """
    if not row.integer:
        return {}
    if switch := re.match("1: (.*)", row.doc):
        return {0: "Off", 1: switch[1]}
    meanings = {int(number): meaning.strip() for number, meaning in _VALUE.findall(row.doc)}
    if row.name == "SID_AXIS":
        names = {number: meanings[number % 100] for number in excitation.AXES if number >= 100}
        meanings |= {number: f"{name}, loop on" for number, name in names.items()}
    return meanings


def _json(content: Any) -> bytes:
    """Return compact JSON."""
    return json.dumps(content, separators=(",", ":")).encode()
