"""`ground sweep`: simulate thousands of dives over many inputs, and report on them."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ground.cli.options import CommandGroup, Jobs, Json, print_result, remark, say, to_json


class _RunByDefault(CommandGroup):
    """A group whose command is `run` if the first word is not the name of another one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `run` before the name of a plan."""
        if args and args[0] not in (*self.commands, "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_RunByDefault,
    no_args_is_help=True,
    help="Simulate dives over vehicles, gains, missions, seas and faults: `ground sweep PLAN`.",
)


@app.command("run")
def run(
    plan: Annotated[Path, typer.Argument(metavar="PLAN.toml", help="Plan of the sweep.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of the results. Default: the plan's name without .toml."
        ),
    ] = None,
    jobs: Jobs = None,
    engine: Annotated[
        str,
        typer.Option(
            metavar="local|dask=ADDRESS", help="Processes of this machine, or a dask cluster."
        ),
    ] = "local",
    dive: Annotated[
        int | None,
        typer.Option(metavar="N", help="Fly only this dive, print its row and write nothing."),
    ] = None,
    json: Json = False,
) -> None:
    """Fly the dives of a plan; those that the folder holds are not flown again."""
    from ground.cli import progress
    from ground.sweep import engine as engines
    from ground.sweep import plan_file
    from ground.sweep import run as sweeps
    from mavlink_io.clock import wall_s
    from sysid.trials import usable_cores

    chosen = engines.parse(engine)
    request, folder = plan_file.load(plan), out or plan.with_suffix("")
    if dive is not None:
        row = sweeps.fly_one(request, dive)
        if sweeps.stored_row(folder, dive) not in (None, row):
            remark(f"{folder}: has another row: the plan, its files or the source code changed")
        say(to_json(row) if json else sweeps.format_row(row))
        return
    start_s = wall_s()
    with progress.display("sweep") as display:

        def report(done: int, total: int) -> None:
            display.show_fraction(f"{done} of {total} dives", done / total)

        result = sweeps.run(
            request, folder, jobs=jobs or usable_cores(), engine=chosen, report=report
        )
    text = (
        f"{result['dives']} dives in {folder}, digest {result['digest'][:16]},"
        f" {wall_s() - start_s:.1f} s; `ground sweep report {folder}` evaluates them"
    )
    print_result({"folder": str(folder), **result}, text, json)


@app.command("report")
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a sweep.")],
    json: Json = False,
) -> None:
    """Write report.html and cells.csv of a sweep, and print pass probabilities and worst dives."""
    from ground.report import sweep

    result = sweep.write(folder)
    print_result(sweep.as_json(result), sweep.format_text(result, folder), json)
