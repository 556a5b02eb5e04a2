"""`ground live`: show a vehicle live in a browser; and the page of `--live` in other commands."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Sign, refuse_empty, remark

if TYPE_CHECKING:
    from ground.live.page.feed import PageProcess
    from ground.live.session import LiveSession

Live = Annotated[
    bool,
    typer.Option("--live", help="Show the flight live in a browser; the address is printed."),
]
Browser = Annotated[
    bool,
    typer.Option(
        "--browser/--no-browser",
        help="Open the page in a browser. Without a display the address is printed only.",
    ),
]


def live(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
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
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address of the interface that serves the page; another one than the loopback"
            " lets everyone on that network watch.",
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(
            min=1, max=65_535, help="Port of the page. Default: 8750, or a free one if it is used."
        ),
    ] = None,
    browser: Browser = True,
) -> None:
    """Show any MAVLink vehicle live in a browser: attitude, map, charts, texts; Ctrl-C ends.

    The page only shows: it sends no command. All its files come from this program.
    """
    from ground.live.page import session

    session.live(
        connect,
        sign,
        host=host,
        port=port,
        announce=lambda address: announce(address, browser=browser),
        estimator=_estimator(prior) if prior else None,
    )


def _estimator(prior: str) -> "LiveSession":
    """Return the live estimate of a vehicle from its prior. Raises InputError."""
    from ground.live.session import LiveSession

    estimator = LiveSession(prior)
    estimator.begin({})
    return estimator


def announce(address: str, *, browser: bool) -> None:
    """Print the address of a page, and open it in a browser if asked and possible."""
    from ground.live.page.session import open_browser

    remark(f"live page: {address}")
    if browser and not open_browser(address):
        remark("no display here: open the address in a browser on this machine")


@contextmanager
def page_process(*, live: bool, browser: bool = False) -> "Iterator[PageProcess | None]":
    """Serve the page in a process of its own while the work lasts; nothing without `live`."""
    if not live:
        yield None
        return
    from ground.live.page import server
    from ground.live.page.feed import PageProcess

    listener = server.listen()
    address = server.url(listener)
    with PageProcess(listener) as page:
        announce(address, browser=browser)
        yield page
