"""From logs to a model and from a model to gains, as the command line and the campaign ask for it.

The work is sysid's; here its refusals become this tool's.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.linalg import LinAlgError

from ground.campaign import prototype
from ground.errors import InputError, OperationError
from sysid import monitor
from sysid import refit as fitting
from sysid.data import readers
from sysid.data.dataset import Log, LogError
from sysid.data.readers import servo_channels
from sysid.data.segments import MarkedInterval
from sysid.design import lqg, pid
from sysid.design.lqg import LqgDesign
from sysid.design.pid import Design, DesignInfeasibleError, Spec
from sysid.models import model_file
from sysid.models.model_file import IdentifiedModel, ModelError
from sysid.monitor import MonitorReport, tracking_metrics
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.refit import (
    SHIPPED,
    BenchResultError,
    FitFailedError,
    NotUniqueError,
    RefitError,
    VehicleFileError,
)
from sysid.reproduction import paper_tables

Method = Literal["map", "paper", "output-error", "filter-error"]
MAX_TRIM_DEG = 15.0


def initial_gains() -> dict[str, float]:
    """The prototype's gains: the initial column of the paper's Table 3."""

    return dict(paper_tables.TABLE_3_INITIAL)


def improved_gains() -> dict[str, float]:
    """What the paper's engineers came to: the improved column of its Table 3."""

    return dict(paper_tables.TABLE_3_IMPROVED)


def measure_trims(path: Path, window_s: float) -> dict[str, float]:
    """What rudder and elevator had to be, on average, over the last ``window_s`` of a straight and
    level mission.

    Raises:
        FailedError: the flight was not steady, or would take more than the duct's travel.
    """

    log = read_log(path)
    ends = [event.time_s for event in log.events if event.text == "Mode SURFACE"]
    if not ends:
        raise OperationError(f"{path}: the mission did not end with the vehicle surfacing")
    time_s = log.actuators.time_s
    window = (time_s > ends[0] - window_s) & (time_s <= ends[0])
    trims = {
        "TRIM_RUD_DEG": float(np.degrees(np.mean(log.actuators.rudder_rad[window]))),
        "TRIM_ELE_DEG": float(np.degrees(np.mean(log.actuators.elevator_rad[window]))),
    }
    for name, value in trims.items():
        if not abs(value) < MAX_TRIM_DEG:
            raise OperationError(
                f"{path}: {name} would be {value:.1f} deg, beyond the duct's {MAX_TRIM_DEG:g} deg"
            )
    return {name: round(value, 3) for name, value in trims.items()}


def refit(
    paths: Sequence[Path],
    held_out: Sequence[Path] = (),
    prior: str = "caribou_nominal",
    method: Method = "map",
    progress: Callable[[str, float], None] | None = None,
    marked: Sequence[str] = (),
    outputs: str = "1,2,3",
    beside: Sequence[Method] = (),
    tailcone: Path | None = None,
    inclining: Path | None = None,
    *,
    force: bool = False,
) -> IdentifiedModel:
    """The model that explains the tests in the logs.

    Raises:
        BadInputError: of the logs, the prior or what was measured ashore.
        FailedError: the fit cannot be believed, unless ``force``; the model then says so itself.
    """

    with _translate_errors():
        model = fitting.refit(
            list(paths),
            prior=prior,
            method=method,
            held_out=list(held_out),
            progress=progress,
            marks=[_parse_mark(text) for text in marked],
            outputs=servo_channels.parse(outputs),
            beside=beside,
            tailcone=tailcone,
            inclining=inclining,
        )
    if model.convergence.failures and not force:
        reasons = "; ".join(model.convergence.failures)
        raise OperationError(
            f"the fit failed: {reasons}; `ground refit --force` writes it all the same"
        )
    return model


def _parse_mark(text: str) -> MarkedInterval:
    """A test by hand, ``[LOG:]START..STOP:rudder`` or ``:elevator``, in seconds of the log's own
    time."""

    found = re.fullmatch(r"(?:(.+):)?(\d+\.?\d*)\.\.(\d+\.?\d*):(rudder|elevator)", text)
    if found is None:
        raise InputError(
            f"--segment {text}: give [LOG:]START..STOP:rudder or :elevator, in seconds of the log's"
            " time"
        )
    return MarkedInterval(
        float(found[2]), float(found[3]), "yaw" if found[4] == "rudder" else "pitch", found[1] or ""
    )


def redesign(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: str | None = None,
    *,
    force: bool = False,
) -> Design:
    """Gains for a model, by default asked for what ``specification`` says.

    ``prior``: the vehicle file it was refitted from, where that is not shipped.

    Raises:
        BadInputError: there is no such vehicle file. FailedError: its verdict is against it, unless
        ``force``; or no gains meet the specification.
    """

    _check_fit_for_redesign(model, "redesign", force)
    with _translate_errors():
        spec, vehicle = spec or specification(model, prior), read_vehicle(prior) if prior else None
        return pid.redesign(model, spec, vehicle, _initial_gains_of(model, prior))


def redesign_lqg(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: str | None = None,
    *,
    force: bool = False,
) -> LqgDesign:
    """LQG laws for a model; otherwise as ``redesign``."""

    _check_fit_for_redesign(model, "redesign --method lqg", force)
    with _translate_errors():
        return lqg.design_lqg(
            model, spec, read_vehicle(prior) if prior else None, _initial_gains_of(model, prior)
        )


def _check_fit_for_redesign(model: IdentifiedModel, command: str, force: bool) -> None:
    if not force and (model.verdict is None or not model.verdict.fit_for_redesign):
        advice = f"fly what it asks for, or `ground {command} --force`"
        raise OperationError(f"the model is not fit for redesign: {_reasons(model)}; {advice}")


def specification(model: IdentifiedModel, prior: str | None = None) -> Spec:
    """What is asked of gains by default, within the travel and rate of the vehicle's own tailcone,
    where it is known.

    Raises:
        BadInputError: there is no such vehicle file.
    """

    vehicle = _vehicle_file_of(model, prior)
    if vehicle is None:
        return Spec()
    tail = read_vehicle(vehicle).tailcone
    return Spec(travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)


def _vehicle_file_of(model: IdentifiedModel, prior: str | None) -> str | None:
    """The vehicle file behind a model; None where it is not shipped and nobody gives it."""

    return prior or (model.vehicle.prior if model.vehicle.prior in SHIPPED else None)


def _initial_gains_of(model: IdentifiedModel, prior: str | None) -> dict[str, float]:
    """What the vehicle flew with first: Table 3's gains on Caribou, on others the prototype of
    their file."""

    vehicle, table_3 = _vehicle_file_of(model, prior), initial_gains()
    if vehicle is None or vehicle in prototype.CARIBOU:
        return table_3
    first = prototype.design(vehicle).parameters
    return {name: first[name] for name in table_3}


def _reasons(model: IdentifiedModel) -> str:
    if model.verdict is None:
        return "nobody has judged it"
    first, *others = model.verdict.reasons
    return f"{first} (and {len(others)} more)" if others else first


def read_log(path: Path) -> Log:
    """Read a log for identification. Raises BadInputError."""

    with _translate_errors():
        return readers.read(path)


def tracking(log: Log) -> dict[str, Any]:
    """Steady errors over a dive and over each window between changes of set-point, as plain numbers
    by name.

    Raises:
        FailedError: no stretch of the dive was steady for long enough.
    """

    found = tracking_metrics.tracking(log)
    if found is None:
        raise OperationError(f"{log.name}: no stretch of constant set-points outlasts its settling")
    plain: dict[str, Any] = _to_plain(found)
    return plain


def monitor_log(log: Log, promise: PerformanceBaseline) -> MonitorReport:
    """How a dive kept what her gains promise."""

    return monitor.monitor_log(log, promise)


def read_model(path: Path) -> IdentifiedModel:
    """Read a model file. Raises BadInputError."""

    with _translate_errors():
        return model_file.read(path)


def sha256_of_model(path: Path) -> str:
    """By which gains name the model in a file. Raises BadInputError."""

    return model_file.sha256_of_model(read_model(path))


def read_vehicle(prior: str) -> Any:
    """What a vehicle file tells beforehand, as sysid takes it. Raises BadInputError."""

    with _translate_errors():
        return fitting.vehicle_file(prior)


def write_model(model: IdentifiedModel, path: Path) -> None:
    """Write ``model.json``."""

    model_file.write(model, path)


@contextmanager
def _translate_errors() -> Iterator[None]:
    """sysid's refusals as this tool's: wrong files are bad input, a missed specification is failed
    work."""

    try:
        yield
    except LinAlgError as error:
        raise OperationError(f"the model is singular: {error}; fly more tests and refit") from None
    except (BenchResultError, LogError, ModelError, RefitError, VehicleFileError) as error:
        raise InputError(str(error)) from None
    except (DesignInfeasibleError, FitFailedError, NotUniqueError) as error:
        raise OperationError(str(error)) from None


def _to_plain(value: Any) -> Any:
    """Named tuples as dictionaries, all the way down."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {name: _to_plain(part) for name, part in value._asdict().items()}
    return [_to_plain(part) for part in value] if isinstance(value, tuple) else value
