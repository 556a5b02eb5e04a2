"""Base types of the tables in a scenario file: strict structs, and numbers with their ranges."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from mavlink_io.errors import ErrorCode, InputError

Positive = Annotated[float, Meta(gt=0.0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0.0, le=1e6)]
TimeConstant = Annotated[float, Meta(ge=0.05, le=1e6)]
WaterDensity = Annotated[float, Meta(ge=900.0, le=1300.0)]
Speed = Annotated[float, Meta(ge=-5.0, le=5.0)]
Temperature = Annotated[float, Meta(ge=-2.0, le=40.0)]
Angle = Annotated[float, Meta(ge=-360.0, le=360.0)]
MAX_OFFSET_M = 10_000.0
"""Largest distance north or east of the site at which a vehicle may start."""
Damping = Annotated[float, Meta(gt=0.0, lt=1.0)]


class ScenarioError(InputError):
    """The scenario cannot be used; the message names file, key, value and the expected value."""

    code = ErrorCode.SCENARIO


class ScenarioTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a scenario file."""
