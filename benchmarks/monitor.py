"""Monitor study: rate of false alarms, detection delay, and correctness of the reported cause.

    python -m benchmarks.monitor GAINS.param [--case NAME ...] [--runs N] [--out FILE.json]

Straight runs of Caribou in the disturbed sea with gains of `ground redesign`. Faults start at
``FROM_S``. Each figure is printed with its target.
"""

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
"""Additional delay of the duct in the case "late duct"."""


def dive(case: str, values: dict[str, float], seed: int) -> Dive:
    """Simulate a straight run of a case."""
    vehicle = config.load(campaign.VEHICLE)
    if case == "late duct":
        tailcone = msgspec.structs.replace(
            vehicle.tailcone, delay_s=vehicle.tailcone.delay_s + LATER_S
        )
        vehicle = msgspec.structs.replace(vehicle, tailcone=tailcone)
    items = leg(depth_m=DEPTH_M, heading_deg=0.0, duration_s=LASTS_S)
    return Dive(items, vehicle=vehicle, sea=_sea(case), seed=seed, values={**values, **TRIM})


def telemetry_log(flown: Dive) -> Log:
    """Return the telemetry of a dive with set-points, until the vehicle surfaces."""
    log, t = campaign.log(flown, "dive", {}), flown["t_s"][flown["t_s"] < LASTS_S]
    points = Setpoints(t, np.zeros_like(t), np.zeros_like(t), t, np.full_like(t, DEPTH_M))
    return dataclasses.replace(log, setpoints=points)


def trial(
    promise: PerformanceBaseline, values: dict[str, float], case: str, seed: int
) -> list[float]:
    """Return steady time (h), time to the alarm (s or NaN), and whether its cause is right."""
    kept = monitor.monitor_log(telemetry_log(dive(case, values, seed)), promise)
    after_s = (
        math.nan
        if kept.detected_at_s is None
        else kept.detected_at_s - (FROM_S if case in FAULTS else 0.0)
    )
    return [
        kept.steady_s / 3600.0,
        after_s,
        float([cause.name for cause in kept.causes] == [CAUSES.get(case)]),
    ]


def judge(case: str, rows: Array) -> list[Figure]:
    """Return the figures of a case from one row of ``trial`` per run."""
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
        # The cause of the late duct has no target: it is shown for information.
        Figure(
            "cause named", float(np.mean(right)), lowest=-math.inf if case == "late duct" else 0.9
        ),
    ]


def main() -> None:
    """Run the monitor on simulated dives; exit with status 1 if a figure misses its target."""
    asked = _arguments()
    promise, values = param_file.read_baseline(asked.gains), param_file.load(asked.gains)
    if promise is None:
        sys.exit(f"{asked.gains}: no predictions; pass a file written by `ground redesign`")
    cell = Cell("monitor", "straight runs", partial(trial, promise, values), judge, 20)
    sys.exit(
        study.exit_status(study.run_cells([(cell, case) for case in asked.case or CASES], asked))
    )


def _sea(case: str) -> Scenario:
    """Return the scenario of a case."""
    if case == "rough":
        return steady.sea("rough")
    rows = ({**FAULTS[case], "at_s": FROM_S},) if case in FAULTS else ()
    return msgspec.structs.replace(scenario.load(campaign.SEA), fault=rows)


def _arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = study.parser(__doc__, "dives per case; default 20")
    parser.add_argument("gains", type=Path, help="gains.param of a redesign of Caribou")
    parser.add_argument("--case", action="append", choices=CASES)
    return parser.parse_args()


if __name__ == "__main__":
    main()
