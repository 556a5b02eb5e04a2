"""A vehicle file as it is written: the tables of ``schema``, nearly every key of which may be left
out."""

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
"""What nothing else tells: a vehicle file may leave out every key but these."""


def _with_optional_keys(kind: type[VehicleTable]) -> Any:
    """``kind`` as a vehicle file may give it, with what it can leave out."""
    needed = _GEOMETRY.get(kind, ())
    keys = [
        (field.name, field.type)
        if field.name in needed
        else (field.name, _optional(field.type), UNSET)
        for field in fields(kind)
    ]
    return defstruct(kind.__name__, keys, frozen=True, forbid_unknown_fields=True, kw_only=True)


def _optional(annotation: Any) -> Any:
    kinds = (annotation, *get_args(annotation))
    tables = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, VehicleTable)]
    return (_with_optional_keys(tables[0]) if tables else annotation) | UnsetType


Description = _with_optional_keys(VehicleConfig)
