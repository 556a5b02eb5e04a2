"""`ground watch`: show the telemetry of a vehicle live in the terminal."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign


def watch(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    once: Annotated[
        bool,
        typer.Option(
            "--once", help="Print the state once and exit; the default if stdout is no terminal."
        ),
    ] = False,
    prior: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE|MODEL.json",
            help=(
                "Show the estimate of the vehicle's dynamics during tests, from this prior:"
                " caribou_nominal, a vehicle file, or a model.json. Requests telemetry at 20 Hz."
            ),
        ),
    ] = None,
    gains: Annotated[
        Path | None,
        typer.Option(
            metavar="GAINS.param",
            help=(
                "Warn when performance leaves the range predicted for these gains, with which the"
                " vehicle flies."
            ),
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Watch any MAVLink vehicle live, without being its ground station; Ctrl-C ends.

    --json prints the state once.
    """
    from ground.live.watch import session

    session.watch(connect, sign, once=once, json=json, prior=prior, gains=gains)
