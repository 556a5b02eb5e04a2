"""Length of a tick of vehicle time and its division into integration steps."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.tick import TICK_US

SUBSTEP_US = 5_000
SUBSTEP_S = SUBSTEP_US * 1e-6
"""Longest integration step."""


class Timestep(NamedTuple):
    """Tick length, and whether the IMU is sampled in every tick."""

    tick_us: int = TICK_US
    """Time from one sensor frame to the next; other autopilots have their own."""
    imu_every_tick: bool = False
    """Whether the IMU delivers a sample every tick instead of at its data sheet's rate."""

    @property
    def tick_s(self) -> float:
        """Length of a tick in seconds."""
        return self.tick_us * 1e-6

    @property
    def substeps(self) -> int:
        """Smallest number of equal integration steps of at most ``SUBSTEP_US``."""
        return -(-self.tick_us // SUBSTEP_US)

    @property
    def substep_s(self) -> float:
        """Length of an integration step in seconds."""
        return self.tick_s / self.substeps


DEFAULT_TIMESTEP = Timestep()
