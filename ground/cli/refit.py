"""`ground refit`: identify a model from logs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from ground.cli.options import Json, print_result
from ground.output_files import check_output
from ground.rendered import Rendered


class FitMethod(StrEnum):
    """Method of identification."""

    MAP = "map"
    PAPER = "paper"
    OUTPUT_ERROR = "output-error"
    FILTER_ERROR = "filter-error"


def refit(
    logs: Annotated[
        list[Path],
        typer.Argument(help="Logs with rudder or elevator tests: .mcap, .tlog, .bin, .ulg, .csv."),
    ],
    held_out: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG", help="A log that is predicted but not fitted; repeatable."),
    ] = None,
    prior: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE|MODEL.json", help="caribou_nominal, a vehicle file, or a model.json."
        ),
    ] = "caribou_nominal",
    method: Annotated[
        FitMethod,
        typer.Option(
            help="map: nonlinear model with prior; output-error, filter-error: linear planes;"
            " paper: the paper's method."
        ),
    ] = FitMethod.MAP,
    segment: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[LOG:]START..STOP:rudder|elevator",
            help="Time range, s, of a test that the log does not mark; repeatable.",
        ),
    ] = None,
    servo_channels: Annotated[
        str | None,
        typer.Option(
            metavar="RUDDER,ELEVATOR,THRUST",
            help="Servo outputs, counted from 1, as in `sitl --outputs`. Default: found in the log"
            " by SERVOn_FUNCTION or PWM_MAIN_FUNCn, else 1,2,3.",
        ),
    ] = None,
    compare_method: Annotated[
        list[FitMethod] | None,
        typer.Option(help="Another method to fit on the same tests, for comparison; repeatable."),
    ] = None,
    bench_result: Annotated[
        Path | None,
        typer.Option(
            metavar="BENCH.json", help="Result of `ground bench-test --json`, used as a prior."
        ),
    ] = None,
    inclining_result: Annotated[
        Path | None,
        typer.Option(
            metavar="INCLINE.json",
            help="Result of `ground inclining-test --json`, used as a prior.",
        ),
    ] = None,
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Write the model even if the fit failed; the file records the failure."
            " Refused data stay refused.",
        ),
    ] = False,
    out: Annotated[Path, typer.Option(metavar="MODEL.json", help="Model to write.")] = Path(
        "model.json"
    ),
    json: Json = False,
) -> None:
    """Fit a model to the tests in logs, and assess whether gains may be designed on it."""
    check_output("--out", out, [*logs, *(held_out or ()), prior, bench_result, inclining_result])
    from ground.campaign import identification
    from ground.campaign import refit as refitting
    from ground.cli import progress
    from ground.report import second_opinion
    from sysid.data.readers.servo_channels import parse as parse_channels
    from sysid.refit import RefitRequest

    request = RefitRequest(
        paths=logs,
        held_out=held_out or (),
        prior=prior,
        method=method.value,
        alternative_methods=[other.value for other in compare_method or ()],
        marks=[refitting.parse_segment(text) for text in segment or ()],
        outputs=parse_channels(servo_channels) if servo_channels is not None else None,
        tailcone=bench_result,
        inclining=inclining_result,
    )
    with progress.display("refit") as display:
        model = refitting.refit(request, display.show_fraction, force=force)
    refitting.write_model(model, out)
    text = Rendered(
        f"{identification.format_text(model, out)}\n{second_opinion.format_text(model)}"
    )
    content = {
        **msgspec.json.decode(msgspec.json.encode(identification.summarise_model(model))),
        "second_opinion": {
            plane: validation.second_opinion for plane, validation in model.validation.items()
        },
    }
    print_result(content, text, json)
