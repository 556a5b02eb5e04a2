"""Zig-zag tests of the KVLCC2 tanker (SIMMAN, HSVA): held-out error of linear yaw models.

The files are written as CSV logs, in which tests of TEST_S follow each other with LEAD_S between,
and read like any log of this project. Each model is fitted to the tests of every second file and
simulates those of the others from the measured rudder. The tanker is unstable on course, so that no
model can be simulated from rest for a whole file: the initial state of each test is free for all
models, and eliminated by least squares.

    error = mean of (r_measured - r_simulated)^2, (deg/s)^2 at model scale

A second-order Nomoto model is r / delta = K (1 + T3 s) / ((1 + T1 s) (1 + T2 s)) (Nomoto et al.
1957; Fossen 2021, section 6.4), fitted here to the rates by least squares. It has the structure of
this project's yaw plane; the methods differ in what they minimise. Prior of the linear estimators,
and start of the Nomoto fit, is the Mariner's Nomoto model (Chislett and Stroem-Tejsen 1965) in the
ship's time L / U, with 100 % standard deviations.
"""

import importlib
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import cont2discrete

from sysid.data import readers, segments
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.linear import estimate as linear
from sysid.estimation.linear import linear_model, records
from sysid.estimation.linear.linear_model import LinearModel, LinearModelStructure
from sysid.estimation.linear.records import LinearPrior
from sysid.planes import Plane

Array = NDArray[np.float64]

SKIPPED_LINES = 4
"""Lines of text at the start of an HSVA file."""
TIME, HEADING, SURGE, SWAY, YAW_RATE, RUDDER = 0, 3, 4, 5, 6, 8
"""Columns of an HSVA file: s, deg, m/s, m/s, deg/s, deg."""
LENGTH_M = 7.0
"""Length of HSVA's model."""
TEST_S, LEAD_S = 24.0, 4.0
"""Duration of a test, and time before it."""
STRIDE = 5
"""Samples of the grid per step of the simulated models: 0.1 s."""
MARINER = (3.86, 5.6, 0.37, 0.88)
"""K, T1, T2 and T3 of the Mariner, made dimensionless with U / L."""
SURFACE_RADPS, SURFACE_DAMPING = 20.0, 0.9
"""Lag between the measured rudder and the rudder: none, so a fast one."""
DELAY_SD_S, BIAS_SD_RAD = 0.1, math.radians(2.0)
SUBSPACE_ROWS = 20
"""Block rows of the subspace method."""
SUBSPACE_STEP = 25
"""Samples of the grid per step of the subspace method: 0.5 s."""
ORDERS = (2, 3, 4)
"""Orders of the subspace method; the one with the smallest error in the fitted tests is used."""


class StateSpace(NamedTuple):
    """Discrete model from rudder (rad) to rate (rad/s), with a constant rudder offset."""

    a: Array
    b: Array
    c: Array
    d: float
    stride: int
    """Samples of the grid per step."""
    offset_rad: float = 0.0


class ModelError(NamedTuple):
    """Errors of one model, (deg/s)^2."""

    name: str
    fitted: float
    held_out: float
    note: str = ""


def read_tests(folder: Path, out: Path) -> list[list[Run]]:
    """Write HSVA's files as CSV logs and read them.

    Parameters
    ----------
    folder : Path
        Folder with HSVA_CPMC_KVLCC2_Z_*.dat.
    out : Path
        Folder of the CSV files.

    Returns
    -------
    list of list of Run
        Tests by file, in the order of the names.
    """
    files = []
    for path in sorted(folder.glob("HSVA_CPMC_KVLCC2_Z_*.dat")):
        table = np.loadtxt(path, skiprows=SKIPPED_LINES, encoding="latin-1")
        csv = out / f"{path.stem}.csv"
        csv.write_text(_as_csv(table), encoding="utf-8")
        runs = segments.cut_runs(readers.read(csv))
        files.append([run for run in runs if run.time_s[-1] > 0.9 * TEST_S])
    return files


def _as_csv(table: Array) -> str:
    """Return a CSV log; a positive rudder of this project turns to starboard, HSVA's to port."""
    lines = [
        "# ACT_TRAVEL_DEG = 35",
        "time_s,heading_deg,r_degps,rudder_deg,thrust_pct,u_mps,v_mps,test",
    ]
    for row in table:
        phase_s = (row[TIME] - table[0, TIME]) % (LEAD_S + TEST_S)
        values = (row[TIME], row[HEADING], row[YAW_RATE], -row[RUDDER], 50.0, row[SURGE], row[SWAY])
        test = "rudder" if phase_s >= LEAD_S else ""
        lines.append(",".join(f"{value:.6f}" for value in values) + f",{test}")
    return "\n".join(lines) + "\n"


def compare(files: Sequence[Sequence[Run]]) -> list[ModelError]:
    """Return the errors of every model; every second file is held out.

    Parameters
    ----------
    files : sequence of sequence of Run
        Tests by file.

    Returns
    -------
    list of ModelError
        Nomoto model first.
    """
    fitted, held_out = (
        [run for file in half for run in file] for half in (files[::2], files[1::2])
    )
    models: dict[str, Callable[[Sequence[Run]], StateSpace]] = {
        "Nomoto, second order": nomoto,
        "output error": lambda runs: linear_estimate(runs, "output-error"),
        "filter error": lambda runs: linear_estimate(runs, "filter-error"),
        "nfoursid": subspace,
    }
    results = []
    for name, fit in models.items():
        try:
            model = fit(fitted)
        except ImportError as error:
            results.append(ModelError(name, math.nan, math.nan, f"not installed: {error}"))
            continue
        results.append(ModelError(name, _error(model, fitted), _error(model, held_out)))
    return results


def _error(model: StateSpace, runs: Sequence[Run]) -> float:
    """Return the mean over the tests of the mean squared error, (deg/s)^2."""
    return float(np.mean([np.mean(np.degrees(_residuals(model, run)) ** 2) for run in runs]))


def _residuals(model: StateSpace, run: Run) -> Array:
    """Return measured minus simulated rate of a test, for the best initial state (rad/s)."""
    test = run.since(0.0)
    rudder, rate = (
        values[:: model.stride] for values in (test.command_rad + model.offset_rad, test.rate_radps)
    )
    state, free = np.zeros(len(model.a)), np.eye(len(model.a))
    forced, free_rows = np.zeros(rate.size), np.zeros((rate.size, len(model.a)))
    for k in range(rate.size):
        forced[k], free_rows[k] = model.c @ state + model.d * rudder[k], model.c @ free
        state, free = model.a @ state + model.b * rudder[k], model.a @ free
    error = rate - forced
    return error - free_rows @ np.linalg.lstsq(free_rows, error, rcond=None)[0]


def _second_order(numbers: Array, delay_s: float = 0.0) -> StateSpace:
    """Return (b1 s + b0) / (s^2 + a1 s + a0) with a rudder offset, sampled with held input."""
    b1, b0, a1, a0, offset_rad = numbers.tolist()
    step_s = STRIDE / RATE_HZ
    a, b, c, d, _ = cont2discrete(
        (
            np.array([[0.0, -a0], [1.0, -a1]]),
            np.array([[b0], [b1]]),
            np.array([[0.0, 1.0]]),
            np.zeros((1, 1)),
        ),
        step_s,
    )
    for _ in range(round(delay_s / step_s)):
        a = np.block([[a, b], [np.zeros((1, len(a) + 1))]])
        b = np.eye(len(a))[:, -1:]
        c = np.append(c, [[0.0]], axis=1)
    return StateSpace(a, b[:, 0], c[0], float(d[0, 0]), STRIDE, offset_rad)


def nomoto(runs: Sequence[Run]) -> StateSpace:
    """Fit a Nomoto model by least squares of the simulated rate, from the Mariner's values.

    Parameters
    ----------
    runs : sequence of Run
        Tests.

    Returns
    -------
    StateSpace
        Model.
    """
    start = np.append(_mariner(_speed_mps(runs)), 0.0)
    scale = np.append(start[:4], BIAS_SD_RAD)

    def residuals(ratios: Array) -> Array:
        """Return the errors of all tests in deg/s."""
        model = _second_order(ratios * scale)
        return np.concatenate([np.degrees(_residuals(model, run)) for run in runs])

    return _second_order(least_squares(residuals, start / scale).x * scale)


def _speed_mps(runs: Sequence[Run]) -> float:
    """Return the mean speed at the start of the tests."""
    return float(np.mean([run.forward_mps[0] for run in runs]))


def _mariner(speed_mps: float) -> Array:
    """Return b1, b0, a1, a0 of the Mariner in the time of this ship."""
    rate = speed_mps / LENGTH_M
    gain, t1, t2, t3 = MARINER[0] * rate, *(value / rate for value in MARINER[1:])
    return np.array([gain * t3, gain, t1 + t2, 1.0]) / (t1 * t2)


def linear_estimate(runs: Sequence[Run], method: linear.Method) -> StateSpace:
    """Fit this project's linear yaw plane.

    Parameters
    ----------
    runs : sequence of Run
        Tests.
    method : str
        "output-error" or "filter-error".

    Returns
    -------
    StateSpace
        Model.
    """
    used = [records.linear_run(run, LEAD_S) for run in runs]
    values = linear.estimate(used, _prior(runs), method).model.values
    names = linear_model.names(Plane.YAW)
    bias_rad, delay_s = (values[names.index(name)] for name in ("bias_rad", "delay_s"))
    return _second_order(np.append(values[:4], bias_rad), float(delay_s))


def _prior(runs: Sequence[Run]) -> LinearPrior:
    """Return the Mariner's yaw plane with wide standard deviations."""
    numbers = _mariner(_speed_mps(runs))
    values = np.array([*numbers, 0.0, 0.0, SURFACE_RADPS, SURFACE_DAMPING])
    structure = LinearModelStructure(
        plane=Plane.YAW,
        speed_mps=_speed_mps(runs),
        sway=(-_speed_mps(runs) / LENGTH_M, -0.3 * _speed_mps(runs)),
        travel_rad=math.radians(35.0),
        rate_radps=math.radians(90.0),
    )
    lag_sd = structure.lag_relative_sd * values[linear_model.lag(Plane.YAW)]
    spread = np.array([*numbers, DELAY_SD_S, BIAS_SD_RAD, *lag_sd])
    return records.with_bounds(LinearModel(structure, values), np.diag(spread**2))


def subspace(runs: Sequence[Run]) -> StateSpace:
    """Fit nfoursid's state space to the tests one after the other.

    Parameters
    ----------
    runs : sequence of Run
        Tests.

    Returns
    -------
    StateSpace
        Model of the order with the smallest error.

    Raises
    ------
    ImportError
        The packages nfoursid and pandas are missing.
    """
    pandas = importlib.import_module("pandas")
    nfoursid = importlib.import_module("nfoursid.nfoursid")
    signals = {
        "rudder": np.concatenate([run.command_rad[::SUBSPACE_STEP] for run in runs]),
        "rate": np.concatenate([run.rate_radps[::SUBSPACE_STEP] for run in runs]),
    }
    method = nfoursid.NFourSID(
        pandas.DataFrame(signals),
        output_columns=["rate"],
        input_columns=["rudder"],
        num_block_rows=SUBSPACE_ROWS,
    )
    method.subspace_identification()
    models = []
    for order in ORDERS:
        a, b, c, d = (
            np.asarray(getattr(method.system_identification(rank=order)[0], name))
            for name in "abcd"
        )
        models.append(StateSpace(a, b[:, 0], c[0], float(d[0, 0]), SUBSPACE_STEP))
    return min(models, key=lambda model: _error(model, runs))
