"""How seldom the monitor raises a false alarm, how soon it notices what has changed, and what it
takes it for.

    python -m benchmarks.monitor GAINS.param [--case NAME ...] [--runs N] [--out FILE.json]

Straight runs of Caribou in the disturbed sea under gains that `ground redesign` wrote; what goes
wrong does so after ``FROM_S``. Each figure is printed beside its target."""

import argparse
import dataclasses
import math
import sys
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks import study
from benchmarks.redesign import campaign, steady
from benchmarks.study import Cell, Figure
from ground.client import param_file
from sitl import scenario
from sitl.scenario import Scenario
from sitl.vehicle import config
from sysid import monitor
from sysid.data.dataset import Log, Setpoints
from sysid.monitor.performance_spec import PerformanceBaseline
from tests.helpers.closed_loop import Dive
from tests.helpers.missions import leg

Array = NDArray[np.float64]

FROM_S, LASTS_S, DEPTH_M = 200.0, 520.0, 5.0
TRIM = {"TRIM_RUD_DEG": 6.0, "TRIM_ELE_DEG": 0.4}
FAULTS: dict[str, dict[str, float | str]] = {
    "bent rudder": {"unit": "rudder", "kind": "biased", "angle_deg": 3.0},
    "bent elevator": {"unit": "elevator", "kind": "biased", "angle_deg": 3.0},
    "buoyancy": {"unit": "ballast", "kind": "added", "mass_kg": -0.79},
    "ballast forward": {"unit": "ballast", "kind": "shifted", "mass_kg": 4.0, "x_m": 0.5},
}
CAUSES = {
    "bent rudder": "rudder",
    "bent elevator": "elevator",
    "buoyancy": "ballast",
    "ballast forward": "ballast",
    "late duct": "heading loop",
    "rough": "sea",
}
CASES = ("matched", *CAUSES)
LATER_S = 0.7
"""Delay of the late duct over the vehicle's own."""


def dive(case: str, values: dict[str, float], seed: int) -> Dive:
    vehicle = config.load(campaign.VEHICLE)
    if case == "late duct":
        tailcone = msgspec.structs.replace(
            vehicle.tailcone, delay_s=vehicle.tailcone.delay_s + LATER_S
        )
        vehicle = msgspec.structs.replace(vehicle, tailcone=tailcone)
    items = leg(depth_m=DEPTH_M, heading_deg=0.0, duration_s=LASTS_S)
    return Dive(items, vehicle=vehicle, sea=_sea(case), seed=seed, values={**values, **TRIM})


def told(flown: Dive) -> Log:
    """What a dive's telemetry tells, set-points included, until she goes up."""
    log, t = campaign.log(flown, "dive", {}), flown["t_s"][flown["t_s"] < LASTS_S]
    points = Setpoints(t, np.zeros_like(t), np.zeros_like(t), t, np.full_like(t, DEPTH_M))
    return dataclasses.replace(log, setpoints=points)


def trial(
    promise: PerformanceBaseline, values: dict[str, float], case: str, seed: int
) -> list[float]:
    """(steady hours, seconds to the alarm or NaN, whether its cause is the right one)."""
    kept = monitor.monitor_log(told(dive(case, values, seed)), promise)
    after_s = (
        math.nan if kept.found_s is None else kept.found_s - (FROM_S if case in FAULTS else 0.0)
    )
    return [
        kept.steady_s / 3600.0,
        after_s,
        float([cause.name for cause in kept.causes] == [CAUSES.get(case)]),
    ]


def judge(case: str, rows: Array) -> list[Figure]:
    hours, after_s, right = rows.T
    noticed = after_s[np.isfinite(after_s)]
    if case == "matched":
        return [
            Figure("steady flight", float(hours.sum()), unit="h"),
            Figure("false alarms", float(noticed.size), highest=0.0),
        ]
    median_s, last_s = (
        float(np.quantile(after_s, q)) if noticed.size == len(rows) else math.inf
        for q in (0.5, 1.0)
    )
    return [
        Figure("noticed", noticed.size / len(rows), lowest=1.0),
        Figure("after, median", median_s, unit="s"),
        Figure("after, slowest", last_s, unit="s"),
        # How late a duct must be to swing by more than the sea allows is for the reader to see.
        Figure(
            "cause named", float(np.mean(right)), lowest=-math.inf if case == "late duct" else 0.9
        ),
    ]


def main() -> None:
    asked = _arguments()
    promise, values = param_file.read_baseline(asked.gains), param_file.load(asked.gains)
    if promise is None:
        sys.exit(f"{asked.gains}: promises nothing; give a file that `ground redesign` wrote")
    cell = Cell("monitor", "straight runs", partial(trial, promise, values), judge, 20)
    sys.exit(study.status(study.ask([(cell, case) for case in asked.case or CASES], asked)))


def _sea(case: str) -> Scenario:
    if case == "rough":
        return steady.sea("rough")
    rows = ({**FAULTS[case], "at_s": FROM_S},) if case in FAULTS else ()
    return msgspec.structs.replace(scenario.load(campaign.SEA), fault=rows)


def _arguments() -> argparse.Namespace:
    parser = study.parser(__doc__, "dives of each case; 20 unless told")
    parser.add_argument("gains", type=Path, help="gains.param of a redesign of Caribou")
    parser.add_argument("--case", action="append", choices=CASES)
    return parser.parse_args()


if __name__ == "__main__":
    main()
