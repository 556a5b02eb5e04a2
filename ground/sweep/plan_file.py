"""Plan of a sweep in TOML, and its conversion to a request.

    samples = 64                       # vehicles and values of ranges, drawn by the sampler
    sampler = "sobol"                  # sobol, halton, latin-hypercube, random
    repeats = 1                        # dives of each combination and sample, with other noise
    seed = 1
    chunk = 8                          # dives that a process flies at a time, rows of a part
    missions = ["combined"]            # as for `ground fly`

    [[vehicle]]
    source = "campaign/model.json"     # model.json, caribou_nominal, or a vehicle file
    name = "caribou"                   # default: the source without folder and suffix
    prior = "my_vehicle.toml"          # for a model.json: in place of its vehicle file
    spread = 1.0                       # factor on the standard deviations; 0 flies the mean

    [[gains]]
    file = "campaign/gains.param"
    name = "pid"                       # default: the file without folder and suffix
    controller = "controller.json"     # LQG: flown instead of the PID loops

    [[gains]]                          # a campaign on each vehicle: its redesigned gains are flown
    file = "gains.param"               # gains that fly the tests
    name = "20 min of tests"
    tests = ["rudder_steps", "elevator_steps"]          # missions, as for `ground fly`
    held_out = ["rudder_heldout", "elevator_heldout"]   # default: none, the model is not validated
    spec = { pm_deg = 45.0, max_sensitivity = 1.9 }     # limits other than those of redesign

    [sea]                              # a number, a list of numbers, or a range to sample
    disturbance_scale = [1.0, 1.5]
    current_mps = { min = 0.0, max = 0.3 }

    [fault]
    rudder_bias_deg = 0.0
    elevator_bias_deg = 0.0
    actuator_rate_scale = 1.0
    actuator_delay_s = 0.0

    [pass]                             # without it a dive passes that is held to its end
    heading_deg = 3.0                  # largest 95 % errors after settling
    pitch_deg = 5.0
    depth_m = 0.3
    settling_s = 40.0                  # largest settling time of any leg

Every combination of vehicle, gains, mission and listed values is flown with every sample. Files are
found relative to the folder of the plan.
"""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from ground.campaign import refit
from ground.client import param_file
from ground.missions import plans, script
from mavlink_io import toml_io
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MissionItem
from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import read_text
from sysid.design.specification import Spec
from sysid.monte_carlo import samples
from sysid.sweep import gains as gain_sets
from sysid.sweep.campaigns import CampaignPlan, SweepMission
from sysid.sweep.dives import DiveLimits, SweepGains
from sysid.sweep.points import ParameterRange, Sampler
from sysid.sweep.sweep_request import Levels, SweepRequest, SweepVehicle
from sysid.test_design import prior as design_priors
from sysid.test_design.prior import DesignPrior

BOUNDS = {
    "disturbance_scale": (0.0, 10.0),
    "current_mps": (0.0, 5.0),
    "rudder_bias_deg": (-30.0, 30.0),
    "elevator_bias_deg": (-30.0, 30.0),
    "actuator_rate_scale": (0.01, 10.0),
    "actuator_delay_s": (0.0, 2.0),
}
"""Smallest and largest value of each input."""
SEA, FAULTS = tuple(BOUNDS)[:2], tuple(BOUNDS)[2:]
COUNTS = {
    "samples": (1, 1_000_000),
    "repeats": (1, 10_000),
    "seed": (0, 2**31 - 1),
    "chunk": (1, 1000),
}
"""Smallest and largest value of each count."""


class RangeTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A range of an input, sampled evenly."""

    min: float
    """Smallest value."""
    max: float
    """Largest value."""


LevelValues = float | list[float] | RangeTable


class VehicleEntry(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """One [[vehicle]]."""

    source: str
    """``model.json`` (posterior), ``caribou_nominal`` or a vehicle file (prior)."""
    name: str = ""
    """Name in the rows; without it the source without folder and suffix."""
    prior: str | None = None
    """Vehicle file of a ``model.json``, in place of the one in it."""
    spread: float = 1.0
    """Factor on the standard deviations; 0 flies the mean vehicle."""


class GainsEntry(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """One [[gains]]."""

    file: str
    """Parameters; trims that it lacks are those of the mean vehicle."""
    name: str = ""
    """Name in the rows; without it the file without folder and suffix."""
    controller: str | None = None
    """LQG controllers, flown instead of the PID loops."""
    tests: list[str] = []
    """Missions with tests: a campaign on each vehicle, whose redesigned gains are flown."""
    held_out: list[str] = []
    """Missions whose tests validate the model of the campaign."""
    spec: Spec = Spec()
    """Limits of the redesign of the campaign."""


class PassTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The table [pass]."""

    heading_deg: float | None = None
    """Largest 95 % error of heading after settling."""
    pitch_deg: float | None = None
    """Largest 95 % error of pitch after settling."""
    depth_m: float | None = None
    """Largest 95 % error of depth after settling."""
    settling_s: float | None = None
    """Largest settling time of any leg."""


class SweepPlan(msgspec.Struct, forbid_unknown_fields=True, frozen=True, rename={"limits": "pass"}):
    """A plan as in its file."""

    vehicle: list[VehicleEntry]
    """Vehicles to sample."""
    gains: list[GainsEntry]
    """Sets of gains."""
    missions: list[str]
    """Names or files of missions, as for `ground fly`."""
    sea: dict[str, LevelValues] = {}
    """``disturbance_scale`` and ``current_mps``: a number, a list or a range."""
    fault: dict[str, LevelValues] = {}
    """``rudder_bias_deg``, ``elevator_bias_deg``, ``actuator_rate_scale``, ``actuator_delay_s``."""
    limits: PassTable = PassTable()
    """Limits of a dive that passes."""
    sampler: Sampler = Sampler.SOBOL
    """Method that draws the samples."""
    samples: int = 64
    """Number of vehicles and of values of ranges."""
    repeats: int = 1
    """Dives of each combination and sample, with other noise."""
    seed: int = 1
    """Seed of sampler and noise."""
    chunk: int = 8
    """Dives that a process flies at a time."""


def load(path: Path) -> SweepRequest:
    """Read a plan and the files that it names.

    Parameters
    ----------
    path : Path
        Plan in TOML.

    Returns
    -------
    SweepRequest
        The sweep.

    Raises
    ------
    InputError
        The plan or a file that it names is invalid; the message names the file, and key and value.
    """
    plan = _read(path)
    for key, (low, high) in COUNTS.items():
        if not low <= getattr(plan, key) <= high:
            raise InputError(f"{path}: {key} = {getattr(plan, key)}: must be {low} to {high}")
    for key in ("vehicle", "gains", "missions"):
        if not getattr(plan, key):
            raise InputError(f"{path}: {key}: is empty; give at least one")
    return SweepRequest(
        name=path.name,
        vehicles=_vehicles(path, plan),
        missions=_missions(path, "missions", plan.missions),
        conditions={
            **_levels(path, "sea", plan.sea, SEA),
            **_levels(path, "fault", plan.fault, FAULTS),
        },
        limits=_limits(path, plan.limits),
        sampler=plan.sampler,
        samples=plan.samples,
        repeats=plan.repeats,
        seed=plan.seed,
        chunk=plan.chunk,
    )


def _read(path: Path) -> SweepPlan:
    """Return the content of a plan. Raises InputError."""
    try:
        return toml_io.decode(read_text(path), SweepPlan, str(path), InputError)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not TOML: {error}") from None


def _vehicles(path: Path, plan: SweepPlan) -> tuple[SweepVehicle, ...]:
    """Return the vehicles with the sets of gains."""
    names = _names(path, "vehicle", [(entry.name, entry.source) for entry in plan.vehicle])
    gain_names = _names(path, "gains", [(entry.name, entry.file) for entry in plan.gains])
    folder, vehicles = path.parent, []
    for name, entry in zip(names, plan.vehicle, strict=True):
        if not 0.0 <= entry.spread <= 10.0:
            raise InputError(f"{path}: {name}: spread = {entry.spread:g}: must be 0 to 10")
        prior = _prior(folder, entry)
        sets = tuple(
            _gains(path, gain_name, gains, prior)
            for gain_name, gains in zip(gain_names, plan.gains, strict=True)
        )
        vehicles.append(SweepVehicle(name, prior, entry.spread, sets))
    return tuple(vehicles)


def _prior(folder: Path, entry: VehicleEntry) -> DesignPrior:
    """Return the distribution of a vehicle. Raises InputError."""
    if not entry.source.endswith(".json"):
        source = folder / entry.source
        return design_priors.read(source if source.suffix == ".toml" else entry.source)
    prior = refit.read_vehicle(str(folder / entry.prior)) if entry.prior else None
    return samples.read(folder / entry.source, prior)


def _gains(path: Path, name: str, entry: GainsEntry, prior: DesignPrior) -> SweepGains:
    """Return a set of gains with the trims of the mean vehicle. Raises InputError."""
    values = param_file.load(path.parent / entry.file)
    trims_deg = samples.trims_deg(prior.vehicle(prior.mean))
    controller = path.parent / entry.controller if entry.controller else None
    gains = gain_sets.read(name, values, trims_deg, controller)
    if not entry.tests:
        if entry.held_out:
            raise InputError(f"{path}: {name}: held_out: needs tests that are fitted")
        return gains
    if controller:
        raise InputError(f"{path}: {name}: tests: are flown by PID loops; remove controller")
    plan = CampaignPlan(
        values,
        _missions(path, "tests", entry.tests),
        _missions(path, "held_out", entry.held_out),
        entry.spec,
    )
    return gains._replace(campaign=plan)


def _missions(path: Path, key: str, names: Sequence[str]) -> tuple[SweepMission, ...]:
    """Return the missions of a key. Raises InputError."""
    stems = _names(path, key, [("", name) for name in names])
    return tuple(
        SweepMission(stem, _items(path.parent, name))
        for stem, name in zip(stems, names, strict=True)
    )


def _items(folder: Path, name: str) -> tuple[MissionItem, ...]:
    """Return the items of a shipped mission or of a file."""
    return plans.load_items(name if name in script.shipped_names() else str(folder / name))


def _names(path: Path, key: str, entries: Sequence[tuple[str, str]]) -> list[str]:
    """Return given names, or file names without suffix; all different. Raises InputError."""
    names = [name or Path(source).stem for name, source in entries]
    duplicate = next((name for name in names if names.count(name) > 1), None)
    if duplicate:
        raise InputError(f"{path}: {key}: {duplicate} stands for two; give each a name of its own")
    return names


def _levels(
    path: Path, table: str, entries: dict[str, LevelValues], known: Sequence[str]
) -> dict[str, Levels]:
    """Return the values of the inputs in a table. Raises InputError."""
    levels: dict[str, Levels] = {}
    for key, values in entries.items():
        if key not in known:
            raise InputError(
                f"{path}: {table}.{key}: cannot be swept; expected one of {', '.join(known)}."
                f" `sitl --scenario` simulates other seas and faults{did_you_mean(key, known)}"
            )
        listed = (
            [values.min, values.max]
            if isinstance(values, RangeTable)
            else values
            if isinstance(values, list)
            else [values]
        )
        low, high = BOUNDS[key]
        wrong = next((value for value in listed if not low <= value <= high), None)
        if wrong is not None:
            raise InputError(f"{path}: {table}.{key} = {wrong:g}: must be {low:g} to {high:g}")
        if isinstance(values, RangeTable):
            if values.min >= values.max:
                raise InputError(f"{path}: {table}.{key}: min must be less than max")
            levels[key] = ParameterRange(values.min, values.max)
        elif not listed or len(set(listed)) < len(listed):
            raise InputError(f"{path}: {table}.{key} = {listed}: must be different numbers")
        else:
            levels[key] = tuple(listed)
    return levels


def _limits(path: Path, table: PassTable) -> DiveLimits:
    """Return the limits of a dive. Raises InputError."""
    given = {
        key: getattr(table, key) for key in DiveLimits._fields if getattr(table, key) is not None
    }
    wrong = next((key for key, value in given.items() if not value > 0.0), None)
    if wrong:
        raise InputError(f"{path}: pass.{wrong} = {given[wrong]:g}: must be greater than 0")
    return DiveLimits(**given)
