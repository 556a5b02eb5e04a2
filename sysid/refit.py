"""Identification from logs: read, cut into tests, screen, fit and validate.

The result is deterministic: the same logs and package versions give the same bytes of
``model.json``.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from mavlink_io.errors import ErrorCode, InputError, OperationError
from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import SHIPPED as SHIPPED
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.config import VehicleFileError as VehicleFileError
from sysid.data import duplicates, readers, segments
from sysid.data.dataset import Log
from sysid.data.readers.servo_channels import OutputOptions, ServoChannels
from sysid.data.segments import MarkedInterval, Run
from sysid.estimation.linear import report as linear
from sysid.estimation.linear.multistart import NotUniqueError as NotUniqueError
from sysid.estimation.map import fit, intervals
from sysid.estimation.map.fit import Prior, Progress
from sysid.models import bench_priors, model_export, parameters, prediction
from sysid.models import model_file as models
from sysid.models.bench_priors import BenchMeasurement
from sysid.models.bench_priors import BenchResultError as BenchResultError
from sysid.models.model_file import (
    AlternativeFit,
    AnomalyTest,
    DataFile,
    IdentifiedModel,
    Method,
    ScreenedRun,
)
from sysid.models.parameters import NAMES
from sysid.reproduction import paper_method
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.screening import (
    RunScreening,
    Screening,
    ScreeningLimits,
    log_consistency,
    proposals,
    screen,
    wiring,
)
from sysid.screening.refit_loop import RefitResult, refit_until_clean, shifts
from sysid.validation.assess import with_assessment

Array = NDArray[np.float64]

FORBIDDEN_PRIOR = "caribou_truth"
"""Vehicle file of the simulated truth.

It is refused as a prior: no such file exists for a real vehicle.
"""
TRUTH_SUFFIX = "_truth"
"""End of the name of a simulated vehicle, whose file is refused as a prior."""


class RefitError(InputError):
    """The logs or the prior cannot be used; the message names the cause and the correction."""

    code = ErrorCode.REFIT_DATA


class FitFailedError(OperationError):
    """The fit has no result; the message names the prior, the reason and a remedy."""

    code = ErrorCode.FIT_FAILED


class PriorKnowledge(NamedTuple):
    """Knowledge of a vehicle before its tests: vehicle file, earlier model, bench measurements."""

    config: VehicleConfig
    name: str
    earlier: IdentifiedModel | None
    bench_measurements: tuple[BenchMeasurement, ...] = ()
    """Results of the bench test of the tailcone and of the inclining test."""


class RefitRequest(NamedTuple):
    """Request for a refit: what is fitted, with which prior and which methods."""

    paths: Sequence[str | Path]
    """Logs with rudder or elevator tests, in any format that `sysid.data.readers` reads."""
    held_out: Sequence[str | Path] = ()
    """Logs whose tests are predicted and not fitted."""
    prior: str | Path = "caribou_nominal"
    """Name of a shipped vehicle, path of a vehicle file, or path of a ``model.json`` of method
    ``map`` whose estimate becomes the prior."""
    method: Method = "map"
    """``map``: nonlinear maximum a posteriori estimate of both planes. ``output-error`` and
    ``filter-error``: linear planes, one by one (`sysid.estimation.linear`). ``paper``: least
    squares on the rate, linear, without prior."""
    alternative_methods: Sequence[Method] = ()
    """Further methods that are applied to the same runs, for comparison."""
    limits: ScreeningLimits | None = None
    """Limits of the screening rules; by default those of `ScreeningLimits`."""
    marks: Sequence[MarkedInterval] = ()
    """Time ranges (s) of tests that the logs do not mark."""
    outputs: ServoChannels | None = None
    """Output channels of rudder, elevator and thrust, counted from 1; negative if reversed. None:
    found in the parameters of the log, else 1, 2 and 3."""
    tailcone: Path | None = None
    """Output file of ``ground bench-test``, whose actuator parameters update the prior of method
    ``map``."""
    inclining: Path | None = None
    """Output file of ``ground inclining-test``, whose height of the centre of mass updates the
    prior of method ``map``."""


def refit(request: RefitRequest, progress: Progress | None = None) -> IdentifiedModel:
    """Identify a vehicle from logs with identification tests.

    Parameters
    ----------
    request : RefitRequest
        Logs, prior and methods.
    progress : callable, optional
        Called with the present step (text) and the completed share of the work, 0 to 1.

    Returns
    -------
    IdentifiedModel
        The content of ``model.json``, with screening results, validation and acceptance
        decision.

    Raises
    ------
    BenchResultError, LogError, VehicleFileError, ModelError, RefitError
        An input cannot be used.
    FitFailedError
        The tests do not determine a vehicle near the prior.

    Notes
    -----
    Method ``map`` minimises the negative log posterior (Jategaonkar 2015, ch. 4 and 5)::

        J(z) = 1/2 sum_k |e_k(z)|^2 + 1/2 (z - m)' P^-1 (z - m)

    with z the parameters in prior standard deviations, e_k the whitened residuals of rate, angle
    and depth, m and P the mean and covariance of the prior. Runs that the fit itself finds
    anomalous are left out, and the rest is fitted again (`sysid.screening.refit_loop`).
    """
    report = progress or (lambda what, share: None)
    knowledge = _knowledge(request)
    options = OutputOptions(request.outputs, knowledge.config.tailcone.travel_deg)
    for path in (*request.paths, *request.held_out):
        readers.format_of(Path(path))  # refuses a file that is no log before progress is shown
    logs = _read(request.paths, options, lambda share: report("read logs", 0.1 * share))
    held_out_logs = _read(request.held_out, options, lambda share: None)
    return _refit(request, knowledge, logs, held_out_logs, report)


def refit_logs(
    request: RefitRequest,
    logs: Sequence[Log],
    held_out_logs: Sequence[Log],
    progress: Progress | None = None,
) -> IdentifiedModel:
    """Identify a vehicle as `refit` does, from logs that have been read.

    Parameters
    ----------
    request : RefitRequest
        Prior, methods and paths of the logs; the files are not read again.
    logs, held_out_logs : sequence of Log
        Content of ``request.paths`` and ``request.held_out``, in the same order, as
        `sysid.data.readers` reads it with ``request.outputs``.
    progress : callable, optional
        As for `refit`.

    Returns
    -------
    IdentifiedModel
        The same as that of `refit`.

    Raises
    ------
    BenchResultError, VehicleFileError, ModelError, RefitError
        An input cannot be used.
    FitFailedError
        The tests do not determine a vehicle near the prior.
    """
    report = progress or (lambda what, share: None)
    return _refit(request, _knowledge(request), logs, held_out_logs, report)


def _knowledge(request: RefitRequest) -> PriorKnowledge:
    """Read the prior and the bench measurements of a request."""
    return prior_knowledge(request.prior)._replace(
        bench_measurements=bench_priors.read(request.tailcone, request.inclining)
    )


def _refit(
    request: RefitRequest,
    knowledge: PriorKnowledge,
    logs: Sequence[Log],
    held_out_logs: Sequence[Log],
    report: Progress,
) -> IdentifiedModel:
    """Identify a vehicle from logs."""
    _check_marks(request.marks, [log.name for log in (*logs, *held_out_logs)])
    _refuse_duplicates(request, logs, held_out_logs, knowledge)
    _refuse_miswired(request, [*logs, *held_out_logs])
    accepted_runs, screenings = _select(logs, request.limits, request.marks)
    held_out_screenings = screen(
        [
            run
            for log in held_out_logs
            for run in segments.cut_runs(log, _marks_of(log, request.marks))
        ],
        request.limits,
    )
    held_out_runs = [s.run for s in held_out_screenings if s.accepted]
    with _failing(knowledge.name):
        model, refitted = _identify(
            accepted_runs, knowledge, request.method, lambda w, s: report(w, 0.1 + 0.85 * s)
        )
    accepted_runs, tested_runs = (
        (list(refitted.accepted_runs), refitted.screenings) if refitted else (accepted_runs, {})
    )
    model = msgspec.structs.replace(
        model,
        data=tuple(DataFile(log.name, log.sha256) for log in logs),
        held_out_data=tuple(DataFile(log.name, log.sha256) for log in held_out_logs),
        notes=(*model.notes, *_log_notes([*logs, *held_out_logs], knowledge)),
        screening=tuple(_screened_run(s, tested_runs.get(s.run.name)) for s in screenings),
        held_out_screening=tuple(_screened_run(s) for s in held_out_screenings),
    )
    with _failing(knowledge.name):
        model = _with_alternative_fits(
            model, accepted_runs, held_out_runs, knowledge, request.alternative_methods
        )
        report("validate", 0.95)
        model = with_assessment(
            model, accepted_runs, held_out_runs, _logged_gains(logs), knowledge.config
        )
    report("done", 1.0)
    return model


@contextmanager
def _failing(prior_name: str) -> Iterator[None]:
    """Convert errors of a fit from the prior ``prior_name`` to FitFailedError."""
    try:
        yield
    except VehicleFileError as error:
        raise FitFailedError(
            f"prior {prior_name}: the fit ended at the edge of the possible vehicles ({error}); the"
            " logs may be of another vehicle or another tailcone: give its own file as the prior"
        ) from None
    except np.linalg.LinAlgError as error:
        raise FitFailedError(
            f"prior {prior_name}: the tests leave a combination of parameters undetermined"
            f" ({error}); fly more tests, or give the vehicle's own file as the prior"
        ) from None


def _identify(
    runs: Sequence[Run], knowledge: PriorKnowledge, method: Method, progress: Progress
) -> tuple[IdentifiedModel, RefitResult | None]:
    """Return the model and, for method ``map``, the result of the outlier tests on its fit."""
    if method != "map":
        return identify(
            runs, knowledge.config, knowledge.name, method, knowledge.earlier, progress
        ), None
    prior = bench_priors.update_prior(
        prior_of(runs, knowledge.config, knowledge.earlier), knowledge.bench_measurements
    )
    return identify_without_outliers(runs, prior, knowledge.name, progress)


def _with_alternative_fits(
    model: IdentifiedModel,
    runs: Sequence[Run],
    held_out: Sequence[Run],
    knowledge: PriorKnowledge,
    methods: Sequence[Method],
) -> IdentifiedModel:
    """Add fits of the same runs by other methods, or a note with the reason of a failure."""
    alternatives: list[AlternativeFit] = []
    notes = list(model.notes)
    for method in methods:
        try:
            alternatives.append(_alternative_fit(runs, held_out, knowledge, method))
        except NotUniqueError as error:
            notes.append(f"method {method}: the same runs determine no unique model: {error}")
    return msgspec.structs.replace(
        model, alternative_methods=tuple(alternatives), notes=tuple(notes)
    )


def _alternative_fit(
    runs: Sequence[Run], held_out: Sequence[Run], knowledge: PriorKnowledge, method: Method
) -> AlternativeFit:
    """Fit the runs by another method.

    Prediction errors of fitted and held-out runs are included.
    """
    model = identify(runs, knowledge.config, knowledge.name, method, knowledge.earlier)
    if model.convergence.failures and method != "map":
        raise NotUniqueError("; ".join(model.convergence.failures))
    return AlternativeFit(
        method=method,
        planes=model.planes,
        coefficients={name: c.value for name, c in model.coefficients.items()},
        rank=model.joint.rank,
        fit_quality=model.fit_quality,
        held_out=prediction.quality(model, held_out, knowledge.config),
    )


def _logged_gains(logs: Sequence[Log]) -> dict[str, float] | None:
    """Return the gains of the first log that holds all of them; None if no log does."""
    for log in logs:
        if set(TABLE_3_INITIAL) <= set(log.parameters):
            return {name: log.parameters[name] for name in TABLE_3_INITIAL}
    return None


def identify(
    runs: Sequence[Run],
    prior: VehicleConfig,
    prior_name: str = "caribou_nominal",
    method: Method = "map",
    earlier: IdentifiedModel | None = None,
    progress: Progress | None = None,
) -> IdentifiedModel:
    """Identify a vehicle from runs, without screening and without validation.

    Parameters
    ----------
    runs : sequence of Run
        Runs to fit, at least one.
    prior : VehicleConfig
        Vehicle file of the first-principles vehicle.
    prior_name : str
        Name of the prior that the model file records.
    method : {'map', 'output-error', 'filter-error', 'paper'}
        Estimation method, see `refit`.
    earlier : IdentifiedModel, optional
        Model whose estimate and covariance are the prior, instead of first principles.
    progress : callable, optional
        Called with the present step and the completed share of the work, 0 to 1.

    Returns
    -------
    IdentifiedModel
        The model with the prediction errors of the fitted runs.

    Raises
    ------
    NotUniqueError
        Methods ``output-error`` and ``filter-error``: the runs leave values undetermined.
    """
    prior_distribution = prior_of(runs, prior, earlier)
    if method == "paper":
        nominal = parameters.candidate_vehicle(
            prior, prior_distribution.biases_rad, np.zeros(len(NAMES))
        )
        fits = paper_method.fit(runs, prior, nominal.actuators)
        model = model_export.from_paper(fits, prior_distribution, prior_name)
    elif method == "map":
        model = model_export.from_fit(
            fit.fit(runs, prior_distribution, progress), prior_distribution, prior_name
        )
    else:
        model = linear.identify(runs, prior_distribution, prior_name, method, progress)
    return msgspec.structs.replace(model, fit_quality=prediction.quality(model, runs, prior))


def identify_without_outliers(
    runs: Sequence[Run], prior: Prior, prior_name: str, progress: Progress | None = None
) -> tuple[IdentifiedModel, RefitResult]:
    """Identify a vehicle by method ``map``, without the runs that the fit finds anomalous.

    Parameters
    ----------
    runs : sequence of Run
        Runs that passed the screening rules, at least one.
    prior : Prior
        Distribution of the parameters before the runs.
    prior_name : str
        Name of the prior that the model file records.
    progress : callable, optional
        Called with the present step and the completed share of the work, 0 to 1.

    Returns
    -------
    model : IdentifiedModel
        Model with the prediction errors of the fitted runs and without validation. Logs of two
        vehicles are a failure of its convergence.
    refitted : RefitResult
        The last fit, its runs, and the outlier tests of all runs.
    """
    refitted = refit_until_clean(
        runs, prior, lambda accepted_runs: fit.fit(accepted_runs, prior, progress)
    )
    model = model_export.from_fit(refitted.fit, prior, prior_name)
    parameter_shifts = refitted.fit_of_all_runs and shifts(
        model_export.from_fit(refitted.fit_of_all_runs, prior, prior_name), model
    )
    other_vehicle = log_consistency.two_vehicles(refitted.screenings, runs)
    failures = (*model.convergence.failures, *([other_vehicle] if other_vehicle else []))
    return (
        msgspec.structs.replace(
            model,
            convergence=msgspec.structs.replace(model.convergence, failures=failures),
            fit_quality=prediction.quality(model, refitted.accepted_runs, prior.config),
            dropped_run_influence=parameter_shifts or (),
            notes=(
                *model.notes,
                *refitted.structure,
                *map(str, intervals.wide_intervals(refitted.fit, prior)),
            ),
        ),
        refitted,
    )


def prior_of(
    runs: Sequence[Run], prior: VehicleConfig, earlier: IdentifiedModel | None = None
) -> Prior:
    """Return the normal distribution of the parameters before the data.

    Parameters
    ----------
    runs : sequence of Run
        Runs whose mean commands before the tests give the actuator biases of the prior vehicle.
    prior : VehicleConfig
        First-principles vehicle.
    earlier : IdentifiedModel, optional
        Earlier model; its estimate and covariance are used, and ``runs`` is ignored.

    Returns
    -------
    Prior
        Mean and covariance of z, in prior standard deviations, and actuator biases (rad).
    """
    if earlier is None:
        biases = fit.trim_biases(prior, build_model.build(prior), runs)
        return Prior(
            config=prior,
            biases_rad=biases,
            mean=np.zeros(len(NAMES)),
            covariance=parameters.prior_covariance(),
        )
    biases = {plane: float(np.radians(b)) for plane, b in earlier.vehicle.prior_biases_deg.items()}
    return Prior(
        config=prior,
        biases_rad=biases,
        mean=np.array(earlier.joint.z),
        covariance=np.array(earlier.joint.covariance),
    )


def prior_knowledge(prior: str | Path) -> PriorKnowledge:
    """Read the prior of an identification.

    Parameters
    ----------
    prior : str or Path
        Name of a shipped vehicle, path of a vehicle file, or path of a ``model.json`` of method
        ``map``.

    Returns
    -------
    PriorKnowledge
        Vehicle file, its name and, for a ``model.json``, the earlier model.

    Raises
    ------
    VehicleFileError, ModelError
        The file is missing or invalid.
    RefitError
        The model is of another method than ``map``, or has other parameters than this version.
    """
    if str(prior).endswith(".json"):
        earlier = models.read(prior)
        if earlier.method != "map":
            raise RefitError(
                f"{prior}: method = {earlier.method!r}; a prior must be a model of method 'map'"
            )
        if earlier.joint.names != NAMES:
            raise RefitError(
                f"{prior}: joint.names are not this version's parameters; refit its logs"
            )
        return PriorKnowledge(
            vehicle_files.load(earlier.vehicle.prior), earlier.vehicle.prior, earlier
        )
    return PriorKnowledge(
        vehicle_file(prior), str(prior) if prior == "caribou_nominal" else Path(prior).name, None
    )


def vehicle_file(prior: str | Path) -> VehicleConfig:
    """Load the vehicle file of a prior.

    Parameters
    ----------
    prior : str or Path
        Name of a shipped vehicle or path of a vehicle file (TOML).

    Returns
    -------
    VehicleConfig
        The decoded vehicle file.

    Raises
    ------
    VehicleFileError
        The file is missing or invalid, or it is the simulated truth, `FORBIDDEN_PRIOR`.
    """
    is_truth = str(prior) == FORBIDDEN_PRIOR
    config = None if is_truth else vehicle_files.load(prior)
    if config is None or config.name.endswith(TRUTH_SUFFIX):
        raise VehicleFileError(
            f"prior {str(prior)!r}: is the simulated truth; "
            "give 'caribou_nominal', a vehicle file or a model.json"
        )
    return config


def _read(
    paths: Sequence[str | Path], options: OutputOptions, report: Callable[[float], None]
) -> list[Log]:
    """Read the logs; ``report`` is called with the share of the logs that are read."""
    logs = []
    for number, path in enumerate(paths):
        report(number / len(paths))
        logs.append(readers.read(path, options))
    return logs


def _check_marks(marks: Sequence[MarkedInterval], names: Sequence[str]) -> None:
    """Require that every mark names an existing log.

    A mark may omit it only if there is one log.
    """
    for mark in marks:
        description = f"run {mark.start_s:g}..{mark.stop_s:g}"
        if mark.log and mark.log not in names:
            raise RefitError(f"{description}: {mark.log} is none of the logs {', '.join(names)}")
        if not mark.log and len(names) > 1:
            raise RefitError(
                f"{description}: there are {len(names)} logs; name the one that it is in,"
                f" {names[0]}:START..STOP"
            )


def _refuse_duplicates(
    request: RefitRequest,
    logs: Sequence[Log],
    held_out_logs: Sequence[Log],
    knowledge: PriorKnowledge,
) -> None:
    """Raise RefitError if two of the logs hold the same dive."""
    fitted_logs, held_out_named = (
        [duplicates.named_log(path, log, _marks_of(log, request.marks)) for path, log in pairs]
        for pairs in (
            zip(request.paths, logs, strict=True),
            zip(request.held_out, held_out_logs, strict=True),
        )
    )
    prior_data = knowledge.earlier.data if knowledge.earlier else ()
    reason = duplicates.refusal(fitted_logs, held_out_named, prior_data)
    if reason:
        raise RefitError(reason)


def _log_notes(logs: Sequence[Log], knowledge: PriorKnowledge) -> list[str]:
    """Return notes on damaged logs, and on logs with another travel than the prior's."""
    travel_deg = knowledge.config.tailcone.travel_deg
    return [
        *(f"{log.name} is damaged: {log.damage}" for log in logs if log.damage),
        *(
            f"{log.name}: ACT_TRAVEL_DEG = {log.parameters['ACT_TRAVEL_DEG']:g}, and the travel of"
            f" prior {knowledge.name} is {travel_deg:g} deg: a wrong prior or another tailcone"
            for log in logs
            if not np.isclose(log.parameters.get("ACT_TRAVEL_DEG", travel_deg), travel_deg, 1e-3)
        ),
    ]


def _refuse_miswired(request: RefitRequest, logs: Sequence[Log]) -> None:
    """Raise RefitError for swapped planes, a reversed sign, or logs of different vehicles."""
    reason = wiring.refusal(
        [
            wiring.LogOfRuns(log, segments.cut_runs(log, _marks_of(log, request.marks)))
            for log in logs
        ]
    )
    if reason:
        raise RefitError(reason)


def _marks_of(log: Log, marks: Sequence[MarkedInterval]) -> list[MarkedInterval]:
    """Return the marks that apply to a log; a mark without a log name applies to every log."""
    return [mark for mark in marks if mark.log in ("", log.name)]


def _select(
    logs: Sequence[Log], limits: ScreeningLimits | None, marks: Sequence[MarkedInterval]
) -> tuple[list[Run], list[Screening]]:
    """Cut the logs into runs and screen them.

    Return the accepted runs and all screening results.
    """
    runs = [run for log in logs for run in segments.cut_runs(log, _marks_of(log, marks))]
    names = ", ".join(log.name for log in logs) or "no file"
    if not runs:
        needed = "tests of rudder or elevator (SID_AXIS 12 or 11), or ranges that you mark"
        found = proposals.format_marks([mark for log in logs for mark in proposals.propose(log)])
        raise RefitError(f"{names}: no test found; a log needs {needed} (--segment); {found}")
    screenings = screen(runs, limits)
    accepted_runs = [s.run for s in screenings if s.accepted]
    if not accepted_runs:
        rejections = "; ".join(f"{s.run.name} {s.reasons[0]}" for s in screenings)
        raise RefitError(f"{names}: every test was screened out: {rejections}")
    return accepted_runs, screenings


def _screened_run(screening: Screening, outlier_test: RunScreening | None = None) -> ScreenedRun:
    """Return the ``model.json`` record of a run, with the outlier tests if the run was fitted."""
    run, reasons = screening.run, screening.reasons
    record = ScreenedRun(
        run=run.name,
        plane=run.plane,
        wave=run.wave,
        magnitude_deg=run.magnitude_deg,
        duration_s=float(run.time_s[-1]),
        accepted=not reasons,
        reasons=reasons,
    )
    if outlier_test is None:
        return record
    return msgspec.structs.replace(
        record,
        accepted=not outlier_test.reason,
        reasons=(outlier_test.reason,) if outlier_test.reason else (),
        warnings=outlier_test.warnings,
        p_value=outlier_test.scores.p_value,
        repeat_p_value=outlier_test.repeat.p_value if outlier_test.repeat else None,
        anomalies=tuple(AnomalyTest(*anomaly) for anomaly in outlier_test.scores.anomalies),
    )
