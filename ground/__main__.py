"""``ground``: fly vehicles, keep what they say, refit, redesign and report.

Every command says what it does on stderr and gives its result on stdout; with --json that is one
JSON object. Exit status: 0 done, 1 the work failed, 2 bad input, 130 interrupted by Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
from enum import StrEnum
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import rich_utils

from ground.cli import (
    bench,
    fly,
    log,
    lqg,
    modes,
    params,
    redesign,
    stop,
)
from ground.cli import design_test as experiment_cli
from ground.cli import simulate as rehearsal_cli
from ground.cli import (
    vehicle as vehicle_cli,
)
from ground.cli.options import (
    GROUND_LINK,
    Address,
    Json,
    ScenarioName,
    Seed,
    Sign,
    Speed,
    VehicleName,
    print_result,
    remark,
    say,
    to_json,
)
from ground.errors import (
    BAD_INPUT,
    FAILED,
    INTERRUPTED,
    InputError,
    Interrupted,
    OperationError,
)
from mavlink_io.printable import printable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Set before numpy is loaded: refits solve many small systems, which threads of their own slow down
fivefold."""


class Method(StrEnum):
    """How to fit."""

    MAP = "map"
    PAPER = "paper"
    OUTPUT_ERROR = "output-error"
    FILTER_ERROR = "filter-error"


class Subject(StrEnum):
    """Of a picture."""

    RESULT = "result"
    MODEL = "model"


app = typer.Typer(
    add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__
)
app.add_typer(params.app, name="params")
app.add_typer(log.app, name="log")
app.add_typer(vehicle_cli.app, name="vehicle")
app.add_typer(modes.app, name="modes")
app.command()(fly.fly)
app.command()(stop.surface)
app.command()(stop.hold)
app.command()(bench.bench)
app.command()(bench.incline)
app.command()(experiment_cli.design_test)
app.command()(rehearsal_cli.rehearse)
app.command()(redesign.redesign)
app.command()(lqg.design_lqg)


@app.command()
def watch(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    once: Annotated[
        bool, typer.Option("--once", help="One look, then end; so too without a terminal.")
    ] = False,
    prior: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE|MODEL.json",
            help=(
                "Show the estimate of the vehicle under test, from this prior: caribou_nominal, a"
                " vehicle file, or a "
                "model.json. She is asked for 20 Hz of what that needs."
            ),
        ),
    ] = None,
    gains: Annotated[
        Path | None,
        typer.Option(
            metavar="GAINS.param",
            help="Show whether she keeps what these gains promise, which she flies.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Watch any MAVLink vehicle live, without being its ground station; Ctrl-C ends. --json is one
    look."""
    from ground.live.watch import session

    session.watch(connect, sign, once=once, json=json, prior=prior, gains=gains)


@app.command()
def campaign(
    vehicle: VehicleName = "caribou_truth",
    scenario: ScenarioName = "disturbed",
    seed: Seed = 1,
    speed: Speed = "max",
    beside_paper: Annotated[
        bool,
        typer.Option(
            "--beside-paper", help="Fly the missions with the paper's improved gains too."
        ),
    ] = False,
    out: Annotated[Path, typer.Option(metavar="DIR", help="The campaign's folder.")] = Path(
        "campaign"
    ),
    force: Annotated[
        bool, typer.Option("--force", help="Replace the campaign that the folder holds.")
    ] = False,
    json: Json = False,
) -> None:
    """Prototype, identify, redesign, verify: fly them all, and report."""
    from ground import progress
    from ground.campaign import summary
    from ground.campaign.run import Campaign, CampaignRequest

    with progress.display("campaign", quiet=json) as shown:
        asked = CampaignRequest(out, vehicle, scenario, seed, speed, beside_paper, force)
        result = Campaign(asked, shown.watch_named, shown.announce).run()
    print_result(result, summary.format_text(result, out), json)


@app.command()
def refit(
    logs: Annotated[
        list[Path],
        typer.Argument(help="Logs with rudder or elevator tests: .mcap, .tlog, .bin, .ulg."),
    ],
    held_out: Annotated[
        list[Path] | None, typer.Option(help="A log to predict and not to fit; repeatable.")
    ] = None,
    prior: Annotated[
        str, typer.Option(help="caribou_nominal, a vehicle file, or a model.json.")
    ] = "caribou_nominal",
    method: Annotated[
        Method, typer.Option(help="map; *-error: linear planes; paper: its own way.")
    ] = Method.MAP,
    run: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[LOG:]START..STOP:rudder|elevator",
            help="A test that no log tells of; repeatable.",
        ),
    ] = None,
    outputs: Annotated[
        str,
        typer.Option(
            metavar="RUDDER,ELEVATOR,THRUST", help="The outputs that steer, as in sitl --outputs."
        ),
    ] = "1,2,3",
    beside: Annotated[
        list[Method] | None,
        typer.Option(help="A method to set beside the model, on the same runs; repeatable."),
    ] = None,
    tailcone: Annotated[
        Path | None,
        typer.Option(metavar="BENCH.json", help="What `ground bench` measured, as a prior."),
    ] = None,
    inclining: Annotated[
        Path | None,
        typer.Option(metavar="INCLINE.json", help="What `ground incline` measured, as a prior."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Write a model whose fit failed; it says so.")
    ] = False,
    out: Annotated[Path, typer.Option(metavar="MODEL.json")] = Path("model.json"),
    json: Json = False,
) -> None:
    """Fit the model to the tests in logs, judge it, and say whether gains may be designed on it."""
    from ground import progress
    from ground.campaign import identification
    from ground.campaign import refit as fitting

    with progress.display("refit", quiet=json) as shown:
        model = fitting.refit(
            logs,
            held_out or (),
            prior,
            method.value,
            shown.share,
            run or (),
            outputs,
            [other.value for other in beside or ()],
            tailcone,
            inclining,
            force=force,
        )
    fitting.write_model(model, out)
    print_result(
        identification.summarise_model(model), identification.format_text(model, out), json
    )


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A campaign's folder.")],
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png|svg", help="Draw one picture instead.")
    ] = None,
    of: Annotated[Subject, typer.Option(help="What the picture shows.")] = Subject.RESULT,
) -> None:
    """Write report.html of a campaign, or one picture: of its result, or of the evidence for its
    model."""
    from ground.report import matplotlib_figures, page
    from ground.report import summary_picture as pictures

    draw = pictures.draw if of is Subject.RESULT else matplotlib_figures.draw
    say(str(draw(folder, picture) if picture else page.write(folder)))


@app.command()
def paper(
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Also write paper.json and pictures of Table 4's loops here."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """The paper's Tables 1 to 5 beside what this software derives, without flying."""
    from ground.report import paper_poles, paper_tables, poles

    found = paper_poles.compute()
    result = paper_tables.collect(found)
    words = paper_tables.format_text(result, found)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "paper.json").write_text(to_json(result), encoding="utf-8")
        words = "\n".join([words, "", *map(str, poles.draw(found, out))])
    print_result(result, words, json)


@app.command()
def missions(json: Json = False) -> None:
    """The missions that come with the tool."""
    from ground.missions import script

    shipped = {name: script.load(name) for name in script.shipped_names()}
    lines = [f"{name:18s} {script.duration_s(m):5.0f} s  {m.about}" for name, m in shipped.items()]
    result = {
        name: {"duration_s": script.duration_s(m), "about": m.about} for name, m in shipped.items()
    }
    print_result(result, "\n".join(lines), json)


def main() -> None:
    """The console command."""
    from mavlink_io.parent_watch import on_end_signals
    from mavlink_io.transport import AddressError

    if isinstance(sys.stdout, TextIOWrapper):
        # letters that stdout's encoding lacks are escaped too
        sys.stdout.reconfigure(errors="backslashreplace")

    on_end_signals(_interrupt)
    try:
        _run()
    except (InputError, AddressError) as error:
        _exit_with_error(error, BAD_INPUT)
    except FileExistsError as error:
        _exit_with_error(f"{error.filename}: exists; give a new name", BAD_INPUT)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError, PermissionError) as error:
        _exit_with_error(f"{error.filename}: {error.strerror}", BAD_INPUT)
    except (OperationError, OSError) as error:
        _exit_with_error(error, FAILED)
    except Interrupted as interruption:
        notes = getattr(interruption, "__notes__", [])
        _exit_with_error(
            "; ".join(["interrupted; what was recorded is kept", *notes]), interruption.status
        )


def _run() -> None:
    """Run the command that the arguments name, and exit. A usage error quotes arguments: escape
    it."""
    usage_error: type[Any] = typer.BadParameter.__bases__[
        0
    ]  # click's, which typer has under changing names
    try:
        sys.exit(app(standalone_mode=False))
    except usage_error as error:
        error.message = printable(error.message)
        rich_utils.rich_format_error(error)
        sys.exit(error.exit_code)


def _interrupt(number: int, frame: object) -> None:
    if number == signal.SIGHUP:
        # A terminal that closes may send it twice: the second must not interrupt the unwinding.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    raise Interrupted(INTERRUPTED if number == signal.SIGINT else FAILED)


def _exit_with_error(problem: object, status: int) -> None:
    remark(problem)
    sys.exit(status)


if __name__ == "__main__":
    main()
