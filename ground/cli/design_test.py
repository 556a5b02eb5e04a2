"""The command: what was asked becomes a belief and a request, and the plan becomes files."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import Json, Seed, new_file, print_result
from ground.errors import InputError

if TYPE_CHECKING:
    from sysid.test_design.safety_margins import ExcursionLimits

CRITERIA = ("d", "crossover")
TRIM_WINDOW_S = 60.0
"""Of the trim flight's end, as in a campaign."""
MIN_DURATION_MIN, MAX_DURATION_MIN = 5.0, 600.0


def design_test(
    model: Annotated[
        Path | None, typer.Argument(metavar="MODEL.json", help="What an earlier refit found.")
    ] = None,
    prior: Annotated[
        str, typer.Option(help="Without a model: caribou_nominal, or a vehicle file.")
    ] = "caribou_nominal",
    water_time: Annotated[
        float, typer.Option(metavar="MIN", help="Of both dives, settling and recovery included.")
    ] = 20.0,
    criterion: Annotated[
        str, typer.Option(help="d: all design numbers; crossover: the phase there.")
    ] = "d",
    depth: Annotated[
        float, typer.Option(metavar="M", min=0.5, max=6000.0, help="At which the tests begin.")
    ] = 6.0,
    ceiling: Annotated[
        float, typer.Option(metavar="M", help="Shallower than this no test may come.")
    ] = 1.0,
    floor: Annotated[
        float | None, typer.Option(metavar="M", help="Depth of the water, where it is known.")
    ] = None,
    clearance: Annotated[
        float, typer.Option(metavar="M", help="Closer to the floor no test may come.")
    ] = 3.0,
    depth_change: Annotated[
        float, typer.Option(metavar="M", min=0.1, max=50.0, help="Up or down in a test.")
    ] = 2.0,
    heading: Annotated[
        float, typer.Option(metavar="DEG", min=5.0, max=180.0, help="Turned in a test.")
    ] = 60.0,
    pitch: Annotated[
        float, typer.Option(metavar="DEG", min=2.0, max=60.0, help="Steepest in a test.")
    ] = 15.0,
    yaw_rate: Annotated[
        float, typer.Option(metavar="DEG/S", min=1.0, max=90.0, help="Fastest.")
    ] = 10.0,
    pitch_rate: Annotated[
        float, typer.Option(metavar="DEG/S", min=1.0, max=90.0, help="Fastest.")
    ] = 5.0,
    trim: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="Of the mission trim: where the surfaces stood."),
    ] = None,
    gains: Annotated[
        Path | None, typer.Option(metavar="GAINS.param", help="Aboard, if not the first dive's.")
    ] = None,
    samples: Annotated[
        int, typer.Option(min=60, max=2000, help="Vehicles that fly every test beforehand.")
    ] = 128,
    seed: Seed = 1,
    out: Annotated[
        Path,
        typer.Option(metavar="TESTS.toml", help="The mission; _heldout.toml, .param beside it."),
    ] = Path("tests.toml"),
    json: Json = False,
) -> None:
    """Plan the tests that tell most in a water time; every vehicle that is thought possible flies
    them beforehand."""
    from ground import progress
    from ground.client import param_file as gain_files
    from ground.test_design import files, format, session
    from ground.test_design.files import TestDive
    from sysid.test_design.plan import PlanRequest

    if out.suffix != ".toml":
        raise InputError(f"--out {out}: must end in .toml, as missions do")
    if criterion not in CRITERIA:
        raise InputError(f"--criterion {criterion}: must be one of {', '.join(CRITERIA)}")
    if not MIN_DURATION_MIN <= water_time <= MAX_DURATION_MIN:
        raise InputError(
            f"--water-time {water_time:g}: must be {MIN_DURATION_MIN:g} to {MAX_DURATION_MIN:g} min"
        )
    paths = files.Files(*map(new_file, files.paths_beside(out)))
    belief = session.design_prior(model or prior, trim, TRIM_WINDOW_S)
    aboard = gain_files.load(gains) if gains else session.first_gains(model, prior)
    limits = _limits(
        depth, ceiling, floor, clearance, depth_change, (heading, pitch, yaw_rate, pitch_rate)
    )
    request = PlanRequest(
        60.0 * water_time, criterion, limits, samples, seed, session.loop_gains(aboard)
    )
    with progress.display("design-test", quiet=json) as shown:
        plan = session.plan_tests(belief, request, shown.share)
    dive = TestDive(depth, 100.0 * belief.config.operating_point.thrust_fraction)
    about = f"Tests designed on {belief.name} for {water_time:g} min of water time"
    parameters = files.envelope(plan, limits, dive) | session.trims(belief) | aboard
    paths.tests.write_text(
        files.mission(plan.tests, dive, request, out.stem, about), encoding="utf-8"
    )
    held_out = files.mission(
        plan.held_out, dive, request, paths.held_out.stem, f"{about}: not to be fitted"
    )
    paths.held_out.write_text(held_out, encoding="utf-8")
    paths.envelope.write_text(files.parameter_file(parameters, out), encoding="utf-8")
    named = {name: str(path) for name, path in paths._asdict().items()}
    parts = [
        f"{plan.water_s / 60.0:.1f} min of water time in two dives",
        f"ground fly {paths.tests} --params {paths.envelope}",
        f"ground fly {paths.held_out} --params {paths.envelope}",
    ]
    print_result(format.as_json(plan, named, parameters), format.format_text(plan, parts), json)


def _limits(
    depth_m: float,
    ceiling_m: float,
    floor_m: float | None,
    clearance_m: float,
    change_m: float,
    degrees: tuple[float, float, float, float],
) -> "ExcursionLimits":
    from sysid.test_design.safety_margins import ExcursionLimits

    up_m = min(change_m, depth_m - ceiling_m)
    down_m = change_m if floor_m is None else min(change_m, floor_m - clearance_m - depth_m)
    if up_m <= 0.0:
        raise InputError(f"--depth {depth_m:g}: must be deeper than --ceiling {ceiling_m:g}")
    if down_m <= 0.0:
        raise InputError(
            f"--depth {depth_m:g}: must be above --floor less --clearance, {floor_m} -"
            f" {clearance_m:g}"
        )
    heading, pitch, yaw_rate, pitch_rate = (math.radians(value) for value in degrees)
    return ExcursionLimits(heading, yaw_rate, pitch, pitch_rate, up_m, down_m)
