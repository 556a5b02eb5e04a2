"""Identified numbers of finished campaigns against the vehicle that flew.

    python -m benchmarks.campaigns.accuracy [--keep DIR]

The true numbers are those of the flown vehicle file, linearised in level flight in the water of the
scenario. A number is inside if it is within 1.96 of the model's standard deviations. Gain and phase
are those of rate over command at the crossover of the gains that flew the tests.
"""

import argparse
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.campaigns.__main__ import KEEP, VEHICLES, WIDTH
from benchmarks.identification import crossover, vehicles
from benchmarks.identification.outside import QUANTILE
from mavlink_io import toml_io
from mavlink_io.errors import InputError
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid.estimation.map import steady_state
from sysid.models import linear_planes, model_file, prediction
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane

NUMBERS = ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s")


class PlaneErrors(NamedTuple):
    """Errors of one plane of one campaign."""

    vehicle: str
    plane: Plane
    numbers: tuple[float, ...]
    """Errors of `NUMBERS`, gain and phase, each over its standard deviation."""
    gain_db: float
    phase_deg: float


def flown_vehicle(folder: Path, name: str) -> VehicleConfig:
    """Return the vehicle that a campaign flew, in the water of its scenario.

    The displaced volume stays: in lighter water the vehicle has less buoyancy.

    Parameters
    ----------
    folder : Path
        Folder of the campaign.
    name : str
        Name of the vehicle in `VEHICLES`, or another one.

    Returns
    -------
    VehicleConfig
        The vehicle file with the density of the scenario.
    """
    truth = folder / "truth.toml"
    flown = vehicle_files.load(truth if truth.is_file() else VEHICLES[name])
    scenario = folder / "scenario.toml"
    if not scenario.is_file():
        return flown
    text = scenario.read_text(encoding="utf-8")
    density = float(toml_io.read(text, str(scenario), InputError)["water"]["density_kgpm3"])
    weight_n = flown.ballast.mass_kg * flown.water.gravity_mps2
    buoyancy_n = (weight_n + flown.ballast.net_buoyancy_n) * density / flown.water.density_kgpm3
    return msgspec.structs.replace(
        flown,
        water=msgspec.structs.replace(flown.water, density_kgpm3=density),
        ballast=msgspec.structs.replace(flown.ballast, net_buoyancy_n=buoyancy_n - weight_n),
    )


def errors_of(folder: Path) -> list[PlaneErrors]:
    """Return the errors of both planes of a campaign with a model; empty without one.

    Parameters
    ----------
    folder : Path
        Folder of the campaign, named VEHICLE_SEED.

    Returns
    -------
    list of PlaneErrors
        Errors of the planes with a crossover.
    """
    name = folder.name.rpartition("_")[0]
    if not (folder / "model.json").is_file():
        return []
    model = model_file.read(folder / "model.json")
    identified = prediction.vehicles(model)[0]
    truth = vehicles.nominal(flown_vehicle(folder, name))
    return [
        _plane_errors(name, plane, model, identified, truth)
        for plane in Plane
        if plane in model.validation and model.validation[plane].crossover
    ]


def _plane_errors(
    name: str,
    plane: Plane,
    model: model_file.IdentifiedModel,
    identified: CandidateVehicle,
    truth: CandidateVehicle,
) -> PlaneErrors:
    """Return the errors of one plane."""
    true_numbers = linear_planes.small_signal(steady_state.linear_plane(truth, plane))._asdict()
    at = model.validation[plane].crossover
    assert at is not None
    gain_db, phase_deg = crossover.errors_at(identified, truth, plane, at.crossover_radps)
    in_sds = [
        _in_sds(estimate.value - true_numbers[number], estimate.sd)
        for number in NUMBERS
        for estimate in [getattr(model.planes[plane], number)]
    ]
    in_sds += [_in_sds(gain_db, at.gain_sd_db), _in_sds(phase_deg, at.phase_sd_deg)]
    return PlaneErrors(name, plane, tuple(in_sds), gain_db, phase_deg)


def _in_sds(error: float, sd: float | None) -> float:
    """Return an error over its standard deviation; NaN if this is unknown."""
    return error / sd if sd else math.nan


def table(errors: Sequence[PlaneErrors]) -> Table:
    """Return one row per vehicle, and one of all.

    Parameters
    ----------
    errors : sequence of PlaneErrors
        Errors of both planes of each campaign.

    Returns
    -------
    Table
        Shares of numbers inside, and rms errors of gain and phase by plane.
    """
    labels = [re.sub(r"_per_s2?$", "", number).replace("_", " ") for number in NUMBERS]
    shares = [f"{label}, %" for label in (*labels, "gain", "phase", "all")]
    rms_heads = ("gain: yaw, pitch, dB", "phase: yaw, pitch, deg")
    result = Table("vehicle", "campaigns", *shares, *rms_heads, box=box.SIMPLE_HEAD)
    for name in [*dict.fromkeys(each.vehicle for each in errors), ""]:
        own = [each for each in errors if name in ("", each.vehicle)]
        in_sds = np.array([each.numbers for each in own])
        inside = np.where(np.isnan(in_sds), np.nan, np.abs(in_sds) <= QUANTILE)
        rms = [
            [
                math.sqrt(np.mean([getattr(e, field) ** 2 for e in own if e.plane == plane]))
                for plane in Plane
            ]
            for field in ("gain_db", "phase_deg")
        ]
        result.add_row(
            name or "all",
            str(len(own) // len(Plane)),
            *(
                f"{100.0 * share:.0f}"
                for share in [*np.nanmean(inside, axis=0), np.nanmean(inside)]
            ),
            *(f"{yaw:.2f}, {pitch:.2f}" for yaw, pitch in rms),
        )
    return result


def main() -> None:
    """Print the table of the campaigns in a folder."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.campaigns.accuracy",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--keep", type=Path, default=KEEP, help=f"folder; default {KEEP}")
    folders = sorted(path for path in parser.parse_args().keep.iterdir() if path.is_dir())
    Console(width=WIDTH).print(table([error for folder in folders for error in errors_of(folder)]))


if __name__ == "__main__":
    main()
