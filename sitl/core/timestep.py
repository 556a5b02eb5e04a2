"""The steps that vehicle time runs in."""

from __future__ import annotations

from typing import NamedTuple

TICK_US = 20_000
TICK_S = TICK_US * 1e-6
"""Of our own autopilot; others ask for steps of their own."""
SUBSTEP_US = 5_000
SUBSTEP_S = SUBSTEP_US * 1e-6


class Timestep(NamedTuple):
    """How long a tick is, and who speaks in each."""

    tick_us: int = TICK_US
    """From one frame of the instruments to the next."""
    brisk: bool = False
    """Whether the IMU speaks every tick, whatever rate her data sheet gives."""

    @property
    def tick_s(self) -> float:
        return self.tick_us * 1e-6

    @property
    def substeps(self) -> int:
        """As few of equal length as keep each within ``SUBSTEP_US``."""
        return -(-self.tick_us // SUBSTEP_US)

    @property
    def substep_s(self) -> float:
        return self.tick_s / self.substeps


DEFAULT_TIMESTEP = Timestep()
