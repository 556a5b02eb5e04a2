"""Scenario files: site, water, disturbances, faults and initial state of a run, as strict TOML.

Tables and keys that are absent take the defaults below, which describe calm water off Boston.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta
from msgspec.structs import replace

from mavlink_io import toml_io
from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import read_text
from sitl import bathymetry, environment_schema
from sitl.environment_schema import CurrentConfig, Density, FloorTable, Ice, WaterTable, Waves
from sitl.faults import catalogue
from sitl.faults.catalogue import FaultError, ScheduledFault
from sitl.scenario_types import (
    MAX_OFFSET_M,
    Angle,
    Damping,
    NotNegative,
    Positive,
    ScenarioError,
    ScenarioTable,
    Speed,
    TimeConstant,
)

Latitude = Annotated[float, Meta(ge=-89.0, le=89.0)]


class Site(ScenarioTable, frozen=True):
    """Geographic position of the surface point that is the origin of north and east."""

    latitude_deg: Latitude = 42.35
    longitude_deg: Angle = -71.0


Offset = Annotated[float, Meta(ge=-MAX_OFFSET_M, le=MAX_OFFSET_M)]
"""Distance from the site, m."""


class StartTable(ScenarioTable, frozen=True):
    """State of the vehicle at vehicle time zero.

    Without a depth the vehicle floats at the surface, in trim and at rest.
    """

    heading_deg: Angle = 0.0
    north_m: Offset = 0.0
    """Place of the start, north and east of the site."""
    east_m: Offset = 0.0
    depth_m: NotNegative | None = None
    speed_mps: Speed = 0.0
    """Forward speed through the water."""
    battery_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 100.0


class Rig(ScenarioTable, frozen=True):
    """Equipment that holds and measures the vehicle on the bench."""

    clamped: bool = False
    """Hold the body in its initial state, floating at rest; tailcone and sensors still work."""
    encoder: str = ""
    """Catalogue name of a duct encoder fitted for this run, in place of the vehicle's own."""


class MagneticField(ScenarioTable, frozen=True):
    """Earth's magnetic field; the defaults approximate the World Magnetic Model at Boston."""

    declination_deg: Angle = -14.4
    """Magnetic declination, deg, positive east."""
    inclination_deg: Annotated[float, Meta(ge=-90.0, le=90.0)] = 67.0
    strength_gauss: Positive = 0.52


class SlowDisturbance(ScenarioTable, frozen=True):
    """First-order Gauss-Markov disturbance moments."""

    time_constant_s: TimeConstant = 3.0
    yaw_rms_nm: NotNegative = 0.0
    pitch_rms_nm: NotNegative = 0.0


class WaveDisturbance(ScenarioTable, frozen=True):
    """Narrow-band disturbance moments at the wave frequency."""

    frequency_hz: Annotated[float, Meta(ge=0.001, le=10.0)] = 0.15
    damping: Damping = 0.1
    yaw_rms_nm: NotNegative = 0.0
    pitch_rms_nm: NotNegative = 0.0


class DisturbanceLevels(ScenarioTable, frozen=True):
    """Disturbance moments on the vehicle."""

    slow: SlowDisturbance = SlowDisturbance()
    waves: WaveDisturbance = WaveDisturbance()


class Scenario(ScenarioTable, frozen=True):
    """Content of a scenario file."""

    title: str = ""
    site: Site = Site()
    start: StartTable = StartTable()
    rig: Rig = Rig()
    water: WaterTable = WaterTable()
    current: CurrentConfig = CurrentConfig()
    waves: Waves = Waves()
    density: Density = Density()
    floor: FloorTable = FloorTable()
    ice: Ice = Ice()
    magnetic_field: MagneticField = MagneticField()
    disturbance: DisturbanceLevels = DisturbanceLevels()
    fault: tuple[dict[str, float | str], ...] = ()
    """Scheduled faults; ``sitl.faults.catalogue`` defines the keys."""

    @property
    def faults(self) -> list[ScheduledFault]:
        """Scheduled faults, parsed.

        Raises FaultError.
        """
        return [catalogue.read(row) for row in self.fault]


def names() -> list[str]:
    """Return the names of the scenarios that are supplied with the simulator."""
    return sorted(
        path.name.removesuffix(".toml")
        for path in _shipped().iterdir()
        if path.name.endswith(".toml")
    )


def with_place(scenario: Scenario, north_m: float, east_m: float) -> Scenario:
    """Return a scenario with another place of the start.

    Parameters
    ----------
    scenario : Scenario
        Any scenario.
    north_m, east_m : float
        Place of the start, from the site.

    Returns
    -------
    Scenario
        The scenario; all other values are unchanged.
    """
    return replace(scenario, start=replace(scenario.start, north_m=north_m, east_m=east_m))


def load(name_or_path: str) -> Scenario:
    """Read a supplied scenario or a scenario file.

    Parameters
    ----------
    name_or_path : str
        Name of a supplied scenario (see ``names``), or path of a TOML file.

    Returns
    -------
    Scenario
        The scenario with all defaults filled in.

    Raises
    ------
    ScenarioError
        The file does not exist, is not TOML, or contains a wrong key or value.
    """
    if name_or_path in names():
        text = (_shipped() / f"{name_or_path}.toml").read_text(encoding="utf-8")
    else:
        text = _read(name_or_path)
    source = f"scenario {name_or_path}"
    scenario = toml_io.decode(text, Scenario, source, ScenarioError)
    if scenario.rig.clamped and (scenario.start.depth_m is not None or scenario.start.speed_mps):
        raise ScenarioError(
            f"{source}: rig.clamped = true: expected no start.depth_m and no start.speed_mps"
            " with it"
        )
    try:
        environment_schema.check_consistency(
            scenario.current, scenario.waves, scenario.density, scenario.floor, scenario.ice
        )
        _check_start_depth(scenario)
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from None
    for number, row in enumerate(scenario.fault, 1):
        try:
            catalogue.read(row)
        except FaultError as error:
            raise ScenarioError(f"{source}: fault {number}: {error}") from None
    return _with_floor_file(scenario, name_or_path)


def _check_start_depth(scenario: Scenario) -> None:
    """Check that the vehicle starts below the ice and above the floor."""
    depth_m, ice_m, floor_m = scenario.start.depth_m, scenario.ice.draft_m, scenario.floor.depth_m
    if depth_m is not None and depth_m < ice_m:
        raise ScenarioError(f"start.depth_m = {depth_m}: expected more than ice.draft_m = {ice_m}")
    if depth_m is not None and depth_m >= floor_m and not scenario.floor.file:
        raise ScenarioError(
            f"start.depth_m = {depth_m}: expected less than floor.depth_m = {floor_m}"
        )


def _with_floor_file(scenario: Scenario, path: str) -> Scenario:
    """Resolve the floor file, which is relative to the scenario file, and check depths with it."""
    if not scenario.floor.file:
        return scenario
    floor = Path(path).parent / scenario.floor.file
    deepest_m = -float(bathymetry.read(floor).height_m.min())
    for key, value in (
        ("start.depth_m", scenario.start.depth_m),
        ("ice.draft_m", scenario.ice.draft_m),
    ):
        if value is not None and value >= deepest_m:
            raise ScenarioError(
                f"scenario {path}: {key} = {value}: expected less than the floor's {deepest_m:g}"
            )
    return replace(scenario, floor=replace(scenario.floor, file=str(floor)))


def _shipped() -> Any:
    """Return the folder of supplied scenarios."""
    return resources.files("sitl") / "scenarios"


def _read(path: str) -> str:
    """Return the text of a scenario file.

    Raises ScenarioError.
    """
    try:
        return read_text(Path(path))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ScenarioError(
            f"scenario {path}: {reason}; expected {', '.join(names())} or a TOML file"
            f"{did_you_mean(path, names())}"
        ) from None
