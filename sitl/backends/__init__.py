"""Who steers the simulated vehicle: our own autopilot, PX4 or ArduPilot, each spoken to as it is
used to.

All are alike to the plant: a ``Backend`` is met, says in which steps time shall run, and is asked
for actuators once a step. One that begins anew finds a vehicle that begins anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from mavlink_io.records import ActuatorFrame
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import Timestep
from sitl.faults.failure_injection import InjectionResult


class Backend(Protocol):
    """Whoever steers, as the simulator sees it."""

    def meet(self) -> Timestep | None:
        """Wait until there is somebody to steer; the steps that suit, None when the process was
        told to stop.

        Raises:
            LinkLostError: the other end is gone for good.
        """
        ...

    def ask(self, sea: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        """What the actuators shall do next, given what the instruments say now; None when the
        voyage is over.

        It is over when the process was told to stop, or when whoever steered is gone or begins
        anew.

        Raises:
            AutopilotSilentError: our own autopilot does not answer any more.
            LinkLostError: the other end is gone for good.
        """
        ...

    def take_orders(self) -> Sequence[InjectionResult]:
        """The failures that were ordered since the last call."""
        ...
