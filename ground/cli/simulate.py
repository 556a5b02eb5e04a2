"""`ground simulate`: Monte-Carlo simulation of a mission on vehicles sampled from a model."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import (
    Jobs,
    Json,
    ModelFile,
    Prior,
    Seed,
    print_result,
    remark,
    remark_other_vehicle,
)
from ground.errors import UnsuccessfulError
from ground.output_files import refuse_same_file
from mavlink_io.errors import InputError

if TYPE_CHECKING:
    from sysid.monte_carlo.study import SimulationSummary

MAX_DISTURBANCE_SCALE = 10.0


def simulate(
    model: ModelFile,
    gains: Annotated[
        Path, typer.Option(metavar="GAINS.param", help="Gains of the simulated vehicles.")
    ],
    compare: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="OTHER.param",
            help="Gains to simulate on the same vehicles and seas; repeatable.",
        ),
    ] = None,
    mission: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="A mission, as for `ground fly`.")
    ] = "combined",
    samples: Annotated[
        int, typer.Option(min=1, max=10_000, help="Number of vehicles sampled from the model.")
    ] = 30,
    seed: Seed = 1,
    prior: Prior = None,
    disturbance_scale: Annotated[
        str,
        typer.Option(
            metavar="1.0,1.5", help="Factors on the disturbance that the model identified."
        ),
    ] = "1.0",
    current: Annotated[
        float,
        typer.Option(
            metavar="M/S", min=0.0, max=5.0, help="Speed of the current; its direction is random."
        ),
    ] = 0.0,
    bias_shift: Annotated[
        float,
        typer.Option(
            metavar="DEG",
            min=-30.0,
            max=30.0,
            help="Change of the rudder bias since the model was identified.",
        ),
    ] = 0.0,
    jobs: Jobs = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Append each finished dive to this file, and use those that it holds.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Simulate a mission with vehicles sampled from a model, and compare sets of gains.

    Exit status 1 if a vehicle diverges, broaches or does not complete the mission.
    """
    if keep is not None:
        refuse_same_file("--keep", keep, [model, gains, *(compare or ()), mission, prior])
    from ground.campaign import prototype, refit
    from ground.cli import progress
    from ground.client import param_file
    from ground.missions import plans
    from ground.report import simulation
    from mavlink_io.clock import wall_s
    from sysid.monte_carlo import samples as vehicle_samples
    from sysid.monte_carlo import study
    from sysid.monte_carlo.simulate import MissionRejectedError, Sea
    from sysid.trials import usable_cores

    files = name_gain_sets([gains, *(compare or ())])
    scales = _parse_scales(disturbance_scale)
    seas = tuple(Sea(scale, current, math.radians(bias_shift)) for scale in scales)
    loaded = {name: param_file.load(path) for name, path in files.items()}
    plan, start_s = plans.load(mission), wall_s()
    plans.check_local(mission, plan)
    remark_other_vehicle(model, prior)
    with progress.display("simulate") as display:
        posterior = vehicle_samples.read(model, refit.read_vehicle(prior))
        known = prototype.parameters_of(posterior)
        request = study.StudyRequest(
            items=plan.items,
            gains={name: {**known, **values} for name, values in loaded.items()},
            seas=seas,
            vehicles=samples,
            seed=seed,
            jobs=jobs or usable_cores(),
            keep=keep,
        )
        dives = len(loaded) * len(seas) * samples

        def report(fraction: float) -> None:
            display.show_fraction(f"{fraction * dives:.0f} of {dives} dives", fraction)

        try:
            summaries = study.simulate_samples(posterior, request, report)
        except MissionRejectedError as error:
            raise MissionRejectedError(f"{mission}: {error}") from None
    vehicle_s = sum(summary.vehicle_s for summary in summaries)
    rate = vehicle_s / (wall_s() - start_s)
    remark(f"{vehicle_s:.0f} vehicle seconds, {rate:.0f} per second of wall time")
    print_result(
        simulation.as_json(summaries, Path(mission).stem, seed),
        simulation.format_text(summaries, Path(mission).stem),
        json,
    )
    _raise_if_any_failed(summaries)


def name_gain_sets(paths: Sequence[Path]) -> dict[str, Path]:
    """Return the files by file name, or by whole path where two have the same file name.

    Raises InputError if a file is given twice.
    """
    file_names = [path.name for path in paths]
    names = [str(path) if file_names.count(path.name) > 1 else path.name for path in paths]
    duplicate = next((name for name in names if names.count(name) > 1), None)
    if duplicate:
        raise InputError(f"--compare {duplicate}: is given twice; give other gains")
    return dict(zip(names, paths, strict=True))


def _parse_scales(text: str) -> list[float]:
    """Return the numbers of --disturbance-scale. Raises InputError."""
    try:
        scales = [float(part) for part in text.split(",")]
    except ValueError:
        scales = []
    if (
        not scales
        or not all(0.0 <= scale <= MAX_DISTURBANCE_SCALE for scale in scales)
        or len(set(scales)) < len(scales)
    ):
        raise InputError(
            f"--disturbance-scale {text}: must be different numbers from 0 to "
            f"{MAX_DISTURBANCE_SCALE:g}, separated by commas"
        )
    return scales


def _raise_if_any_failed(summaries: "Sequence[SimulationSummary]") -> None:
    """Raise UnsuccessfulError, which describes the first vehicle that failed, if any did."""
    from ground.report import simulation

    failed = [summary for summary in summaries if summary.failed]
    if failed:
        raise UnsuccessfulError(
            simulation.describe_outcome(failed[0])
            + (f"; {len(failed) - 1} more failed" if len(failed) > 1 else "")
        )
