"""Logs in, identified model out: read, cut, screen, fit, report. The same logs give the same
bytes."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import SHIPPED as SHIPPED
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.config import VehicleFileError as VehicleFileError
from sysid.data import duplicates, readers, segments
from sysid.data.dataset import Log
from sysid.data.readers.servo_channels import FIRST_THREE, ServoChannels
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
from sysid.screening import RunScreening, Screening, ScreeningLimits, screen
from sysid.screening.influence import shifts
from sysid.screening.refit_loop import RefitResult, refit_until_clean
from sysid.validation.assess import with_assessment

Array = NDArray[np.float64]

FORBIDDEN_PRIOR = "caribou_truth"
"""The vehicle that the simulator flies as the truth; an engineer has no such file."""


class RefitError(ValueError):
    """Logs or a prior that cannot be used: one line saying which, and what would be right."""


class FitFailedError(RuntimeError):
    """A fit that has no result: one line with the prior, the reason and what would help."""


class PriorKnowledge(NamedTuple):
    """What is known of a vehicle before its tests: its file, and the model that an earlier refit
    made of it."""

    config: VehicleConfig
    name: str
    earlier: IdentifiedModel | None
    readings: tuple[BenchMeasurement, ...] = ()
    """What was measured ashore."""


def refit(
    paths: Sequence[str | Path],
    prior: str | Path = "caribou_nominal",
    method: Method = "map",
    held_out: Sequence[str | Path] = (),
    limits: ScreeningLimits | None = None,
    progress: Progress | None = None,
    marks: Sequence[MarkedInterval] = (),
    outputs: ServoChannels = FIRST_THREE,
    beside: Sequence[Method] = (),
    tailcone: Path | None = None,
    inclining: Path | None = None,
) -> IdentifiedModel:
    """Identify a vehicle from the tests in logs of any kind (`sysid.data.readers`).

    Args:
        paths: logs with rudder or elevator tests. prior: ``bench``, a vehicle file, or a
        ``model.json`` whose estimate becomes the prior. method: ``map`` (nonlinear, whitened, with
        priors), ``output-error`` or ``filter-error`` (linear planes, see
            `sysid.estimation.linear`) or ``paper`` (rate error only, linear, no prior).
        held_out: logs whose tests are predicted, not fitted. progress: called with what is being
        done and the share that is behind. marks: tests that the logs do not tell of themselves.
        outputs: those of the autopilot's outputs that steer. beside: methods by which the same runs
        are fitted as well, for comparison. tailcone, inclining: what `ground bench-test` and
        `ground inclining-test` printed, as priors of method ``map``.

    Raises:
        AshoreError, LogError, VehicleError, ModelError, RefitError: bad input, each in one line.
        FitFailedError: the logs do not determine a vehicle near the prior.
    """
    report = progress or (lambda what, share: None)
    belief = prior_knowledge(prior)._replace(readings=bench_priors.read(tailcone, inclining))
    read = _read(paths, outputs, lambda share: report("read logs", 0.1 * share))
    unseen = _read(held_out, outputs, lambda share: None)
    _check_marks(marks, [log.name for log in (*read, *unseen)])
    _refuse_duplicates(paths, read, held_out, unseen, marks, belief)
    kept, screenings = _select(read, limits, marks)
    fresh = screen(
        [run for log in unseen for run in segments.cut_runs(log, _marks_of(log, marks))], limits
    )
    held = [s.run for s in fresh if s.kept]
    with _failing(belief.name):
        model, settled = _identify(kept, belief, method, lambda w, s: report(w, 0.1 + 0.85 * s))
    kept, verdicts = (list(settled.kept), settled.verdicts) if settled else (kept, {})
    model = msgspec.structs.replace(
        model,
        data=tuple(DataFile(log.name, log.sha256) for log in read),
        held_out_data=tuple(DataFile(log.name, log.sha256) for log in unseen),
        screening=tuple(_screened_run(s, verdicts.get(s.run.name)) for s in screenings),
        held_out_screening=tuple(_screened_run(s) for s in fresh),
    )
    with _failing(belief.name):
        model = _with_alternative_fits(model, kept, held, belief, beside)
        report("judge", 0.95)
        model = with_assessment(model, kept, held, _logged_gains(read), belief.config)
    report("done", 1.0)
    return model


@contextmanager
def _failing(prior: str) -> Iterator[None]:
    """Give what makes a fit from ``prior`` impossible as FitFailedError."""
    try:
        yield
    except VehicleFileError as error:
        raise FitFailedError(
            f"prior {prior}: the fit ended at the edge of the vehicles that are possible ({error});"
            " the logs may be of another vehicle: give its own file as the prior"
        ) from None
    except np.linalg.LinAlgError as error:
        raise FitFailedError(
            f"prior {prior}: the tests leave a combination of parameters undetermined ({error}); "
            "fly more tests, or give the vehicle's own file as the prior"
        ) from None


def _identify(
    kept: Sequence[Run], belief: PriorKnowledge, method: Method, progress: Progress
) -> tuple[IdentifiedModel, RefitResult | None]:
    """The model, and what a fit with a noise model said of the runs in it."""
    if method != "map":
        return identify(kept, belief.config, belief.name, method, belief.earlier, progress), None
    prior = bench_priors.update_prior(
        prior_of(kept, belief.config, belief.earlier), belief.readings
    )
    settled = refit_until_clean(kept, prior, lambda chosen: fit.fit(chosen, prior, progress))
    model = model_export.from_fit(settled.found, prior, belief.name)
    moved = settled.with_all and shifts(
        model_export.from_fit(settled.with_all, prior, belief.name), model
    )
    return (
        msgspec.structs.replace(
            model,
            fit_quality=prediction.quality(model, settled.kept, belief.config),
            left_out_moved=moved or (),
            notes=(
                *model.notes,
                *settled.structure,
                *map(str, intervals.wide_intervals(settled.found, prior)),
            ),
        ),
        settled,
    )


def _with_alternative_fits(
    model: IdentifiedModel,
    kept: Sequence[Run],
    held_out: Sequence[Run],
    belief: PriorKnowledge,
    methods: Sequence[Method],
) -> IdentifiedModel:
    """The model with the same runs fitted by other methods, or a note of why one could not."""
    rivals: list[AlternativeFit] = []
    notes = list(model.notes)
    for method in methods:
        try:
            rivals.append(_alternative_fit(kept, held_out, belief, method))
        except NotUniqueError as error:
            notes.append(f"by {method} the same runs name no model: {error}")
    return msgspec.structs.replace(model, beside=tuple(rivals), notes=tuple(notes))


def _alternative_fit(
    kept: Sequence[Run], held_out: Sequence[Run], belief: PriorKnowledge, method: Method
) -> AlternativeFit:
    found = identify(kept, belief.config, belief.name, method, belief.earlier)
    return AlternativeFit(
        method=method,
        planes=found.planes,
        coefficients={name: c.value for name, c in found.coefficients.items()},
        rank=found.joint.rank,
        fit_quality=found.fit_quality,
        held_out=prediction.quality(found, held_out, belief.config),
    )


def _logged_gains(read: Sequence[Log]) -> dict[str, float] | None:
    """Of the first log that tells them all: the loops that flew the tests."""
    for log in read:
        if set(TABLE_3_INITIAL) <= set(log.parameters):
            return {name: log.parameters[name] for name in TABLE_3_INITIAL}
    return None


def identify(
    kept: Sequence[Run],
    prior: VehicleConfig,
    prior_name: str = "caribou_nominal",
    method: Method = "map",
    earlier: IdentifiedModel | None = None,
    progress: Progress | None = None,
) -> IdentifiedModel:
    """The same for runs already at hand, none of which is screened."""
    belief = prior_of(kept, prior, earlier)
    if method == "paper":
        nominal = parameters.candidate_vehicle(prior, belief.biases_rad, np.zeros(len(NAMES)))
        fits = paper_method.fit(kept, prior, nominal.actuators)
        model = model_export.from_paper(fits, belief, prior_name)
    elif method == "map":
        model = model_export.from_fit(fit.fit(kept, belief, progress), belief, prior_name)
    else:
        model = linear.identify(kept, belief, prior_name, method, progress)
    return msgspec.structs.replace(model, fit_quality=prediction.quality(model, kept, prior))


def prior_of(
    kept: Sequence[Run], prior: VehicleConfig, earlier: IdentifiedModel | None = None
) -> Prior:
    """Belief before the data: first principles trimmed as the runs were, or what an earlier model
    says."""
    if earlier is None:
        biases = fit.trim_biases(prior, build_model.build(prior), kept)
        return Prior(prior, biases, np.zeros(len(NAMES)), parameters.prior_covariance())
    biases = {plane: float(np.radians(b)) for plane, b in earlier.vehicle.prior_biases_deg.items()}
    return Prior(prior, biases, np.array(earlier.joint.z), np.array(earlier.joint.covariance))


def prior_knowledge(prior: str | Path) -> PriorKnowledge:
    """``bench``, a vehicle file, or a ``model.json``. Raises VehicleError, ModelError,
    RefitError."""
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
    """What is known of a vehicle beforehand. Raises VehicleError, also for the one that is
    simulated."""
    if str(prior) == FORBIDDEN_PRIOR:
        raise VehicleFileError(
            f"prior {prior!r}: is the simulated truth; "
            "give 'caribou_nominal', a vehicle file or a model.json"
        )
    return vehicle_files.load(prior)


def _read(
    paths: Sequence[str | Path], outputs: ServoChannels, report: Callable[[float], None]
) -> list[Log]:
    read = []
    for number, path in enumerate(paths):
        report(number / len(paths))
        read.append(readers.read(path, outputs))
    return read


def _check_marks(marks: Sequence[MarkedInterval], names: Sequence[str]) -> None:
    """Every mark must say which log it means, and mean one that is there."""
    for mark in marks:
        text = f"run {mark.start_s:g}..{mark.stop_s:g}"
        if mark.log and mark.log not in names:
            raise RefitError(f"{text}: {mark.log} is none of the logs {', '.join(names)}")
        if not mark.log and len(names) > 1:
            raise RefitError(
                f"{text}: there are {len(names)} logs; name the one that it is in,"
                f" {names[0]}:START..STOP"
            )


def _refuse_duplicates(
    paths: Sequence[str | Path],
    read: Sequence[Log],
    held_out: Sequence[str | Path],
    unseen: Sequence[Log],
    marks: Sequence[MarkedInterval],
    belief: PriorKnowledge,
) -> None:
    """Raise RefitError where two of the logs hold the same dive."""
    fitted, predicted = (
        [duplicates.named_log(path, log, _marks_of(log, marks)) for path, log in pairs]
        for pairs in (zip(paths, read, strict=True), zip(held_out, unseen, strict=True))
    )
    prior_data = belief.earlier.data if belief.earlier else ()
    reason = duplicates.refusal(fitted, predicted, prior_data)
    if reason:
        raise RefitError(reason)


def _marks_of(log: Log, marks: Sequence[MarkedInterval]) -> list[MarkedInterval]:
    return [mark for mark in marks if mark.log in ("", log.name)]


def _select(
    read: Sequence[Log], limits: ScreeningLimits | None, marks: Sequence[MarkedInterval]
) -> tuple[list[Run], list[Screening]]:
    found = [run for log in read for run in segments.cut_runs(log, _marks_of(log, marks))]
    names = ", ".join(log.name for log in read) or "no file"
    if not found:
        needed = "'SystemID Starting' events of axis 11 or 12, or runs that you mark"
        raise RefitError(f"{names}: no test found; a log needs {needed}")
    screenings = screen(found, limits)
    kept = [s.run for s in screenings if s.kept]
    if not kept:
        why = "; ".join(f"{s.run.name} {s.reasons[0]}" for s in screenings)
        raise RefitError(f"{names}: every test was screened out: {why}")
    return kept, screenings


def _screened_run(screening: Screening, verdict: RunScreening | None = None) -> ScreenedRun:
    run, reasons = screening.run, screening.reasons
    bare = ScreenedRun(
        run.name,
        run.plane,
        run.wave,
        run.magnitude_deg,
        float(run.time_s[-1]),
        not reasons,
        reasons,
    )
    if verdict is None:
        return bare
    return msgspec.structs.replace(
        bare,
        kept=not verdict.reason,
        reasons=(verdict.reason,) if verdict.reason else (),
        warnings=verdict.warnings,
        p_value=verdict.scores.p_value,
        repeat_p_value=verdict.repeat.p_value if verdict.repeat else None,
        anomalies=tuple(AnomalyTest(*anomaly) for anomaly in verdict.scores.anomalies),
    )
