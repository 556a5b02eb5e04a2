"""`ground surface` and `ground hold`: set the mode of a vehicle during a dive."""

from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Modem, Sign, VehicleId, print_result

if TYPE_CHECKING:
    from ground.client.stopping import State


def surface(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait until the vehicle has disarmed itself.")
    ] = False,
    json: Json = False,
) -> None:
    """End a dive: set mode SURFACE and wait for confirmation; the vehicle rises and disarms."""
    from ground.cli import progress
    from ground.client import stopping
    from ground.client.vehicle import connected

    with (
        connected(connect, sign, vehicle_id, modem) as vehicle,
        progress.display("surface", quiet=json) as display,
    ):
        state = stopping.enter(vehicle, stopping.SURFACE)
        if wait:
            vehicle.on_text = display.show_text
            state = stopping.wait_until_disarmed(
                vehicle, lambda state: display.show_fraction(state.format_text(), 0.0)
            )
    _print_state(state, json)


def hold(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Set mode HOLD and wait for confirmation; the vehicle keeps depth, heading and thrust."""
    from ground.client import stopping
    from ground.client.vehicle import connected

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        state = stopping.enter(vehicle, stopping.HOLD)
    _print_state(state, json)


def _print_state(state: "State", json: bool) -> None:
    """Print the mode and state of the vehicle."""
    print_result(state._asdict(), state.format_text(), json)
