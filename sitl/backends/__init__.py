"""Backends: connections of the simulator to an autopilot (Caribou's own, PX4 or ArduPilot).

The simulator uses all of them through the ``Backend`` protocol: it waits until an autopilot is
connected, builds the plant with the time step of that backend, and exchanges sensors for actuators
once per tick. When the autopilot restarts, the simulator starts a new run from the initial state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from mavlink_io.records import ActuatorFrame
from sitl.core.plant import Plant, PlantState, RandomStreams
from sitl.core.sensors import Sensors
from sitl.core.timestep import Timestep
from sitl.faults.failure_injection import InjectionResult


class Backend(Protocol):
    """Connection to an autopilot as the simulator uses it."""

    def wait_for_autopilot(self) -> Timestep | None:
        """Wait for an autopilot at the start of a run.

        Returns
        -------
        Timestep or None
            Time step that suits the autopilot; None when the process was asked to stop.

        Raises
        ------
        LinkLostError
            The link is closed and cannot be opened again.
        """
        ...

    def exchange(self, plant: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        """Send the sensors of one tick and return the actuators to apply in the next.

        Parameters
        ----------
        plant : Plant
            The simulated plant; its site is needed for geographic positions.
        state : PlantState
            State at the present tick.
        sensors : Sensors
            Sensor output of the present tick.

        Returns
        -------
        ActuatorFrame or None
            Actuators; None when the run ends because the process was asked to stop, or because the
            autopilot disconnected or restarted.

        Raises
        ------
        AutopilotTimeoutError
            Caribou's autopilot does not answer.
        LinkLostError
            The link is closed and cannot be opened again.
        """
        ...

    def take_injections(self) -> Sequence[InjectionResult]:
        """Return the failures that were commanded since the last call."""
        ...


@runtime_checkable
class QuickBackend(Backend, Protocol):
    """Connection that flies ticks in compiled code, for simulations without pace and truth log."""

    def advance(
        self, plant: Plant, state: PlantState, sensors: Sensors, rng: RandomStreams
    ) -> tuple[PlantState, Sensors]:
        """Fly the next ticks in which nothing but numbers changes.

        Parameters
        ----------
        plant : Plant
            The simulated plant.
        state : PlantState
            State at the present tick.
        sensors : Sensors
            Sensor output of the present tick.
        rng : RandomStreams
            Random streams of the run; they advance.

        Returns
        -------
        tuple of PlantState and Sensors
            State and sensors for ``exchange``; those of the present tick if there was no such tick.

        Raises
        ------
        LinkLostError
            The link is closed and cannot be opened again.
        """
        ...
