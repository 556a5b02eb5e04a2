"""Identification from logs: read, cut into tests, screen, fit and validate.

The result is deterministic: the same logs and package versions give the same bytes of
``model.json``.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from mavlink_io.errors import ErrorCode, OperationError
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.config import VehicleFileError as VehicleFileError
from sysid import usable_runs
from sysid.data import readers
from sysid.data.dataset import Log
from sysid.data.readers.servo_channels import OutputOptions, ServoChannels
from sysid.data.runs import Run
from sysid.data.segments import MarkedInterval
from sysid.estimation.linear import report as linear
from sysid.estimation.linear.multistart import NotUniqueError as NotUniqueError
from sysid.estimation.map import fit, intervals
from sysid.estimation.map.fit import Progress
from sysid.estimation.map.problem import Prior
from sysid.models import bench_priors, model_export, parameters, prediction
from sysid.models.bench_priors import BenchResultError as BenchResultError
from sysid.models.model_file import AlternativeFit, DataFile, IdentifiedModel, Method
from sysid.models.parameters import NAMES
from sysid.prior_knowledge import PriorKnowledge, prior_knowledge, prior_of
from sysid.prior_knowledge import RefitError as RefitError
from sysid.reproduction import paper_method
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.screening import log_consistency, screen
from sysid.screening.outlier_tests import RunScreening
from sysid.screening.refit_loop import RefitResult, refit_until_clean, shifts
from sysid.validation.assess import with_assessment


class FitFailedError(OperationError):
    """The fit has no result; the message names the prior, the reason and a remedy."""

    code = ErrorCode.FIT_FAILED


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
    logs = usable_runs.read_logs(
        request.paths, options, lambda share: report("read logs", 0.1 * share)
    )
    held_out_logs = usable_runs.read_logs(request.held_out, options, lambda share: None)
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
    usable_runs.check_marks(request.marks, [log.name for log in (*logs, *held_out_logs)])
    usable_runs.refuse_duplicates(
        zip(request.paths, logs, strict=True),
        zip(request.held_out, held_out_logs, strict=True),
        request.marks,
        knowledge,
    )
    tests = usable_runs.cut_logs(logs, request.marks)
    held_out_tests = usable_runs.cut_logs(held_out_logs, request.marks)
    usable_runs.refuse_miswired([*tests, *held_out_tests])
    notes = usable_runs.log_notes([*logs, *held_out_logs], knowledge)
    knowledge = usable_runs.with_logged_travel(knowledge, logs)
    point = knowledge.config.operating_point
    full_speed_mps = point.speed_mps / point.thrust_fraction
    accepted_runs, screenings = usable_runs.select(tests, full_speed_mps)
    held_out_screenings = screen(usable_runs.runs_of(held_out_tests), full_speed_mps)
    held_out_runs = [s.run for s in held_out_screenings if s.accepted]
    with _fit_errors_named(knowledge.name):
        model, refitted = _identify(
            accepted_runs, knowledge, request.method, lambda w, s: report(w, 0.1 + 0.85 * s)
        )
    tested_runs: Mapping[str, RunScreening] = {}
    if refitted is not None:
        accepted_runs, tested_runs = list(refitted.accepted_runs), refitted.screenings
    model = msgspec.structs.replace(
        model,
        data=tuple(DataFile(log.name, log.sha256) for log in logs),
        held_out_data=tuple(DataFile(log.name, log.sha256) for log in held_out_logs),
        notes=(*model.notes, *notes),
        screening=tuple(
            usable_runs.screened_run(s, tested_runs.get(s.run.name)) for s in screenings
        ),
        held_out_screening=tuple(usable_runs.screened_run(s) for s in held_out_screenings),
    )
    with _fit_errors_named(knowledge.name):
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
def _fit_errors_named(prior_name: str) -> Iterator[None]:
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
    """Return the gains of the first log that holds all of them, possible ones; None without."""
    for log in logs:
        if set(TABLE_3_INITIAL) <= set(log.parameters) and not usable_runs.gains_error(log):
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
        vehicles, and a wrong thrust, are failures of its convergence.
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
    contradictions = (
        log_consistency.two_vehicles(refitted.screenings, runs),
        log_consistency.wrong_thrust(refitted.fit.vehicle, refitted.accepted_runs),
    )
    failures = (*model.convergence.failures, *filter(None, contradictions))
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
