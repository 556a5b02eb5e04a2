"""Vehicle file as a user writes it: the tables of ``file_schema`` with most keys optional."""

from __future__ import annotations

from typing import Any, get_args

from msgspec import UNSET, UnsetType, defstruct
from msgspec.structs import fields

from sitl.vehicle.file_schema import DuctGeometry, FinGeometry, VehicleConfig, VehicleTable

_GEOMETRY: dict[type[VehicleTable], tuple[str, ...]] = {
    VehicleConfig: ("name", "hull"),
    DuctGeometry: ("diameter_m", "chord_m"),
    FinGeometry: ("layout", "span_m", "root_chord_m"),
}
"""Keys that cannot be derived, by table; a vehicle file may omit all others."""


def _with_optional_keys(kind: type[VehicleTable]) -> Any:
    """Return table type ``kind`` with all keys optional except those of ``_GEOMETRY``."""
    needed = _GEOMETRY.get(kind, ())
    keys = [
        (field.name, field.type)
        if field.name in needed
        else (field.name, _optional(field.type), UNSET)
        for field in fields(kind)
    ]
    return defstruct(kind.__name__, keys, frozen=True, forbid_unknown_fields=True, kw_only=True)


def _optional(annotation: Any) -> Any:
    """Return the type of an optional key; a table inside has optional keys too."""
    kinds = (annotation, *get_args(annotation))
    tables = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, VehicleTable)]
    return (_with_optional_keys(tables[0]) if tables else annotation) | UnsetType


Description = _with_optional_keys(VehicleConfig)
