"""The tables of a scenario file that tell of the water: how it moves, how heavy it is, and where it
ends.

What is left out is calm: no current, no waves, one density, a flat floor, no ice.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi
from typing import Annotated, Literal

from msgspec import Meta

from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from sitl.scenario_types import (
    Angle,
    NotNegative,
    Positive,
    ScenarioError,
    ScenarioTable,
    Speed,
    Temperature,
)

MAX_WAVE_STEEPNESS = 1.0 / 7.0
"""Height over length at which a wave breaks in deep water (Michell 1893)."""


class WaterTable(ScenarioTable, frozen=True):
    density_kgpm3: Positive = 1025.0
    """Everywhere, unless [density] has layers; and what the pressure sensor takes for it in either
    case."""
    surface_pressure_hpa: Positive = 1013.25
    temperature_degc: Temperature = 10.0


class CurrentLayer(ScenarioTable, frozen=True):
    depth_m: NotNegative
    speed_mps: Speed
    towards_deg: Angle


class Variation(ScenarioTable, frozen=True):
    """A Gauss-Markov velocity, uniform in space, on top of the steady current; north and east
    independent."""

    rms_mps: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.0
    """Of each component."""
    time_constant_s: Positive = 60.0
    """After which the correlation has fallen to 1/e."""


class Current(ScenarioTable, frozen=True):
    """Steady and the same at every depth, or in layers: linear between them, constant above the
    first and below."""

    speed_mps: Speed = 0.0
    towards_deg: Angle = 0.0
    layer: tuple[CurrentLayer, ...] = ()
    variation: Variation = Variation()


class Waves(ScenarioTable, frozen=True):
    """A sea by its spectrum; without height there is none."""

    spectrum: Literal["pierson-moskowitz", "jonswap"] = "jonswap"
    significant_height_m: Annotated[float, Meta(ge=0.0, le=15.0)] = 0.0
    peak_period_s: Annotated[float, Meta(ge=1.0, le=30.0)] | None = None
    """Of a Pierson-Moskowitz sea it may be left out: then it is that of the fully developed sea of
    this height."""
    gamma: Annotated[float, Meta(ge=1.0, le=10.0)] = 3.3
    """Peak enhancement; JONSWAP only."""
    from_deg: Angle = 0.0
    spreading: Annotated[float, Meta(ge=0.0, le=200.0)] = 0.0
    """s of cos^2s of half the angle off ``from_deg``; 0 is a long-crested sea."""
    components: Annotated[int, Meta(ge=1, le=200)] = 30


class DensityLayer(ScenarioTable, frozen=True):
    depth_m: NotNegative
    density_kgpm3: Annotated[float, Meta(ge=900.0, le=1300.0)]


class Density(ScenarioTable, frozen=True):
    """Density over depth: linear between the layers, constant above the first and below the
    last."""

    layer: tuple[DensityLayer, ...] = ()


class FloorTable(ScenarioTable, frozen=True):
    """Flat, sloping, or as a file has it."""

    depth_m: Positive = 20.0
    """Below the place that north and east are counted from."""
    slope_deg: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.0
    deepens_towards_deg: Angle = 0.0
    file: str = ""
    """ESRI ASCII grid in metres east and north of the site, heights of the floor (negative);
    replaces the rest."""


class Ice(ScenarioTable, frozen=True):
    """A lid of level ice; without a draft there is none."""

    draft_m: Annotated[float, Meta(ge=0.0, le=50.0)] = 0.0
    """Depth of its underside."""


def check_consistency(
    current: Current, waves: Waves, density: Density, floor: FloorTable, ice: Ice
) -> None:
    """Values that are each in range but cannot stand together. Raises ScenarioError, without the
    file's name."""
    _check_ascending("current", [layer.depth_m for layer in current.layer])
    _check_ascending("density", [layer.depth_m for layer in density.layer])
    if current.layer and current.speed_mps:
        raise ScenarioError(
            f"current.speed_mps = {current.speed_mps}: expected this or current.layer, not both"
        )
    if waves.significant_height_m and waves.spectrum == "jonswap" and waves.peak_period_s is None:
        raise ScenarioError(
            "waves.peak_period_s: missing key; a JONSWAP sea is not known by its height alone"
        )
    if waves.significant_height_m and ice.draft_m:
        raise ScenarioError(
            f"ice.draft_m = {ice.draft_m}: expected no [waves] with it; there are none under ice"
        )
    height_m, period_s = waves.significant_height_m, waves.peak_period_s
    if period_s is not None and height_m > (
        highest_m := MAX_WAVE_STEEPNESS * deep_length_m(period_s)
    ):
        raise ScenarioError(
            f"waves.significant_height_m = {height_m}: expected at most {highest_m:.2g} "
            f"with peak_period_s = {period_s}: they break"
        )
    if ice.draft_m >= floor.depth_m and not floor.file:
        raise ScenarioError(
            f"ice.draft_m = {ice.draft_m}: expected less than floor.depth_m = {floor.depth_m}"
        )


def deep_length_m(period_s: float) -> float:
    """Length of a wave in deep water, g T^2 / (2 pi) (Airy 1845)."""
    return STANDARD_GRAVITY_MPS2 * period_s**2 / (2.0 * pi)


def _check_ascending(table: str, depths_m: Sequence[float]) -> None:
    for number, (above, below) in enumerate(pairwise(depths_m), 1):
        if below <= above:
            raise ScenarioError(
                f"{table}.layer[{number}].depth_m = {below}: expected more than {above}, that of"
                " the layer before"
            )
