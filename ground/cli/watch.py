"""`ground watch`: show the telemetry of a vehicle live in the terminal."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign


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
