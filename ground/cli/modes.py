"""`ground modes`: list the modes of a vehicle, and export their names for MAVProxy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.connection import connected
from ground.cli.options import (
    GROUND_LINK,
    Address,
    CommandGroup,
    Json,
    Modem,
    Sign,
    VehicleId,
    print_result,
    refuse_given,
)
from mavlink_io.printable import printable

app = typer.Typer(
    cls=CommandGroup,
    invoke_without_command=True,
    help="List the modes of a vehicle, or export their names for MAVProxy.",
)


@app.callback()
def modes(
    context: typer.Context,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """List each mode that the vehicle reports, with its number (custom_mode)."""
    if (command := context.invoked_subcommand) is not None:
        refuse_given(
            context,
            "--connect --sign --vehicle-id --modem --json",
            f"stands before `{command}` and has no effect; give it after that word if"
            f" `ground modes {command} --help` lists it, or leave it out",
        )
        return
    with connected(connect, sign, vehicle_id, modem) as vehicle:
        offered = vehicle.modes()
    print_result(
        offered,
        "\n".join(f"{printable(name):16s} {number}" for name, number in offered.items()),
        json,
    )


MapFile = Annotated[
    Path | None,
    typer.Option(
        "--path", metavar="FILE", help="Mode map to extend. Default: the file that pymavlink reads."
    ),
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print what would be added, write nothing.")
]


@app.command()
def export_mavproxy(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    path: MapFile = None,
    dry_run: DryRun = False,
    json: Json = False,
) -> None:
    """Add the names of this vehicle's modes to the mode map of MAVProxy and other pymavlink tools.

    Names that are in the file already are kept.
    """
    with connected(connect, sign, vehicle_id, modem) as vehicle:
        offered = {printable(name): number for name, number in vehicle.modes().items()}
        kind = vehicle.kind
    _extend(path, kind, offered, dry_run=dry_run, json=json)


@app.command()
def install(path: MapFile = None, dry_run: DryRun = False, json: Json = False) -> None:
    """Add the names of Caribou's modes to the mode map of MAVProxy, without a vehicle.

    Names that are in the file already are kept.
    """
    from mavlink_io.dialect import constant
    from mavlink_io.vehicle_modes import VehicleMode

    offered = {mode.name: mode.value for mode in VehicleMode}
    _extend(path, constant("MAV_TYPE_SUBMARINE"), offered, dry_run=dry_run, json=json)


def _extend(
    path: Path | None, kind: int, offered: Mapping[str, int], *, dry_run: bool, json: bool
) -> None:
    """Add modes of a vehicle type to the mode map, and print what was added."""
    from ground.client import mode_map

    target = (path or mode_map.DEFAULT_PATH).expanduser()
    present = mode_map.read(target)
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
