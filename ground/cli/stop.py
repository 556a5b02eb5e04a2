"""``ground surface`` and ``ground hold``: commands for a vehicle that is under way."""

from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign, print_result

if TYPE_CHECKING:
    from ground.client.stopping import State


def surface(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait until the vehicle has disarmed itself.")
    ] = False,
    json: Json = False,
) -> None:
    """End a dive: set mode SURFACE, in which the vehicle rises and disarms itself, and confirm
    it."""
    from ground import progress
    from ground.client import stopping
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle, progress.display("surface", quiet=json) as shown:
        state = stopping.enter(vehicle, stopping.SURFACE)
        if wait:
            vehicle.on_text = shown.hear
            state = stopping.wait_until_disarmed(
                vehicle, lambda at: shown.share(at.in_words(), 0.0)
            )
    _give(state, json)


def hold(connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """Set mode HOLD, in which the vehicle keeps its depth, heading and thrust, and confirm it."""
    from ground.client import stopping
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        state = stopping.enter(vehicle, stopping.HOLD)
    _give(state, json)


def _give(state: "State", json: bool) -> None:
    print_result(state._asdict(), state.in_words(), json)
