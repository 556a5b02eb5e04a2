"""`ground watch`: show the telemetry of a vehicle live in the terminal."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign, refuse_empty, refuse_given

if TYPE_CHECKING:
    from ground.live.listeners import Listeners


def watch(
    context: typer.Context,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    once: Annotated[
        bool,
        typer.Option(
            "--once",
            help="Print the state once and exit; the default if stdout is no (or a dumb) terminal.",
        ),
    ] = False,
    prior: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
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
    if once or json:
        refuse_given(context, "--prior --gains", "is for the live display, not for one state")
    from ground.live.watch import session

    session.watch(connect, sign, once=once, json=json, listener=_listeners(prior, gains))


def _listeners(prior: str | None, gains: Path | None) -> "Listeners | None":
    """Return the requested listeners, or None. Raises InputError."""
    from ground.live.listeners import Listeners, VisibleListener

    listeners: list[VisibleListener] = []
    if prior:
        from ground.live.session import LiveSession

        listeners.append(LiveSession(prior))
    if gains:
        from ground.client.param_file import require_baseline
        from ground.live.performance_monitor import PerformanceMonitor

        listeners.append(PerformanceMonitor(require_baseline(gains)))
    if not listeners:
        return None
    combined = Listeners(listeners)
    combined.begin({})
    return combined
