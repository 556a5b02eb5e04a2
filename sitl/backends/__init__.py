"""Who steers the simulated vehicle: our own autopilot, PX4 or ArduPilot, each spoken to as it is
used to.

All are alike to the plant: a ``Pilot`` is met, says in which steps time shall run, and is asked for
actuators once a step. One that begins anew finds a vehicle that begins anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from mavlink_io.records import ActuatorFrame
from sitl.core.plant import Plant, State
from sitl.core.sensors import Sensors
from sitl.core.timestep import Pace
from sitl.faults.failure_injection import Verdict


class Pilot(Protocol):
    """Whoever steers, as the simulator sees it."""

    def meet(self) -> Pace | None:
        """Wait until there is somebody to steer; the steps that suit, None when the process was
        told to stop.

        Raises:
            LinkLostError: the other end is gone for good.
        """
        ...

    def ask(self, sea: Plant, state: State, sensors: Sensors) -> ActuatorFrame | None:
        """What the actuators shall do next, given what the instruments say now; None when the
        voyage is over.

        It is over when the process was told to stop, or when whoever steered is gone or begins
        anew.

        Raises:
            AutopilotSilentError: our own autopilot does not answer any more.
            LinkLostError: the other end is gone for good.
        """
        ...

    def take_orders(self) -> Sequence[Verdict]:
        """The failures that were ordered since the last call."""
        ...
