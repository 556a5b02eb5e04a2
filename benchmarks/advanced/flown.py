"""Cells: dives of both controllers with the same seeds: straight runs, other vehicles, swells."""

from functools import partial

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.advanced.designed import Contender, Contenders
from benchmarks.redesign import holding, robust
from benchmarks.redesign.campaign import VEHICLE
from benchmarks.redesign.holding import MISSION, STEADY_S
from benchmarks.study import Cell, Figure
from ground.missions import script
from sitl import scenario
from sitl.scenario import Scenario
from sitl.vehicle.config import VehicleConfig
from tests.helpers.closed_loop import Dive

Array = NDArray[np.float64]

SWELLS_HZ = {"slow swell": 0.10, "quick swell": 0.22}
"""Wave frequencies; the model was identified, and the LQG filter designed, at 0.15 Hz."""
CASES = ("disturbed", "calm", *SWELLS_HZ, "astray")
WHAT = (
    "heading, 95 %",
    "depth, 95 %",
    "pitch about trim, 95 %",
    "lost",
    "rudder, rms",
    "elevator, rms",
)
UNITS = ("deg", "cm", "deg", "", "deg", "deg")


def trial(contenders: Contenders, case: str, seed: int) -> list[float]:
    """Return ``TrackingError``, and rms of rudder and elevator (deg), of each controller."""
    vehicle = robust.draw(VEHICLE, seed).vehicle if case == "astray" else VEHICLE
    row = []
    for contender in contenders.values():
        dive = fly(contender, sea(case), seed, vehicle)
        row += [*holding.tracking_error(dive), *effort_deg(dive)]
    return row


def sea(case: str) -> Scenario:
    """Return the sea of a case; the case "astray" has the disturbed sea."""
    if case == "calm":
        return scenario.load("calm")
    found = scenario.load("disturbed")
    if case not in SWELLS_HZ:
        return found
    waves = msgspec.structs.replace(found.disturbance.waves, frequency_hz=SWELLS_HZ[case])
    return msgspec.structs.replace(
        found, disturbance=msgspec.structs.replace(found.disturbance, waves=waves)
    )


def fly(contender: Contender, water: Scenario, seed: int, vehicle: str | VehicleConfig) -> Dive:
    """Simulate a straight run."""
    items = script.compile_items(script.load(MISSION))
    return Dive(
        items,
        vehicle=vehicle,
        sea=water,
        seed=seed,
        values=contender.values,
        controllers=contender.controllers,
    )


def effort_deg(dive: Dive) -> tuple[float, float]:
    """Return the standard deviations of rudder and elevator in steady flight."""
    end_s = min(dive.surfacing_s, dive["t_s"][-1])
    window = dive.during(STEADY_S, end_s)
    return float(np.degrees(np.std(dive["rudder"][window]))), float(
        np.degrees(np.std(dive["elevator"][window]))
    )


def judge(names: tuple[str, ...], case: str, rows: Array) -> list[Figure]:
    """Return mean and worst values of each controller, and the ratio of their means."""
    by_name = rows.reshape(len(rows), len(names), len(WHAT))
    figures = []
    for column, (what, unit) in enumerate(zip(WHAT, UNITS, strict=True)):
        means = np.nanmean(by_name[:, :, column], axis=0)
        if what == "lost":
            figures += [
                Figure(f"{name}: {what}", 100.0 * mean, unit="%")
                for name, mean in zip(names, means, strict=True)
            ]
            continue
        worst = np.nanmax(by_name[:, :, column], axis=0)
        for name, mean, most in zip(names, means, worst, strict=True):
            figures += [
                Figure(f"{name}: {what}", float(mean), unit=unit),
                Figure(f"{name}: {what}, worst dive", float(most), unit=unit),
            ]
        figures.append(Figure(f"{names[1]} over {names[0]}: {what}", float(means[1] / means[0])))
    return figures


def cell(contenders: Contenders) -> Cell:
    """Return the cell of this study."""
    return Cell(
        "advanced",
        "PID and LQG on the same seeds",
        partial(trial, contenders),
        partial(judge, tuple(contenders)),
        20,
    )
