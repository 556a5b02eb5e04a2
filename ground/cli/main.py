"""`ground`: the command line of the ground software.

Each command writes progress and remarks to stderr and its result to stdout. With --json the result
is one JSON object, and so is the code and message of an error. Exit status: 0 done, 1 the work
failed, 2 bad input, 130 interrupted by Ctrl-C. Ctrl-C is the normal end of `watch` and `live`: 0.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
from functools import partial
from io import TextIOWrapper
from typing import Annotated, Any, NoReturn

import typer

from ground.cli import (
    bench_test,
    campaign,
    demo,
    design_test,
    fly,
    inclining_test,
    live,
    log,
    missions,
    modes,
    paper,
    params,
    redesign,
    refit,
    replay,
    report,
    simulate,
    sweep,
    vehicle,
    vehicle_state,
    watch,
)
from ground.cli.options import CommandGroup, remark, say, to_json
from ground.errors import INTERRUPTED, Interrupted, UnsuccessfulError
from mavlink_io.errors import FAILED, CaribouError, InputError, OperationError, exit_with_error
from mavlink_io.host_check import exit_if_unsupported
from mavlink_io.parent_watch import on_end_signals
from mavlink_io.printable import printable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Number of threads of OpenBLAS. Set before numpy is loaded: a refit solves many small systems,
which run five times slower with more threads."""

GARBAGE_THRESHOLD = 5000
"""Number of new objects from which on Python collects garbage; its default is 700.

The libraries of a refit make 260,000 objects that live until the end. With the default, visiting
them again and again takes 18 % of the time to load them."""

HELP = """Fly vehicles, record their telemetry, identify models, redesign gains and report.

Progress goes to stderr and the result to stdout; --json prints the result, or an error, as one JSON
object. Exit status: 0 done, 1 the work failed, 2 bad input, 130 interrupted by Ctrl-C, which ends
watch and live with 0."""

app = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    # plain help: to load rich takes longer than all the rest of `ground --help`
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help=HELP,
)
app.add_typer(params.app, name="params")
app.add_typer(log.app, name="log")
app.add_typer(vehicle.app, name="vehicle")
app.add_typer(modes.app, name="modes")
app.add_typer(sweep.app, name="sweep")
app.command()(demo.demo)
app.command()(fly.fly)
app.command()(vehicle_state.surface)
app.command()(vehicle_state.hold)
app.command()(vehicle_state.stop)
app.command()(vehicle_state.arm)
app.command()(vehicle_state.mode)
app.command()(bench_test.bench_test)
app.command()(inclining_test.inclining_test)
app.command()(design_test.design_test)
app.command()(simulate.simulate)
app.command()(replay.replay)
app.command()(redesign.redesign)
app.command()(watch.watch)
app.command()(live.live)
app.command()(campaign.campaign)
app.command()(refit.refit)
app.command()(report.report)
app.command()(paper.paper)
app.command()(missions.missions)


def _print_version(requested: bool) -> None:
    """Print the version of the installed package and exit, if --version was given."""
    if requested:
        from importlib.metadata import version

        say(f"ground {version('caribou-auv')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Declare the options that `ground` takes before the name of a command."""


def main() -> None:
    """Run the command line; each known error becomes one line on stderr and an exit status."""
    exit_if_unsupported("ground")
    gc.set_threshold(GARBAGE_THRESHOLD)
    atexit.register(gc.freeze)  # or else Python visits all objects at the end: 0.5 s after a refit
    if isinstance(sys.stdout, TextIOWrapper):
        # escape letters that the encoding of stdout lacks
        sys.stdout.reconfigure(errors="backslashreplace")

    interruptions = list[Interrupted]()
    on_end_signals(partial(_interrupt, interruptions))
    try:
        _run()
    except (CaribouError, OSError) as problem:
        error = problem if isinstance(problem, CaribouError) else _classify(problem)
        if "--json" in sys.argv and not isinstance(error, UnsuccessfulError):
            say(to_json({"error": {"code": error.code, "message": str(error)}}))
        for note in getattr(problem, "__notes__", ()):
            remark(note)
        exit_with_error("ground", error)
    except Interrupted as interruption:
        _exit_interrupted(interruption)
    except Exception:
        if interruptions:  # a C extension that was loading made an ImportError of it
            _exit_interrupted(interruptions[0])
        raise


def _exit_interrupted(interruption: Interrupted) -> NoReturn:
    """Say on stderr that the command was interrupted, and exit."""
    notes = getattr(interruption, "__notes__", [])
    remark("; ".join(["interrupted; what was written is kept", *notes]))
    sys.exit(interruption.status)


def _run() -> None:
    """Run the command that the arguments name, and exit.

    A usage error quotes the arguments, so its control characters are escaped. That of a command
    without arguments is its help and quotes none.
    """
    # click.UsageError; typer imports or bundles click, depending on its version
    usage_error: type[Any] = typer.BadParameter.__bases__[0]
    try:
        sys.exit(app(standalone_mode=False))
    except usage_error as error:
        if error.ctx is None or error.message != error.ctx.get_help():
            error.message = printable(error.message)
        error.show()
        sys.exit(error.exit_code)


def _interrupt(interruptions: list[Interrupted], number: int, _frame: object) -> None:
    """Append and raise Interrupted; handler of SIGINT, SIGTERM and SIGHUP."""
    if number == signal.SIGHUP:
        # A closing terminal may send SIGHUP twice: the second must not interrupt the cleanup.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    interruptions.append(Interrupted(INTERRUPTED if number == signal.SIGINT else FAILED))
    raise interruptions[-1]


def _classify(error: OSError) -> InputError | OperationError:
    """Return an error of a file that the user named as InputError, any other as OperationError."""
    match error:
        case FileExistsError():
            return InputError(f"{error.filename}: exists; give a new name")
        case FileNotFoundError() | NotADirectoryError() | IsADirectoryError() | PermissionError():
            return InputError(f"{error.filename}: {error.strerror}")
        case OSError(errno=errno.ENAMETOOLONG | errno.ELOOP | errno.EROFS, filename=str()):
            return InputError(f"{error.filename}: {error.strerror}; give another name")
        case OSError(errno=errno.ENOSPC | errno.EDQUOT, filename=str()):
            return OperationError(
                f"{error.filename}: {error.strerror}; free space, or give a file on another disk"
            )
        case OSError(filename=str()):
            return OperationError(f"{error.filename}: {error.strerror}")
        case _:
            return OperationError(str(error))
