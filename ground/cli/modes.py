"""`ground modes`: list the modes of a vehicle, and export their names for MAVProxy."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign, print_result
from mavlink_io.printable import printable

app = typer.Typer(
    invoke_without_command=True,
    help="List the modes of a vehicle, or export their names for MAVProxy.",
)


@app.callback()
def modes(
    context: typer.Context, connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False
) -> None:
    """List each mode that the vehicle reports, with its number (custom_mode)."""
    if context.invoked_subcommand is not None:
        return
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        offered = vehicle.modes()
    print_result(
        offered,
        "\n".join(f"{printable(name):16s} {number}" for name, number in offered.items()),
        json,
    )


@app.command()
def export_mavproxy(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    path: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Mode map to extend. Default: the file that pymavlink reads."
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would be added, write nothing.")
    ] = False,
    json: Json = False,
) -> None:
    """Add the names of this vehicle's modes to the mode map of MAVProxy and other pymavlink tools.

    Names that are in the file already are kept.
    """
    from ground.client import mode_map
    from ground.client.vehicle import connected

    target = (path or mode_map.DEFAULT_PATH).expanduser()
    present = mode_map.read(target)
    with connected(connect, sign) as vehicle:
        offered, kind = (
            {printable(name): number for name, number in vehicle.modes().items()},
            vehicle.kind,
        )
    change = mode_map.merge(present, kind, offered, target)
    if change.added and not dry_run:
        mode_map.write(target, change.merged)
    lines = [f"{target}: {'nothing' if not change.added else 'would add' if dry_run else 'added'}"]
    lines += [f"  {key} {printable(name)}" for key, name in change.added.items()]
    if change.added and str(kind) not in present:
        lines.append(
            f"  these replace pymavlink's own names for vehicles of type {kind}; delete {kind} to"
            " go back"
        )
    print_result(
        {"file": str(target), "added": change.added, "written": bool(change.added) and not dry_run},
        "\n".join(lines),
        json,
    )
