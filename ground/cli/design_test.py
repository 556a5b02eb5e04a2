"""`ground design-test`: choose identification tests and write them as missions and parameters."""

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import Json, Seed, print_result, refuse_empty, refuse_given, refuse_nan
from ground.output_files import new_file
from mavlink_io.errors import InputError
from mavlink_io.user_data_dir import write_output

if TYPE_CHECKING:
    from sysid.test_design.safety_margins import ExcursionLimits

CRITERIA = ("d", "crossover")
MIN_DURATION_MIN, MAX_DURATION_MIN = 5.0, 600.0


def design_test(
    context: typer.Context,
    model: Annotated[
        Path | None, typer.Argument(metavar="MODEL.json", help="Model of an earlier refit.")
    ] = None,
    prior: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
            metavar="NAME|FILE",
            help="Vehicle file. Default: the one in MODEL.json; without a model caribou_nominal.",
        ),
    ] = None,
    duration: Annotated[
        float,
        typer.Option(metavar="MIN", help="Time of both dives with settling and recovery, min."),
    ] = 20.0,
    criterion: Annotated[
        str,
        typer.Option(
            help="d: D-optimal for all design numbers; crossover: the phase at the crossover."
        ),
    ] = "d",
    depth: Annotated[
        float, typer.Option(metavar="M", min=0.5, max=6000.0, help="Depth where tests begin, m.")
    ] = 6.0,
    min_depth: Annotated[
        float,
        typer.Option(callback=refuse_nan, metavar="M", help="Smallest depth allowed in a test, m."),
    ] = 1.0,
    water_depth: Annotated[
        float | None,
        typer.Option(callback=refuse_nan, metavar="M", help="Depth of the water, m, if known."),
    ] = None,
    min_altitude: Annotated[
        float,
        typer.Option(
            callback=refuse_nan,
            metavar="M",
            help="Smallest height above the floor allowed in a test, m.",
        ),
    ] = 3.0,
    max_depth_change: Annotated[
        float,
        typer.Option(
            metavar="M", min=0.1, max=50.0, help="Max change of depth in a test, up or down, m."
        ),
    ] = 2.0,
    heading: Annotated[
        float,
        typer.Option(
            metavar="DEG", min=5.0, max=180.0, help="Max change of heading in a test, deg."
        ),
    ] = 60.0,
    pitch: Annotated[
        float, typer.Option(metavar="DEG", min=2.0, max=60.0, help="Max pitch in a test, deg.")
    ] = 15.0,
    yaw_rate: Annotated[
        float,
        typer.Option(metavar="DEG/S", min=1.0, max=90.0, help="Max yaw rate in a test, deg/s."),
    ] = 10.0,
    pitch_rate: Annotated[
        float,
        typer.Option(metavar="DEG/S", min=1.0, max=90.0, help="Max pitch rate in a test, deg/s."),
    ] = 5.0,
    trim: Annotated[
        Path | None,
        typer.Option(
            metavar="LOG", help="Log of the mission `trim`, from which the trims are measured."
        ),
    ] = None,
    gains: Annotated[
        Path | None,
        typer.Option(
            metavar="GAINS.param",
            help="Gains on the vehicle. Default: the gains of its first dive.",
        ),
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            min=60, max=2000, help="Number of vehicles sampled from the prior to check each test."
        ),
    ] = 128,
    seed: Seed = 1,
    out: Annotated[
        Path,
        typer.Option(
            metavar="TESTS.toml",
            help="Mission to fit; NAME_heldout.toml and NAME.param are written next to it.",
        ),
    ] = Path("tests.toml"),
    json: Json = False,
) -> None:
    """Choose identification tests for a given duration, checked against limits by simulation.

    Each test is simulated on vehicles sampled from the prior.
    """
    from ground.cli import progress
    from ground.client import param_file
    from ground.test_design import files, format, session
    from ground.test_design.files import TestDive
    from sysid.test_design.plan import PlanRequest

    if water_depth is None:
        refuse_given(context, "--min-altitude", "needs --water-depth, the depth of the water")
    if out.suffix != ".toml":
        raise InputError(f"--out {out}: must end in .toml, as missions do")
    if criterion not in CRITERIA:
        raise InputError(f"--criterion {criterion}: must be one of {', '.join(CRITERIA)}")
    if not MIN_DURATION_MIN <= duration <= MAX_DURATION_MIN:
        raise InputError(
            f"--duration {duration:g}: must be {MIN_DURATION_MIN:g} to {MAX_DURATION_MIN:g} min"
        )
    paths = files.Files(*map(new_file, files.paths_beside(out)))
    design_prior = session.design_prior(model, prior, trim)
    vehicle_gains = param_file.load(gains) if gains else session.first_gains(design_prior)
    limits = _limits(
        depth,
        min_depth,
        water_depth,
        min_altitude,
        max_depth_change,
        (heading, pitch, yaw_rate, pitch_rate),
    )
    request = PlanRequest(
        test_time_s=60.0 * duration,
        criterion=criterion,
        limits=limits,
        samples=samples,
        seed=seed,
        gains=session.loop_gains(vehicle_gains),
    )
    with progress.display("design-test") as display:
        plan = session.plan_tests(design_prior, request, display.show_fraction)
    dive = TestDive(depth, 100.0 * design_prior.config.operating_point.thrust_fraction)
    about = f"Tests designed on {design_prior.name} for a test time of {duration:g} min"
    parameters = files.envelope(plan, limits, dive) | session.trims(design_prior) | vehicle_gains
    write_output(paths.tests, files.mission(plan.tests, dive, out.stem, about))
    held_out = files.mission(plan.held_out, dive, paths.held_out.stem, f"{about}: not to be fitted")
    write_output(paths.held_out, held_out)
    write_output(paths.envelope, files.parameter_file(parameters, out))
    written = {name: str(path) for name, path in paths._asdict().items()}
    notes = [
        f"{plan.test_time_s / 60.0:.1f} min of test time in two dives",
        shlex.join(["ground", "fly", str(paths.tests), "--params", str(paths.envelope)]),
        shlex.join(["ground", "fly", str(paths.held_out), "--params", str(paths.envelope)]),
    ]
    print_result(format.as_json(plan, written, parameters), format.format_text(plan, notes), json)


def _limits(
    depth_m: float,
    min_depth_m: float,
    water_depth_m: float | None,
    min_altitude_m: float,
    max_change_m: float,
    angles_deg: tuple[float, float, float, float],
) -> "ExcursionLimits":
    """Return the limits of a test that begins at `depth_m`. Raises InputError if none is left.

    `angles_deg`: heading change, pitch (deg), yaw rate and pitch rate (deg/s).
    """
    from sysid.test_design.safety_margins import ExcursionLimits

    up_m = min(max_change_m, depth_m - min_depth_m)
    down_m = (
        max_change_m
        if water_depth_m is None
        else min(max_change_m, water_depth_m - min_altitude_m - depth_m)
    )
    if up_m <= 0.0:
        raise InputError(f"--depth {depth_m:g}: must be deeper than --min-depth {min_depth_m:g}")
    if down_m <= 0.0:
        raise InputError(
            f"--depth {depth_m:g}: must be less than --water-depth minus --min-altitude, "
            f"{water_depth_m} - {min_altitude_m:g}"
        )
    heading, pitch, yaw_rate, pitch_rate = (math.radians(value) for value in angles_deg)
    return ExcursionLimits(
        heading_rad=heading,
        yaw_rate_radps=yaw_rate,
        pitch_rad=pitch,
        pitch_rate_radps=pitch_rate,
        up_m=up_m,
        down_m=down_m,
    )
