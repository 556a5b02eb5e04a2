"""`ground refit`: identify a model from logs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import Json, print_result


class Method(StrEnum):
    """How to fit."""

    MAP = "map"
    PAPER = "paper"
    OUTPUT_ERROR = "output-error"
    FILTER_ERROR = "filter-error"


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
