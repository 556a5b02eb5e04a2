"""Options that several commands share, and functions that print results."""

import json
import math
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from typer.core import TyperGroup

from ground.rendered import Rendered
from mavlink_io.errors import FAILED, InputError, OperationError, exit_with_error
from mavlink_io.printable import printable, printable_lines


def refuse_empty(param: typer.CallbackParam, value: str | None) -> str | None:
    """Return the value of an option that may be left out. Raises InputError if it is empty."""
    if value == "":
        raise InputError(f"{param.opts[0]} '': is empty; give a value, or leave the option out")
    return value


def refuse_nan(param: typer.CallbackParam, value: float | None) -> float | None:
    """Return the value of an option without limits. Raises InputError for NaN."""
    if value is not None and math.isnan(value):
        raise InputError(f"{param.opts[0]} nan: give a number")
    return value


Address = Annotated[
    str,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        help="The vehicle's link: udpin:HOST:PORT, "
        "udpout:HOST:PORT, tcp:HOST:PORT, serial:DEVICE:BAUD.",
    ),
]
BenchAddress = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        help="Link to a real vehicle on the bench: serial:DEVICE:BAUD, udpin:HOST:PORT, ..."
        " Default: a simulated vehicle.",
    ),
]
Sign = Annotated[
    Path | None,
    typer.Option(
        "--sign", metavar="KEYFILE", help="Sign the link with the passphrase or key in this file."
    ),
]
VehicleId = Annotated[
    int | None,
    typer.Option(
        "--vehicle-id",
        min=1,
        max=255,
        metavar="SYSTEM",
        help="System id of the vehicle, where several are on the link. Default: the first one.",
    ),
]
Modem = Annotated[
    float | None,
    typer.Option(
        "--modem",
        min=1.0,
        max=3600.0,
        metavar="SECONDS",
        help="The link is a satellite or acoustic modem: repeat requests after SECONDS only.",
    ),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as one JSON object on stdout.")
]
VehicleName = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE",
        help="caribou_truth, caribou_nominal, remus100, xfin_auv, or a vehicle file.",
    ),
]
ScenarioName = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE", help="calm, disturbed, swell, estuary, under_ice, or a scenario file."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", min=1, metavar="N", help="Number of processes; default one a core."),
]
Speed = Annotated[
    str, typer.Option(metavar="N|max", help="Vehicle time as a multiple of real time.")
]
ModelFile = Annotated[
    Path, typer.Argument(metavar="MODEL.json", help="Model that `ground refit` wrote.")
]
Prior = Annotated[
    str | None,
    typer.Option(
        callback=refuse_empty,
        metavar="FILE",
        help="Vehicle file of the refit, in place of the one in the model.",
    ),
]
SpecFile = Annotated[
    Path | None,
    typer.Option(
        "--spec", metavar="FILE.toml", help="Limits of the specification, as `damping = 0.6`."
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Design even if the model is assessed as unfit for it.")
]
GROUND_LINK = "udpin:127.0.0.1:14550"
"""Default address of the link to the vehicle."""


def refuse_given(context: typer.Context, options: str, reason: str) -> None:
    """Refuse options that have no effect beside the others. Raises InputError for the first.

    Parameters
    ----------
    context : typer.Context
        Call of the command.
    options : str
        Names of the options, as `--seed --speed`.
    reason : str
        Why they have no effect, and what would be right.
    """
    for parameter in context.command.params:
        # typer has its own copy of click, whose enumeration is another object
        source = context.get_parameter_source(parameter.name or "")
        is_given = source is not None and source.name == "COMMANDLINE"
        if is_given and parameter.opts[0] in options.split():
            raise InputError(f"{parameter.opts[0]}: {reason}")


def refuse_unused_of_bench(context: typer.Context, connect: str | None) -> None:
    """Refuse the options of a simulated vehicle beside --connect, and those of a link without it.

    Raises InputError.
    """
    if connect:
        refuse_given(
            context,
            "--vehicle --seed --speed",
            "is for a simulated vehicle; leave it out, or leave out --connect",
        )
    else:
        refuse_given(
            context, "--sign --vehicle-id", "is for the link of --connect, which is not given"
        )


class CommandGroup(TyperGroup):
    """A group whose help shows the first sentence of each command, on as many lines as needed."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the table of commands; typer would cut the sentences at the end of the line."""
        rows = [
            (name, self.commands[name].get_short_help_str(limit=sys.maxsize))
            for name in self.list_commands(ctx)
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def print_result(result: dict[str, Any] | msgspec.Struct, text: str, as_json: bool) -> None:
    """Print a result on stdout, as text or as JSON."""
    say(to_json(result) if as_json else text)


def say(text: str) -> None:
    """Print text on stdout with control characters escaped, unless it is escaped already.

    Exits if stdout cannot be written: without a message if its reader has ended, as `head` does.
    """
    try:
        print(text if isinstance(text, Rendered) else printable_lines(text), flush=True)
    except BrokenPipeError:
        _discard_stdout()
        sys.exit(FAILED)
    except OSError as error:
        _discard_stdout()
        exit_with_error("ground", OperationError(f"stdout: {error.strerror}"))


def _discard_stdout() -> None:
    """Redirect stdout to the null device: Python writes the rest of its buffer at exit."""
    with Path(os.devnull).open("wb") as null:
        os.dup2(null.fileno(), sys.stdout.fileno())


def remark(message: object) -> None:
    """Print one line on stderr, with the name of this program in front."""
    print(f"ground: {printable(message)}", file=sys.stderr)


def remark_other_vehicle(model: str | Path, prior: str | None) -> None:
    """Remark a --prior of another vehicle than that of a model file. Raises InputError."""
    if prior is None:
        return
    from ground.campaign import refit

    own = refit.read_model(Path(model)).vehicle.file.name
    given = refit.read_vehicle(prior).name
    if given != own:
        remark(
            f"--prior {prior}: is the file of {given}, and {model} was identified from {own}: the"
            " parameters of the model are differences from its own file"
        )


def to_json(result: dict[str, Any] | msgspec.Struct) -> str:
    """Return a result as JSON in ASCII: control characters escaped, null for NaN and infinity."""
    text = json.dumps(result, default=_to_plain)
    plain = json.loads(text, parse_constant=lambda _: None)
    return json.dumps(plain, indent=1).replace("\x7f", "\\u007f")


def _to_plain(value: object) -> object:
    """Return a record as a dictionary, with null for infinity, and any other value as text."""
    if isinstance(value, msgspec.Struct):
        return msgspec.json.decode(msgspec.json.encode(value))
    return str(value)
