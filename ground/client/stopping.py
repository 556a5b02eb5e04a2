"""End or hold a dive, arm, and describe the vehicle that an interrupted program leaves behind."""

import shlex
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from ground.client.vehicle import VehicleClient, VehicleClientError
from mavlink_io.errors import OperationError

SURFACE, HOLD = "SURFACE", "HOLD"
CONFIRM_TIMEOUT_S = 5.0
"""Wall time in which a HEARTBEAT must report the mode that the vehicle has accepted; it sends one
per second. Over a modem it is longer (`VehicleClient.link_timeout_s`)."""


class State(NamedTuple):
    """State of the vehicle according to its last messages."""

    mode: str
    armed: bool
    depth_m: float | None

    def format_text(self) -> str:
        """Return the state as a sentence."""
        if not self.armed:
            return f"the vehicle is disarmed, in mode {self.mode}"
        depth = "" if self.depth_m is None else f", {self.depth_m:.1f} m deep"
        return f"the vehicle is under way in mode {self.mode}{depth}"


def state(vehicle: VehicleClient) -> State:
    """Return the state of the vehicle according to its last messages."""
    position = vehicle.latest("LOCAL_POSITION_NED")
    return State(vehicle.mode, vehicle.armed, position.z if position else None)


def enter(vehicle: VehicleClient, mode: str) -> State:
    """Set a mode by name, and wait until a HEARTBEAT confirms it.

    Parameters
    ----------
    vehicle : VehicleClient
        A connected vehicle.
    mode : str
        Name of the mode as the vehicle lists it; upper and lower case are equal.

    Returns
    -------
    State
        State in the new mode; disarmed if the mode ended the dive at once.

    Raises
    ------
    VehicleClientError
        The vehicle does not offer the mode, refused it, or was lost.
    OperationError
        The vehicle accepted the mode, but its HEARTBEAT reports another one.
    """
    offered = vehicle.offered_modes()
    name = next((name for name in offered if name.upper() == mode.upper()), mode)
    was_armed, heartbeats = vehicle.armed, vehicle.heartbeats
    vehicle.set_mode(name)

    def is_confirmed() -> bool:
        ended = was_armed and not vehicle.armed
        return vehicle.heartbeats > heartbeats and (vehicle.custom_mode == offered[name] or ended)

    timeout_s = vehicle.link_timeout_s(CONFIRM_TIMEOUT_S)
    if not vehicle.pump_until(is_confirmed, timeout_s):
        raise OperationError(
            f"mode {name}: the vehicle accepted it, but {timeout_s:g} s later reports"
            f" {vehicle.mode}"
        )
    return state(vehicle)


def arm(vehicle: VehicleClient) -> State:
    """Arm in the present mode, and wait until a HEARTBEAT confirms it.

    Raises
    ------
    VehicleClientError
        The vehicle refused, or was lost.
    OperationError
        The vehicle accepted the command, but its HEARTBEAT reports that it is disarmed.
    """
    vehicle.arm()
    return _confirm(vehicle, "armed", lambda: vehicle.armed)


def disarm(vehicle: VehicleClient) -> State:
    """Disarm, also under way, and wait until a HEARTBEAT confirms it.

    Raises
    ------
    VehicleClientError
        The vehicle refused, or was lost.
    OperationError
        The vehicle accepted the command, but its HEARTBEAT reports that it is armed.
    """
    vehicle.disarm(force=True)
    return _confirm(vehicle, "disarmed", lambda: not vehicle.armed)


def _confirm(vehicle: VehicleClient, wanted: str, is_reached: Callable[[], bool]) -> State:
    """Wait until a HEARTBEAT reports the wanted state."""
    timeout_s = vehicle.link_timeout_s(CONFIRM_TIMEOUT_S)
    if not vehicle.pump_until(is_reached, timeout_s):
        raise OperationError(
            f"the vehicle accepted the command, but {timeout_s:g} s later it is not {wanted}"
        )
    with suppress(VehicleClientError):  # the state shows the number of a mode without a name
        vehicle.offered_modes()
    return state(vehicle)


def wait_until_disarmed(vehicle: VehicleClient, watch: Callable[[State], None]) -> State:
    """Wait without a time limit until a surfacing vehicle has disarmed itself.

    Raises
    ------
    VehicleClientError
        The vehicle was lost.
    OperationError
        The vehicle left the mode while it was armed, so it no longer surfaces.
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


def describe_remaining_state(vehicle: VehicleClient, address: str, key_file: Path | None) -> str:
    """Return in which state a program leaves the vehicle, and which commands stop it.

    Parameters
    ----------
    vehicle : VehicleClient
        The vehicle, connected or not; nothing is sent or received.
    address : str
        The address that `--connect` takes.
    key_file : Path, optional
        The file that `--sign` takes.

    Returns
    -------
    str
        One line; empty if the vehicle was never found.
    """
    if vehicle.vehicle_id is None:
        return ""
    if not vehicle.armed and not vehicle.arm_requested:
        return "the vehicle is disarmed"
    link = f"--connect {shlex.quote(address)}" + (
        f" --sign {shlex.quote(str(key_file))}" if key_file else ""
    )
    status = f"is still under way in mode {vehicle.mode}" if vehicle.armed else "was about to arm"
    rising = vehicle.armed and vehicle.mode == SURFACE
    surface = "" if rising else f"`ground surface {link}` ends the dive, "
    return f"the vehicle {status}: {surface}`ground hold {link}` keeps depth, heading and thrust"
