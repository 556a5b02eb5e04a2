"""Cell: run time of linear fits of ten 60 s runs, compared with common practice."""

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.identification import baseline, linear_truth
from benchmarks.identification.linear_truth import Campaign
from benchmarks.study import Cell, Figure
from sysid.data.runs import RATE_HZ
from sysid.estimation.linear import estimate
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.records import LinearRun
from sysid.estimation.linear.response import SurfaceCommand
from sysid.planes import Plane

Array = NDArray[np.float64]

RUN_S = 60.0


def trial(vehicle: str, seed: int) -> list[float]:
    """Return seconds of output error, filter error and baseline in yaw, with compiled code."""
    minutes = tuple(_a_minute(command) for command in linear_truth.commands(vehicle, Plane.YAW))
    campaign = linear_truth.campaign(vehicle, Plane.YAW, linear_truth.coloured, seed, minutes)
    start = campaign.belief.model.values

    def ours(method: estimate.Method) -> Callable[[Campaign], object]:
        return lambda c: estimate.descend(c.records, c.belief, method, start)

    return [
        _seconds(ours("output-error"), campaign),
        _seconds(ours("filter-error"), campaign),
        _baseline_seconds(campaign),
    ]


def _a_minute(command: SurfaceCommand) -> SurfaceCommand:
    """Extend or cut a command to RUN_S."""
    samples = int(RUN_S * RATE_HZ) + 1
    padded = np.pad(command.angle_rad, (0, max(0, samples - command.angle_rad.size)))
    return SurfaceCommand(padded[:samples])


def _seconds(work: Callable[[Campaign], object], campaign: Campaign) -> float:
    """Return the run time, measured in a second call."""
    work(campaign)
    begun_s = time.perf_counter()
    work(campaign)
    return time.perf_counter() - begun_s


def _baseline_seconds(campaign: Campaign) -> float:
    """Return the run time of the baseline with `lsim`: that of one simulation times their number.

    The number is that of the compiled simulator, which returns the same outputs: on a vehicle whose
    estimate wanders along its bounds, lsim would take minutes.
    """
    simulations = 0

    def count(model: LinearModel, record: LinearRun) -> Array:
        """Simulate a run, and count it."""
        nonlocal simulations
        simulations += 1
        return baseline.simulate_compiled(model, record)

    baseline.estimate(campaign.records, campaign.belief, count)
    model, record = campaign.belief.model, campaign.records[0]
    return simulations * _seconds(lambda _: baseline.simulate_lsim(model, record), campaign)


def judge(vehicle: str, rows: Array) -> Sequence[Figure]:
    """Return the median times."""
    output, filtered, common = np.median(rows, axis=0)
    return [
        Figure("output error, 10 runs of 60 s", float(output), highest=0.1, unit="s"),
        Figure("filter error, 10 runs of 60 s", float(filtered), highest=2.0, unit="s"),
        Figure("baseline, 10 runs of 60 s", float(common), unit="s"),
        Figure("baseline's time over output error's", float(common / output)),
        Figure("baseline's time over filter error's", float(common / filtered)),
    ]


TIME = Cell("linear-time", "seconds of a linear fit", trial, judge, runs=5)
