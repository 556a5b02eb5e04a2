"""Tables of a scenario file that describe the water: its motion, its density and its boundaries.

Tables and keys that are absent mean no current, no waves, uniform density, a flat floor and no ice.
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
    TimeConstant,
    WaterDensity,
)

MAX_WAVE_STEEPNESS = 1.0 / 7.0
"""Ratio of height to length at which a wave breaks in deep water (Michell 1893)."""


class WaterTable(ScenarioTable, frozen=True):
    """Properties of the water."""

    density_kgpm3: WaterDensity = 1025.0
    """Density of the water unless [density] has layers; always the pressure sensor's assumption."""
    surface_pressure_hpa: Annotated[float, Meta(ge=400.0, le=1100.0)] = 1013.25
    """Air pressure at the surface; lakes in mountains have 600 hPa."""
    temperature_degc: Temperature = 10.0


class CurrentLayer(ScenarioTable, frozen=True):
    """Current at one depth."""

    depth_m: NotNegative
    speed_mps: Speed
    towards_deg: Angle


class Variation(ScenarioTable, frozen=True):
    """Gauss-Markov velocity, uniform in space, added to the steady current.

    The north and east components are independent.
    """

    rms_mps: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.0
    """Root mean square of each component."""
    time_constant_s: TimeConstant = 60.0
    """Lag at which the autocorrelation has fallen to 1/e."""


class CurrentConfig(ScenarioTable, frozen=True):
    """Steady current: uniform, or in layers.

    Between layers the velocity is interpolated linearly; above the first and below the last layer
    it is constant.
    """

    speed_mps: Speed = 0.0
    towards_deg: Angle = 0.0
    layer: tuple[CurrentLayer, ...] = ()
    variation: Variation = Variation()


class Waves(ScenarioTable, frozen=True):
    """Sea state given by its spectrum; a height of zero means no waves."""

    spectrum: Literal["pierson-moskowitz", "jonswap"] = "jonswap"
    significant_height_m: Annotated[float, Meta(ge=0.0, le=15.0)] = 0.0
    peak_period_s: Annotated[float, Meta(ge=1.0, le=30.0)] | None = None
    """Peak period; if absent with Pierson-Moskowitz, that of the fully developed sea is used."""
    gamma: Annotated[float, Meta(ge=1.0, le=10.0)] = 3.3
    """Peak enhancement; JONSWAP only."""
    from_deg: Angle = 0.0
    spreading: Annotated[float, Meta(ge=0.0, le=200.0)] = 0.0
    """Exponent s of the spreading function cos^2s(angle/2) about ``from_deg``; 0: long-crested."""
    components: Annotated[int, Meta(ge=1, le=200)] = 30
    """Number of sinusoidal components."""


class DensityLayer(ScenarioTable, frozen=True):
    """Density at one depth."""

    depth_m: NotNegative
    density_kgpm3: WaterDensity


class Density(ScenarioTable, frozen=True):
    """Density over depth: linear between layers, constant above the first and below the last."""

    layer: tuple[DensityLayer, ...] = ()


class FloorTable(ScenarioTable, frozen=True):
    """Sea floor: flat, sloping, or read from a file."""

    depth_m: Positive = 20.0
    """Depth at the site, the origin of north and east."""
    slope_deg: Annotated[float, Meta(ge=0.0, le=60.0)] = 0.0
    deepens_towards_deg: Angle = 0.0
    """Bearing of the steepest descent."""
    file: str = ""
    """ESRI ASCII grid of floor heights (negative), in m east and north of the site.

    It replaces the other keys.
    """


class Ice(ScenarioTable, frozen=True):
    """Level ice cover; a draft of zero means no ice."""

    draft_m: Annotated[float, Meta(ge=0.0, le=50.0)] = 0.0
    """Depth of the underside of the ice."""


def check_consistency(
    current: CurrentConfig, waves: Waves, density: Density, floor: FloorTable, ice: Ice
) -> None:
    """Check combinations of values that are valid on their own.

    Raises
    ------
    ScenarioError
        The values contradict each other; the message does not name the file.
    """
    _check_ascending("current", [layer.depth_m for layer in current.layer])
    _check_ascending("density", [layer.depth_m for layer in density.layer])
    if current.layer and current.speed_mps:
        raise ScenarioError(
            f"current.speed_mps = {current.speed_mps}: expected either this key or current.layer"
        )
    if waves.significant_height_m and waves.spectrum == "jonswap" and waves.peak_period_s is None:
        raise ScenarioError(
            "waves.peak_period_s: missing key; a JONSWAP spectrum needs its peak period"
        )
    if waves.significant_height_m and ice.draft_m:
        raise ScenarioError(
            f"ice.draft_m = {ice.draft_m}: expected no [waves] with it:"
            " waves under ice are not simulated"
        )
    height_m, period_s = waves.significant_height_m, waves.peak_period_s
    if period_s is not None and height_m > (
        max_height_m := MAX_WAVE_STEEPNESS * deep_length_m(period_s)
    ):
        raise ScenarioError(
            f"waves.significant_height_m = {height_m}: expected at most {max_height_m:.2g} "
            f"with peak_period_s = {period_s}: steeper waves break"
        )
    if ice.draft_m >= floor.depth_m and not floor.file:
        raise ScenarioError(
            f"ice.draft_m = {ice.draft_m}: expected less than floor.depth_m = {floor.depth_m}"
        )


def deep_length_m(period_s: float) -> float:
    """Return the length of a wave in deep water, g T^2 / (2 pi) (Airy 1845), m."""
    return STANDARD_GRAVITY_MPS2 * period_s**2 / (2.0 * pi)


def _check_ascending(table: str, depths_m: Sequence[float]) -> None:
    """Check that each layer is deeper than the one before it."""
    for number, (above, below) in enumerate(pairwise(depths_m), 1):
        if below <= above:
            raise ScenarioError(
                f"{table}.layer[{number}].depth_m = {below}: expected more than {above}, the"
                " depth of the layer before"
            )
