"""`ground surface`, `hold`, `stop`, `arm` and `mode`: change the state of a vehicle."""

from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.connection import connected
from ground.cli.options import (
    GROUND_LINK,
    Address,
    Json,
    Modem,
    Sign,
    VehicleId,
    print_result,
)

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

    with (
        connected(connect, sign, vehicle_id, modem) as vehicle,
        progress.display("surface") as display,
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

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        state = stopping.enter(vehicle, stopping.HOLD)
    _print_state(state, json)


def stop(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Stop the propeller at once: disarm, also under water.

    Only a buoyant vehicle comes up then. `ground surface` drives it to the surface.
    """
    from ground.client import stopping

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        state = stopping.disarm(vehicle)
    _print_state(state, json)


def arm(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Arm the vehicle in its present mode and wait for confirmation; the propeller may start.

    In mode MISSION the vehicle starts the mission that it holds. `ground fly` uploads a mission,
    arms and records.
    """
    from ground.client import stopping

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        state = stopping.arm(vehicle)
    _print_state(state, json)


def mode(
    name: Annotated[
        str | None,
        typer.Argument(help="Mode to set. Default: print the mode and those on offer."),
    ] = None,
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """Set a mode by its name and wait for confirmation; or print the mode of the vehicle."""
    from ground.client import stopping

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        if name is not None:
            _print_state(stopping.enter(vehicle, name), json)
            return
        offered = sorted(vehicle.offered_modes())
        state = stopping.state(vehicle)
    text = f"{state.format_text()}; it offers {', '.join(offered)}"
    print_result({**state._asdict(), "offered": offered}, text, json)


def _print_state(state: "State", json: bool) -> None:
    """Print the mode and state of the vehicle."""
    print_result(state._asdict(), state.format_text(), json)
