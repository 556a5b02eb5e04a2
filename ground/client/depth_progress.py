"""A dive whose vehicle is to change its depth, and does not."""

from pathlib import Path

from ground.client.stopping import SURFACE
from ground.client.vehicle import VehicleClient
from ground.missions.plans import Plan
from mavlink_io.errors import OperationError
from mavlink_io.mission_items import MavCmd

ASCENT_S = 1800.0
"""Vehicle time for an ascent, and for another change of depth, without progress. A vehicle that is
too heavy would be held near the surface by its propeller until its battery is weak."""
MIN_CHANGE_M = 0.2
"""Change beyond the least and the largest depth so far that counts as progress. A vehicle that only
moves up and down, in waves or by its propeller, makes it a few times at most."""


class DepthProgress:
    """Time since the last progress of a vehicle that waits for a depth.

    It waits in mode SURFACE and during a mission item that ends at a depth. All other items end by
    themselves, or move the vehicle to a place at an unknown distance.

    Parameters
    ----------
    plan : Plan
        Mission.
    log : Path
        Log of the dive, for the error message.
    """

    def __init__(self, plan: Plan, log: Path) -> None:
        self._log = log
        self._waiting = {
            item.sequence: place
            for item, place in zip(plan.items, plan.places, strict=True)
            if item.command == MavCmd.CONDITION_CHANGE_ALT
        }
        """Place of each item that ends at a depth, by its number."""
        self._awaited = ""
        self._since_s = self._least_m = self._largest_m = 0.0

    def update(self, vehicle: VehicleClient, vehicle_s: float) -> None:
        """Compare the depth with that of the calls before.

        Parameters
        ----------
        vehicle : VehicleClient
            The vehicle with its last messages.
        vehicle_s : float
            Vehicle time (s).

        Raises
        ------
        OperationError
            The vehicle has waited for `ASCENT_S` without progress.
        """
        position = vehicle.latest("LOCAL_POSITION_NED")
        depth_m = position.z if position else 0.0
        awaited = self._awaited_by(vehicle)
        has_changed = (
            depth_m < self._least_m - MIN_CHANGE_M or depth_m > self._largest_m + MIN_CHANGE_M
        )
        if awaited != self._awaited:
            self._awaited, self._since_s = awaited, vehicle_s
            self._least_m = self._largest_m = depth_m
        elif has_changed:
            self._since_s = vehicle_s
            self._least_m = min(self._least_m, depth_m)
            self._largest_m = max(self._largest_m, depth_m)
        if awaited and vehicle_s - self._since_s > ASCENT_S:
            raise OperationError(
                f"{depth_m:.1f} m deep in {awaited}, without a change of depth for {ASCENT_S:g} s:"
                " is the vehicle heavier than the water, or does it float up by itself? What was"
                f" recorded is kept in {self._log}"
            )

    def _awaited_by(self, vehicle: VehicleClient) -> str:
        """Return the mode or the item in which the vehicle waits for a depth; "" in others."""
        if vehicle.mode == SURFACE:
            return f"mode {SURFACE}"
        current = vehicle.latest("MISSION_CURRENT")
        if current is None or vehicle.mode != "MISSION":
            return ""
        return self._waiting.get(current.seq, "")
