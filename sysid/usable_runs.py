"""Runs of a refit: read the logs, refuse unusable ones, cut the tests out and screen them."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from autopilot.control.params import PARAMETERS
from sysid.data import duplicates, readers, segments
from sysid.data.dataset import Log
from sysid.data.readers.csv_table import MIN_THRUST
from sysid.data.readers.servo_channels import TRAVEL, OutputOptions
from sysid.data.runs import Run
from sysid.data.segments import MarkedInterval
from sysid.models.model_file import AnomalyTest, ScreenedRun
from sysid.planes import PLANES
from sysid.prior_knowledge import PriorKnowledge, RefitError
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.screening import RunScreening, Screening, proposals, screen, wiring
from sysid.screening.excitation import NO_EXCITATION
from sysid.screening.wiring import LogOfRuns

_TRAVEL_PARAMETER = next(row for row in PARAMETERS if row.name == TRAVEL)
MAX_GAIN = 1e3
"""Largest gain that a log may hold: a radian of duct for a milliradian, or for a millimetre."""


def read_logs(
    paths: Sequence[str | Path], options: OutputOptions, report: Callable[[float], None]
) -> list[Log]:
    """Read the logs; ``report`` is called with the share of the logs that are read."""
    logs = []
    for number, path in enumerate(paths):
        report(number / len(paths))
        logs.append(readers.read(path, options))
    return logs


def check_marks(marks: Sequence[MarkedInterval], names: Sequence[str]) -> None:
    """Require that every mark names an existing log.

    A mark may omit it only if there is one log.
    """
    for mark in marks:
        description = f"--segment {mark.text}"
        if mark.log and mark.log not in names:
            raise RefitError(f"{description}: {mark.log} is none of the logs {', '.join(names)}")
        if not mark.log and len(names) > 1:
            raise RefitError(
                f"{description}: there are {len(names)} logs; name the one that it is in,"
                f" {names[0]}:START..STOP"
            )


def refuse_duplicates(
    fitted: Iterable[tuple[str | Path, Log]],
    held_out: Iterable[tuple[str | Path, Log]],
    marks: Sequence[MarkedInterval],
    knowledge: PriorKnowledge,
) -> None:
    """Raise RefitError if two of the logs, given with their paths, hold the same dive."""
    fitted_logs, held_out_logs = (
        [duplicates.named_log(path, log, _marks_of(log, marks)) for path, log in pairs]
        for pairs in (fitted, held_out)
    )
    prior_data = knowledge.earlier.data if knowledge.earlier else ()
    reason = duplicates.refusal(fitted_logs, held_out_logs, prior_data)
    if reason:
        raise RefitError(reason)


def with_logged_travel(knowledge: PriorKnowledge, logs: Sequence[Log]) -> PriorKnowledge:
    """Return the knowledge with the travel of the surfaces that the logs give, if they give one.

    The parameter limits the commands of the vehicle that was flown; the file may be of another one.
    With a smaller travel, larger commands would be clipped before they move the model. A vehicle
    file has the range of the parameter, so a travel beyond it is left out.
    """
    config = knowledge.config
    known_deg = config.tailcone.travel_deg
    other_deg = (log.parameters[TRAVEL] for log in logs if not _has_travel(log, known_deg))
    travel_deg = next(filter(_TRAVEL_PARAMETER.accepts, other_deg), known_deg)
    tailcone = msgspec.structs.replace(config.tailcone, travel_deg=travel_deg)
    return knowledge._replace(config=msgspec.structs.replace(config, tailcone=tailcone))


def _has_travel(log: Log, travel_deg: float) -> bool:
    """Return whether a log gives this travel, or none; its number is a float32."""
    return bool(np.isclose(log.parameters.get(TRAVEL, travel_deg), travel_deg, 1e-3))


def log_notes(logs: Sequence[Log], knowledge: PriorKnowledge) -> list[str]:
    """Return notes on damage, impossible gains, another travel, and how commands were held."""
    travel_deg = knowledge.config.tailcone.travel_deg
    return [
        *(f"{log.name} is damaged: {log.damage}" for log in logs if log.damage),
        *(
            f"{log.name}: {error}; the gains of this log are not used"
            for log in logs
            if (error := gains_error(log))
        ),
        *(
            f"{log.name}: {TRAVEL} = {log.parameters[TRAVEL]:g}, which is used; the travel of prior"
            f" {knowledge.name} is {travel_deg:g} deg: a wrong prior or another tailcone"
            for log in logs
            if not _has_travel(log, travel_deg)
        ),
        *(
            f"{log.name}: it is not known which pulses are full travel; assumed: {pulses}; record"
            " the parameters SERVOn_MIN, SERVOn_TRIM and SERVOn_MAX"
            for log in logs
            if (pulses := log.actuators.assumed_pulses)
        ),
        *(
            f"{log.name}: it is not known how long the autopilot held a command (0 to 20 ms), which"
            f" the intervals contain; give the rate of its loops in Hz as {segments.LOOP_RATE}"
            for log in logs
            if segments.hold_of(log).sd_s
        ),
    ]


def gains_error(log: Log) -> str:
    """Return why the gains in a log cannot be those of the dive; empty if they can.

    Parameters
    ----------
    log : Log
        A log; without gains nothing is wrong.

    Returns
    -------
    str
        Name, value and what is possible.
    """
    gains = {name: log.parameters[name] for name in TABLE_3_INITIAL if name in log.parameters}
    for name, gain in gains.items():
        if not abs(gain) <= MAX_GAIN:
            return f"{name} = {gain:g}: expected a gain of at most {MAX_GAIN:g}"
    for prefix in (traits.gain_prefix for traits in PLANES.values()):
        loop = [f"{prefix}_{term}" for term in "PDI"]
        if all(gains.get(name) == 0.0 for name in loop):
            return f"{', '.join(loop)} = 0: expected gains that close the loop"
    return ""


def cut_logs(logs: Iterable[Log], marks: Sequence[MarkedInterval]) -> list[LogOfRuns]:
    """Cut the tests out of each log."""
    return [LogOfRuns(log, segments.cut_runs(log, _marks_of(log, marks))) for log in logs]


def runs_of(logs: Iterable[LogOfRuns]) -> list[Run]:
    """Return the tests of all logs."""
    return [run for log in logs for run in log.runs]


def refuse_miswired(logs: Sequence[LogOfRuns]) -> None:
    """Raise RefitError for mixed or swapped planes, a wrong sign or thrust, or two vehicles."""
    for log, log_runs in logs:
        if mixed := log.actuators.mixed_surfaces:
            raise RefitError(
                f"{log.name}: {mixed} act in both planes; identification needs a rudder and an"
                " elevator: write their commands to a CSV file, or name other outputs with"
                " --servo-channels"
            )
        if log_runs and all(np.mean(run.thrust) <= MIN_THRUST for run in log_runs):
            raise RefitError(
                f"{log.name}: the thrust in its tests is {100.0 * np.mean(log_runs[0].thrust):.0f}"
                " %, and a vehicle steers by its speed: name the output, or reverse it, with"
                " --servo-channels; of a motor that turns forwards only, SERVOn_TRIM is SERVOn_MIN"
            )
    reason = wiring.refusal(logs)
    if reason:
        raise RefitError(reason)


def _marks_of(log: Log, marks: Sequence[MarkedInterval]) -> list[MarkedInterval]:
    """Return the marks that apply to a log; a mark without a log name applies to every log."""
    return [mark for mark in marks if mark.log in ("", log.name)]


def select(logs: Sequence[LogOfRuns], full_speed_mps: float) -> tuple[list[Run], list[Screening]]:
    """Screen the runs of the logs. Return the accepted runs and all screening results."""
    runs = runs_of(logs)
    names = ", ".join(log.name for log, _ in logs) or "no file"
    if not runs:
        needed = "tests of rudder or elevator (SID_AXIS 12 or 11), or ranges that you mark"
        found = proposals.format_marks([mark for log, _ in logs for mark in proposals.propose(log)])
        raise RefitError(f"{names}: no test found; a log needs {needed} (--segment); {found}")
    screenings = screen(runs, full_speed_mps)
    accepted_runs = [s.run for s in screenings if s.accepted]
    if not accepted_runs:
        rejections = _format_rejections(screenings)
        moving = _moving_outputs(logs) if all(map(_is_held, screenings)) else ""
        raise RefitError(f"{names}: every test was screened out: {rejections}{moving}")
    return accepted_runs, screenings


def _format_rejections(screenings: Sequence[Screening]) -> str:
    """Return the first reason of each rejected run; runs with the same reason are listed once."""
    names: dict[str, list[str]] = {}
    for screening in screenings:
        names.setdefault(screening.reasons[0], []).append(screening.run.name)
    return "; ".join(f"{', '.join(runs)} {reason}" for reason, runs in names.items())


def _is_held(screening: Screening) -> bool:
    """Return whether a run is rejected because its surface did not move."""
    return any(reason.startswith(NO_EXCITATION) for reason in screening.reasons)


def _moving_outputs(logs: Sequence[LogOfRuns]) -> str:
    """Return the outputs that move and are read as none of the surfaces, with the remedy."""
    numbers = sorted({number for log, _ in logs for number in log.actuators.other_outputs})
    if not numbers:
        return ""
    outputs = ", ".join(map(str, numbers))
    return (
        f"; outputs that move and are not read: {outputs}; give those of rudder, elevator and"
        " thrust with --servo-channels"
    )


def screened_run(screening: Screening, outlier_test: RunScreening | None = None) -> ScreenedRun:
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
