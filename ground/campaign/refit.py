"""From logs to a model and from a model to gains, as the command line and the campaign ask for it.

The work is sysid's; here its refusals become this tool's.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ground.errors import BadInputError, FailedError

if TYPE_CHECKING:
    from sysid.data.dataset import Log
    from sysid.data.segments import Mark
    from sysid.design.lqg import LawDesign
    from sysid.design.pid import Design, Spec
    from sysid.models.model_file import IdentifiedModel
    from sysid.monitor import Kept
    from sysid.monitor.performance_spec import Promise

Method = Literal["map", "paper", "output-error", "filter-error"]
LARGEST_TRIM_DEG = 15.0


def initial_gains() -> dict[str, float]:
    """The prototype's gains: the initial column of the paper's Table 3."""
    from sysid.reproduction import paper_tables

    return dict(paper_tables.TABLE_3_INITIAL)


def improved_gains() -> dict[str, float]:
    """What the paper's engineers came to: the improved column of its Table 3."""
    from sysid.reproduction import paper_tables

    return dict(paper_tables.TABLE_3_IMPROVED)


def measure_trims(path: Path, window_s: float) -> dict[str, float]:
    """What rudder and elevator had to be, on average, over the last ``window_s`` of a straight and
    level mission.

    Raises:
        FailedError: the flight was not steady, or would take more than the duct's travel.
    """
    import numpy as np

    log = read_log(path)
    ends = [event.time_s for event in log.events if event.text == "Mode SURFACE"]
    if not ends:
        raise FailedError(f"{path}: the mission did not end with the vehicle surfacing")
    time_s = log.actuators.time_s
    window = (time_s > ends[0] - window_s) & (time_s <= ends[0])
    trims = {
        "TRIM_RUD_DEG": float(np.degrees(np.mean(log.actuators.rudder_rad[window]))),
        "TRIM_ELE_DEG": float(np.degrees(np.mean(log.actuators.elevator_rad[window]))),
    }
    for name, value in trims.items():
        if not abs(value) < LARGEST_TRIM_DEG:
            raise FailedError(
                f"{path}: {name} would be {value:.1f} deg, beyond the duct's"
                f" {LARGEST_TRIM_DEG:g} deg"
            )
    return {name: round(value, 3) for name, value in trims.items()}


def refit(
    paths: Sequence[Path],
    held_out: Sequence[Path] = (),
    prior: str = "bench",
    method: Method = "map",
    progress: Callable[[str, float], None] | None = None,
    marked: Sequence[str] = (),
    outputs: str = "1,2,3",
    beside: Sequence[Method] = (),
    tailcone: Path | None = None,
    inclining: Path | None = None,
    *,
    force: bool = False,
) -> "IdentifiedModel":
    """The model that explains the tests in the logs.

    Raises:
        BadInputError: of the logs, the prior or what was measured ashore.
        FailedError: the fit cannot be believed, unless ``force``; the model then says so itself.
    """
    from sysid import refit as fitting
    from sysid.data.readers import servo_channels as chosen

    with _translated():
        model = fitting.refit(
            list(paths),
            prior=prior,
            method=method,
            held_out=list(held_out),
            progress=progress,
            marks=[_mark(text) for text in marked],
            outputs=chosen.parse(outputs),
            beside=beside,
            tailcone=tailcone,
            inclining=inclining,
        )
    if model.convergence.failures and not force:
        reasons = "; ".join(model.convergence.failures)
        raise FailedError(
            f"the fit failed: {reasons}; `ground refit --force` writes it all the same"
        )
    return model


def _mark(text: str) -> "Mark":
    """A test by hand, ``[LOG:]START..STOP:rudder`` or ``:elevator``, in seconds of the log's own
    time."""
    from sysid.data.segments import Mark

    found = re.fullmatch(r"(?:(.+):)?(\d+\.?\d*)\.\.(\d+\.?\d*):(rudder|elevator)", text)
    if found is None:
        raise BadInputError(
            f"--run {text}: give [LOG:]START..STOP:rudder or :elevator, in seconds of the log's"
            " time"
        )
    return Mark(
        float(found[2]), float(found[3]), "yaw" if found[4] == "rudder" else "pitch", found[1] or ""
    )


def redesign(
    model: "IdentifiedModel",
    spec: "Spec | None" = None,
    prior: str | None = None,
    *,
    force: bool = False,
) -> "Design":
    """Gains for a model, by default asked for what ``specification`` says.

    ``prior``: the vehicle file it was refitted from, where that is not shipped.

    Raises:
        BadInputError: there is no such vehicle file. FailedError: its verdict is against it, unless
        ``force``; or no gains meet the specification.
    """
    from sysid.design import pid

    _refuse_unfit(model, "redesign", force)
    with _translated():
        spec, vehicle = spec or specification(model, prior), read_vehicle(prior) if prior else None
        return pid.redesign(model, spec, vehicle, _gains_before(model, prior))


def laws(
    model: "IdentifiedModel",
    spec: "Spec | None" = None,
    prior: str | None = None,
    *,
    force: bool = False,
) -> "LawDesign":
    """LQG laws for a model; otherwise as ``redesign``."""
    from sysid.design import lqg

    _refuse_unfit(model, "laws", force)
    with _translated():
        return lqg.design_laws(
            model, spec, read_vehicle(prior) if prior else None, _gains_before(model, prior)
        )


def _refuse_unfit(model: "IdentifiedModel", command: str, force: bool) -> None:
    if not force and (model.verdict is None or not model.verdict.fit_for_redesign):
        advice = f"fly what it asks for, or `ground {command} --force`"
        raise FailedError(f"the model is not fit for redesign: {_reasons(model)}; {advice}")


def specification(model: "IdentifiedModel", prior: str | None = None) -> "Spec":
    """What is asked of gains by default, within the travel and rate of the vehicle's own tailcone,
    where it is known.

    Raises:
        BadInputError: there is no such vehicle file.
    """
    from sysid.design.pid import Spec

    vehicle = _known_vehicle(model, prior)
    if vehicle is None:
        return Spec()
    tail = read_vehicle(vehicle).tailcone
    return Spec(travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)


def _known_vehicle(model: "IdentifiedModel", prior: str | None) -> str | None:
    """The vehicle file behind a model; None where it is not shipped and nobody gives it."""
    from sysid.refit import SHIPPED

    return prior or (model.vehicle.prior if model.vehicle.prior in SHIPPED else None)


def _gains_before(model: "IdentifiedModel", prior: str | None) -> dict[str, float]:
    """What the vehicle flew with first: Table 3's gains on Caribou, on others the prototype of
    their file."""
    from ground.campaign import prototype

    vehicle, table_3 = _known_vehicle(model, prior), initial_gains()
    if vehicle is None or vehicle in prototype.CARIBOU:
        return table_3
    first = prototype.design(vehicle).parameters
    return {name: first[name] for name in table_3}


def _reasons(model: "IdentifiedModel") -> str:
    if model.verdict is None:
        return "nobody has judged it"
    first, *others = model.verdict.reasons
    return f"{first} (and {len(others)} more)" if others else first


def read_log(path: Path) -> "Log":
    """Read a log for identification. Raises BadInputError."""
    from sysid.data import readers

    with _translated():
        return readers.read(path)


def tracking(log: "Log") -> dict[str, Any]:
    """Steady errors over a dive and over each window between changes of set-point, as plain numbers
    by name.

    Raises:
        FailedError: no stretch of the dive was steady for long enough.
    """
    from sysid.monitor import tracking_metrics

    found = tracking_metrics.tracking(log)
    if found is None:
        raise FailedError(f"{log.name}: no stretch of constant set-points outlasts its settling")
    plain: dict[str, Any] = _plain(found)
    return plain


def kept(log: "Log", promise: "Promise") -> "Kept":
    """How a dive kept what her gains promise."""
    from sysid import monitor

    return monitor.of_log(log, promise)


def read_model(path: Path) -> "IdentifiedModel":
    """Read a model file. Raises BadInputError."""
    from sysid.models import model_file as model

    with _translated():
        return model.read(path)


def digest(path: Path) -> str:
    """By which gains name the model in a file. Raises BadInputError."""
    from sysid.models import model_file as model

    return model.digest(read_model(path))


def read_vehicle(prior: str) -> Any:
    """What a vehicle file tells beforehand, as sysid takes it. Raises BadInputError."""
    from sysid import refit as fitting

    with _translated():
        return fitting.vehicle_file(prior)


def write_model(model: "IdentifiedModel", path: Path) -> None:
    """Write ``model.json``."""
    from sysid.models import model_file as models

    models.write(model, path)


@contextmanager
def _translated() -> Iterator[None]:
    """sysid's refusals as this tool's: wrong files are bad input, a missed specification is failed
    work."""
    from numpy.linalg import LinAlgError

    from sysid.data.dataset import LogError
    from sysid.design.pid import DesignRefused
    from sysid.models.model_file import ModelError
    from sysid.refit import (
        AshoreError,
        FitFailedError,
        NotUniqueError,
        RefitError,
        VehicleError,
    )

    try:
        yield
    except LinAlgError as error:
        raise FailedError(f"the model is singular: {error}; fly more tests and refit") from None
    except (AshoreError, LogError, ModelError, RefitError, VehicleError) as error:
        raise BadInputError(str(error)) from None
    except (DesignRefused, FitFailedError, NotUniqueError) as error:
        raise FailedError(str(error)) from None


def _plain(value: Any) -> Any:
    """Named tuples as dictionaries, all the way down."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    return [_plain(part) for part in value] if isinstance(value, tuple) else value
