"""End or hold a dive that is under way, and say what an interrupted program leaves behind."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ground.client.vehicle import VehicleClient
from ground.errors import OperationError

SURFACE, HOLD = "SURFACE", "HOLD"
CONFIRM_WITHIN_S = 5.0
"""Wall time (s) in which a HEARTBEAT must show the mode that the vehicle has accepted: five of
them."""


class State(NamedTuple):
    """What the last messages report."""

    mode: str
    armed: bool
    depth_m: float | None

    def in_words(self) -> str:
        if not self.armed:
            return f"the vehicle is disarmed, in mode {self.mode}"
        depth = "" if self.depth_m is None else f", {self.depth_m:.1f} m deep"
        return f"the vehicle is under way in mode {self.mode}{depth}"


def state(vehicle: VehicleClient) -> State:
    """Return the state that the last messages report."""
    position = vehicle.latest("LOCAL_POSITION_NED")
    return State(vehicle.mode, vehicle.armed, position.z if position else None)


def enter(vehicle: VehicleClient, wanted: str) -> State:
    """Set a mode by the name that the vehicle gives it, and wait until its HEARTBEAT confirms it.

    Parameters
    ----------
    vehicle : Vehicle
        Connected.
    wanted : str
        The name of the mode; upper and lower case are the same.

    Returns
    -------
    State
        In the mode; or disarmed, where the mode has ended the dive at once.

    Raises
    ------
    VehicleError
        The vehicle does not offer the mode, refuses it, or went away.
    FailedError
        The vehicle accepted the mode, and its HEARTBEAT shows another one.
    """
    offered = vehicle.offered_modes()
    name = next((name for name in offered if name.upper() == wanted.upper()), wanted)
    was_armed, heard = vehicle.armed, vehicle.heartbeats
    vehicle.set_mode(name)

    def is_confirmed() -> bool:
        ended = was_armed and not vehicle.armed
        return vehicle.heartbeats > heard and (vehicle.custom_mode == offered[name] or ended)

    if not vehicle.pump_until(is_confirmed, CONFIRM_WITHIN_S):
        raise OperationError(
            f"mode {name}: the vehicle accepted it, and {CONFIRM_WITHIN_S:g} s later reports"
            f" {vehicle.mode}"
        )
    return state(vehicle)


def wait_until_disarmed(vehicle: VehicleClient, watch: Callable[[State], None]) -> State:
    """Wait until a vehicle that surfaces has disarmed itself, for as long as it takes.

    Raises
    ------
    VehicleError
        The vehicle went away.
    FailedError
        The vehicle has left the mode while it is armed: it no longer surfaces.
    """
    mode = vehicle.mode
    while vehicle.armed:
        vehicle.pump(0.05)
        watch(state(vehicle))
        if vehicle.armed and vehicle.mode != mode:
            raise OperationError(
                f"the vehicle has left {mode} for {vehicle.mode} and is still under way"
            )
    return state(vehicle)


def left_behind(vehicle: VehicleClient, address: str, key_file: Path | None) -> str:
    """Say in what state a program leaves a vehicle that it was flying, and which commands stop it.

    Parameters
    ----------
    vehicle : Vehicle
        Connected or not; nothing is sent or received.
    address : str
        The address that `--connect` takes.
    key_file : Path, optional
        The file that `--sign` takes.

    Returns
    -------
    str
        One line; empty where the vehicle was never found.
    """
    if vehicle.party is None:
        return ""
    if not vehicle.armed and not vehicle.arm_requested:
        return "the vehicle is disarmed"
    link = f"--connect {shlex.quote(address)}" + (
        f" --sign {shlex.quote(str(key_file))}" if key_file else ""
    )
    what = f"is still under way in mode {vehicle.mode}" if vehicle.armed else "was about to arm"
    return (
        f"the vehicle {what}: `ground surface {link}` ends the dive, "
        f"`ground hold {link}` keeps depth, heading and thrust"
    )
