"""Interface to identification and design in sysid, for the commands and the campaign."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError

from ground.campaign import prototype
from mavlink_io.errors import InputError, OperationError
from mavlink_io.mission_items import MissionItem
from mavlink_io.vehicle_modes import VehicleMode
from sysid import monitor, prior_knowledge
from sysid import refit as fitting
from sysid.data import readers
from sysid.data.dataset import Log
from sysid.data.events import ModeChanged
from sysid.data.readers.servo_channels import FROM_LOG, OutputOptions
from sysid.data.segments import MarkedInterval
from sysid.design import lqg, pid
from sysid.design.lqg import LqgDesign
from sysid.design.pid import Design, Spec
from sysid.models import model_export, model_file, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.monitor import MonitorReport, tracking_metrics
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.tracking_metrics import TrackingMetrics
from sysid.monte_carlo import gain_selection
from sysid.monte_carlo.gain_selection import GainSelection, SelectionRequest
from sysid.planes import PLANE_OF_SURFACE
from sysid.refit import RefitRequest
from sysid.reproduction import paper_tables
from sysid.screening import proposals

TRIM_WINDOW_S = 60.0
"""Time before surfacing over which the surface commands of the trim mission are averaged, s."""
_NUMBER = r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?"
"""A decimal number."""


def initial_gains() -> dict[str, float]:
    """Return the prototype gains: the initial column of the paper's Table 3."""
    return dict(paper_tables.TABLE_3_INITIAL)


def improved_gains() -> dict[str, float]:
    """Return the improved column of the paper's Table 3."""
    return dict(paper_tables.TABLE_3_IMPROVED)


def measure_trims(path: Path, window_s: float = TRIM_WINDOW_S) -> dict[str, float]:
    """Return the trim parameters: mean surface commands at the end of a straight, level mission.

    Parameters
    ----------
    path : Path
        Log of the mission.
    window_s : float
        Time before surfacing over which the commands are averaged, s.

    Returns
    -------
    dict
        TRIM_RUD_DEG and TRIM_ELE_DEG, deg.

    Raises
    ------
    InputError
        The log cannot be read.
    OperationError
        The mission did not end with surfacing, the log has no commands before it, or a trim is at
        or beyond the travel.
    """
    log = read_log(path)
    surfacing = ModeChanged(VehicleMode.SURFACE)
    ends = [event.time_s for event in log.events if event.value == surfacing]
    if not ends:
        raise OperationError(f"{path}: the mission did not end with the vehicle surfacing")
    time_s = log.actuators.time_s
    window = (time_s > ends[0] - window_s) & (time_s <= ends[0])
    if not window.any():
        raise OperationError(
            f"{path}: has no commands in the last {window_s:g} s before the vehicle surfaced"
        )
    trims = {
        "TRIM_RUD_DEG": float(np.degrees(np.mean(log.actuators.rudder_rad[window]))),
        "TRIM_ELE_DEG": float(np.degrees(np.mean(log.actuators.elevator_rad[window]))),
    }
    travel_deg = float(np.degrees(log.actuators.travel_rad))
    for name, value in trims.items():
        if not abs(value) < travel_deg:
            raise OperationError(
                f"{path}: {name} would be {value:.1f} deg, at or beyond the surface's travel of"
                f" {travel_deg:.3g} deg"
            )
    return {name: round(value, 3) for name, value in trims.items()}


def refit(
    request: RefitRequest,
    progress: Callable[[str, float], None] | None = None,
    *,
    force: bool = False,
) -> IdentifiedModel:
    """Identify a model from the tests in logs.

    Parameters
    ----------
    request : RefitRequest
        Logs, prior and methods.
    progress : Callable, optional
        Called with a text and the completed fraction.
    force : bool
        Return the model even if the fit failed; the model records the failure.

    Returns
    -------
    IdentifiedModel
        The model.

    Raises
    ------
    InputError
        A log, the prior or a bench result cannot be used.
    OperationError
        The fit failed.
    """
    with _singular_model_reported():
        model = fitting.refit(request, progress)
    if not force:
        check_converged(model, "`ground refit --force` writes it all the same")
    return model


def refit_logs(
    request: RefitRequest, logs: Sequence[Log], held_out_logs: Sequence[Log], *, force: bool = False
) -> IdentifiedModel:
    """Identify a model as `refit` does, from logs that have been read.

    Parameters
    ----------
    request : RefitRequest
        Paths of the logs, prior and methods.
    logs, held_out_logs : sequence of Log
        Content of the paths, in the same order.
    force : bool
        Return the model even if the fit failed; the model records the failure.

    Raises
    ------
    InputError
        A log, the prior or a bench result cannot be used.
    OperationError
        The fit failed.
    """
    with _singular_model_reported():
        model = fitting.refit_logs(request, logs, held_out_logs)
    if not force:
        check_converged(model, "`ground refit --force` writes it all the same")
    return model


def check_converged(model: IdentifiedModel, remedy: str) -> None:
    """Raise OperationError, which ends with `remedy`, if the fit failed."""
    if model.convergence.failures:
        reasons = "; ".join(model.convergence.failures)
        raise OperationError(f"the fit failed: {reasons}; {remedy}")


def parse_segment(text: str) -> MarkedInterval:
    """Parse a test that a user marks, in seconds of the log's time. Raises InputError."""
    match = re.fullmatch(rf"(?:(.+):)?({_NUMBER})\.\.({_NUMBER}):(rudder|elevator)", text)
    if match is None:
        raise InputError(
            f"--segment {text}: give [LOG:]START..STOP:rudder or :elevator, in seconds of the log's"
            " time"
        )
    start_s, stop_s = float(match[2]), float(match[3])
    if not start_s < stop_s:
        raise InputError(
            f"--segment {text}: the start, {start_s:g} s, must be before the stop, {stop_s:g} s"
        )
    return MarkedInterval(
        start_s=start_s,
        stop_s=stop_s,
        plane=PLANE_OF_SURFACE[match[4]],
        log=match[1] or "",
    )


def propose_segments(path: Path, options: OutputOptions = FROM_LOG) -> list[MarkedInterval]:
    """Return the segments of a log that can be used as tests. Raises InputError."""
    return proposals.propose(readers.read(path, options))


def format_segments(marks: list[MarkedInterval]) -> str:
    """Return segments as text, each as ``--segment`` takes it."""
    return proposals.format_marks(marks)


def redesign(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: str | None = None,
    *,
    force: bool = False,
) -> Design:
    """Design PID gains for a model.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    spec : Spec, optional
        Limits that the gains must meet. The default is `specification`.
    prior : str, optional
        Vehicle file of the refit; by default the one in the model.
    force : bool
        Design even if the model is assessed as unfit for redesign.

    Returns
    -------
    Design
        Gains with reasons and predicted performance.

    Raises
    ------
    InputError
        The vehicle file cannot be used.
    OperationError
        The model is not fit for redesign, or no gains meet the specification.
    """
    _check_fit_for_redesign(model, "redesign", force)
    with _singular_model_reported():
        spec, vehicle = spec or specification(model, prior), read_vehicle(prior)
        return pid.redesign(model, spec, vehicle, _initial_gains_of(model, prior))


def redesign_for_campaign(
    model: IdentifiedModel,
    prior: str,
    first: Mapping[str, float],
    items: tuple[MissionItem, ...],
    settling_s: float,
) -> tuple[Design, GainSelection]:
    """Design PID gains for a model, and compare them with the first gains in simulation.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    prior : str
        Vehicle file from which it was fitted.
    first : Mapping
        Parameters of the first dives, without trims.
    items : tuple of MissionItem
        Mission that is rehearsed.
    settling_s : float
        Time (s) after a change of set-point from which on its errors count.

    Returns
    -------
    design : Design
        Gains; `spec` is the specification that they meet.
    selection : GainSelection
        Comparison with the first gains.

    Raises
    ------
    InputError
        The vehicle file cannot be used.
    OperationError
        The model is not fit for redesign, or no gains meet the last specification.
    """
    _check_fit_for_redesign(model, "redesign", force=False)
    with _singular_model_reported():
        request = SelectionRequest(
            model, specification(model, prior), read_vehicle(prior), first, items, settling_s
        )
        return gain_selection.select(request)


def redesign_lqg(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: str | None = None,
    *,
    force: bool = False,
) -> LqgDesign:
    """Design an LQG controller for a model. Parameters and errors as for `redesign`."""
    _check_fit_for_redesign(model, "redesign --method lqg", force)
    with _singular_model_reported():
        return lqg.design_lqg(model, spec, read_vehicle(prior), _initial_gains_of(model, prior))


def _check_fit_for_redesign(model: IdentifiedModel, command: str, force: bool) -> None:
    """Raise OperationError if the model is not fit for redesign, unless `force`."""
    if not force and (model.assessment is None or not model.assessment.fit_for_redesign):
        obstacle = model.assessment.obstacle if model.assessment else ""
        remedy = f"no test can make it fit: {obstacle}" if obstacle else "fly the proposed test"
        advice = f"{remedy}, or use `ground {command} --force`"
        raise OperationError(f"the model is not fit for redesign: {_reasons(model)}; {advice}")


def specification(model: IdentifiedModel, prior: str | None = None) -> Spec:
    """Return the default specification, with travel and rate limit of the vehicle's tailcone.

    Raises InputError if the vehicle file cannot be used.
    """
    tail = _vehicle_of(model, prior).tailcone
    return Spec(travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)


def _vehicle_of(model: IdentifiedModel, prior: str | None) -> Any:
    """Return the vehicle file of a model, or the given one."""
    return prediction.prior_vehicle(model, read_vehicle(prior))


def _initial_gains_of(model: IdentifiedModel, prior: str | None) -> dict[str, float]:
    """Return the gains of the first dive: Table 3 for Caribou, else a prototype design."""
    vehicle, table_3 = _vehicle_of(model, prior), initial_gains()
    if prototype.is_caribou(vehicle):
        return table_3
    first = prototype.design(vehicle).parameters
    return {name: first[name] for name in table_3}


def _reasons(model: IdentifiedModel) -> str:
    """Return why a model is not fit for redesign."""
    if model.assessment is None:
        return "it has no assessment"
    first, *others = model.assessment.reasons or ("its assessment gives no reason",)
    return f"{first} (and {len(others)} more)" if others else first


def read_log(path: Path) -> Log:
    """Read a log for identification. Raises InputError."""
    return readers.read(path)


def tracking(log: Log, settling_s: float) -> TrackingMetrics:
    """Return tracking errors of a dive and of each steady window after the settling time.

    Raises OperationError if no window with constant set-points is long enough.
    """
    result = tracking_metrics.tracking(log, settling_s)
    if result is None:
        raise OperationError(
            f"{log.name}: no interval of constant set-points is longer than the settling time"
        )
    return result


def monitor_log(log: Log, baseline: PerformanceBaseline) -> MonitorReport:
    """Compare a dive with the performance predicted for its gains."""
    return monitor.monitor_log(log, baseline)


def read_model(path: Path) -> IdentifiedModel:
    """Read a model file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    IdentifiedModel
        Its content.

    Raises
    ------
    InputError
        The file is missing, is no model, or contradicts itself.
    """
    model = model_file.read(path)
    with _singular_model_reported():
        if edited := model_export.edited_number(model):
            raise InputError(f"{path}: {edited}")
    return model


def read_vehicle(prior: str | None) -> Any:
    """Read a vehicle file, or the vehicle of a model, for sysid.

    Parameters
    ----------
    prior : str, optional
        Name of a shipped vehicle, a vehicle file, or a ``model.json``.

    Returns
    -------
    VehicleConfig or None
        The vehicle; None if none is named.

    Raises
    ------
    InputError
        The file is missing or invalid.
    """
    return prior_knowledge.vehicle_file(prior) if prior else None


def write_model(model: IdentifiedModel, path: Path) -> None:
    """Write a model file.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    path : Path
        File to write; an existing one is overwritten.
    """
    model_file.write(model, path)


@contextmanager
def _singular_model_reported() -> Iterator[None]:
    """Raise OperationError for a matrix of the model that cannot be inverted."""
    try:
        yield
    except LinAlgError as error:
        raise OperationError(f"the model is singular: {error}; fly more tests and refit") from None
