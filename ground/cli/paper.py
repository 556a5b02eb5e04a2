"""`ground paper`: rebuild the tables and figures of the paper and compare them."""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from ground.cli.options import Jobs, Json, Seed, print_result, refuse_given, to_json
from ground.errors import UnsuccessfulError
from mavlink_io.errors import InputError
from mavlink_io.user_data_dir import write_output


def paper(
    context: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write paper.html, paper.json, figures of Table 4 and the logs to this new or"
            " empty folder.",
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Use this finished campaign, flown with --include-paper-gains, instead of flying"
            " one.",
        ),
    ] = None,
    no_flights: Annotated[
        bool,
        typer.Option(
            "--no-flights",
            help="Compare only what follows from the printed numbers; takes seconds.",
        ),
    ] = False,
    seed: Seed = 1,
    jobs: Jobs = None,
    json: Json = False,
) -> None:
    """Rebuild Tables 1 to 5 and Figures 4 to 15 of the paper, each with its verdict.

    Exit status 1 if something that can be reproduced was not.
    """
    from ground.cli import progress
    from ground.paper import drawn, figure_rows, page, reproduction
    from ground.paper.flights import PaperRequest, fly
    from sysid.trials import usable_cores

    _check_folder(out)
    if no_flights:
        refuse_given(context, "--campaign --seed --jobs", "cannot be combined with --no-flights")
    with ExitStack() as stack:
        display = stack.enter_context(progress.display("paper"))
        if no_flights:
            curves, result = [], reproduction.reproduce()
        else:
            folder = out or Path(stack.enter_context(TemporaryDirectory(prefix="paper-")))
            request = PaperRequest(folder, campaign, seed, jobs or usable_cores())
            flights = fly(request, display.watch_named, display.announce)
            display.announce("comparing")
            fits = figure_rows.adjust_model(flights.campaign)
            result = reproduction.reproduce(flights, fits)
            curves = drawn.drawn(flights, fits) if out else []
    content = reproduction.as_json(result)
    if out is not None:
        from ground.report import poles

        out.mkdir(parents=True, exist_ok=True)
        write_output(out / "paper.json", to_json(content))
        poles.draw(result.poles, out)
        page.write(result, curves, out / "paper.html")
    print_result(content, reproduction.format_text(result), json)
    if result.failures:
        first, *others = result.failures
        more = f" and {len(others)} more" if others else ""
        raise UnsuccessfulError(f"not reproduced: {first}{more}")


def _check_folder(out: Path | None) -> None:
    """Raise InputError if the folder is a file or is not empty."""
    if out is None or not out.exists():
        return
    if not out.is_dir() or any(out.iterdir()):
        raise InputError(f"--out {out}: is not an empty folder; give a new name")
