"""The command: files and options become a belief and a request, and what was flown becomes a
table."""

import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import Json, ModelFile, Prior, Seed, print_result
from ground.errors import InputError, OperationError

if TYPE_CHECKING:
    from sysid.monte_carlo.study import SimulationSummary

PROCESSES = 2
MAX_DISTURBANCE_SCALE = 10.0


def rehearse(
    model: ModelFile,
    gains: Annotated[Path, typer.Option(metavar="GAINS.param", help="That are to go to sea.")],
    against: Annotated[
        list[Path] | None,
        typer.Option(metavar="OTHER.param", help="Gains to set beside them; repeatable."),
    ] = None,
    mission: Annotated[str, typer.Option(metavar="NAME|FILE", help="As for fly.")] = "combined",
    vehicles: Annotated[int, typer.Option(min=1, max=10_000, help="Drawn from the model.")] = 30,
    seed: Seed = 1,
    prior: Prior = None,
    sea: Annotated[
        str, typer.Option(metavar="1.0,1.5", help="Times the disturbance that the model found.")
    ] = "1.0",
    current: Annotated[
        float, typer.Option(metavar="M/S", min=0.0, max=5.0, help="Towards anywhere.")
    ] = 0.0,
    bias_shift: Annotated[
        float,
        typer.Option(
            metavar="DEG", min=-30.0, max=30.0, help="Of the rudder, since the model was made."
        ),
    ] = 0.0,
    json: Json = False,
) -> None:
    """Fly a mission beforehand with vehicles drawn from a model, under its gains and others, in the
    same seas.

    Exit status 1 where a vehicle diverges, broaches or does not come to the end.
    """
    from ground import progress
    from ground.campaign import refit
    from ground.client import param_file as gain_files
    from ground.missions import plans
    from ground.report import simulation
    from mavlink_io.clock import wall_s
    from sysid.monte_carlo import samples, study
    from sysid.monte_carlo.simulate import Sea

    files = name_gain_sets([gains, *(against or ())])
    seas = tuple(Sea(times, current, math.radians(bias_shift)) for times in _parse_scales(sea))
    sets = {name: gain_files.load(path) for name, path in files.items()}
    items, began_s = plans.load_items(mission), wall_s()
    with _translate_errors(mission), progress.display("rehearse", quiet=json) as shown:
        belief = samples.read(model, refit.read_vehicle(prior) if prior else None)
        request = study.StudyRequest(items, sets, seas, vehicles, seed, PROCESSES)

        def report(share: float, vehicle_s: float) -> None:
            shown.share(
                f"{vehicle_s:.0f} s, {vehicle_s / (wall_s() - began_s):.0f} a second", share
            )

        told = study.simulate_samples(belief, request, report)
    if not json:
        vehicle_s = sum(one.vehicle_s for one in told)
        each = vehicle_s / (wall_s() - began_s)
        print(
            f"{vehicle_s:.0f} vehicle seconds, {each:.0f} in a second of the clock", file=sys.stderr
        )
    print_result(
        simulation.as_json(told, Path(mission).stem, seed),
        simulation.format_text(told, Path(mission).stem),
        json,
    )
    _raise_if_any_failed(told)


def name_gain_sets(paths: Sequence[Path]) -> dict[str, Path]:
    """Sets by the name of their file, by the whole path where two have one name. Raises
    BadInputError."""
    short = [path.name for path in paths]
    names = [str(path) if short.count(path.name) > 1 else path.name for path in paths]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise InputError(f"--against {twice}: is given twice; give other gains")
    return dict(zip(names, paths, strict=True))


def _parse_scales(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if (
        not found
        or not all(0.0 <= times <= MAX_DISTURBANCE_SCALE for times in found)
        or len(set(found)) < len(found)
    ):
        raise InputError(
            f"--sea {text}: must be different numbers from 0 to {MAX_DISTURBANCE_SCALE:g}, "
            "with commas between them"
        )
    return found


def _raise_if_any_failed(told: "Sequence[SimulationSummary]") -> None:
    from ground.report import simulation

    failed = [one for one in told if one.failed]
    if failed:
        raise OperationError(
            simulation.verdict(failed[0])
            + (f"; {len(failed) - 1} more failed" if len(failed) > 1 else "")
        )


@contextmanager
def _translate_errors(mission: str) -> Iterator[None]:
    """sysid's refusals as this tool's."""
    from sysid.models.model_file import ModelError
    from sysid.monte_carlo.samples import NoCovarianceError
    from sysid.monte_carlo.simulate import MissionRejectedError
    from sysid.monte_carlo.study import GainsError

    try:
        yield
    except MissionRejectedError as error:
        raise InputError(f"{mission}: {error}") from None
    except (GainsError, ModelError, NoCovarianceError) as error:
        raise InputError(str(error)) from None
