"""Caribou's own autopilot: strict lockstep over the HIL link, in steps of 20 ms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from mavlink_io import jit
from mavlink_io.records import ActuatorFrame, TruthFrame
from mavlink_io.transport import Transport
from sitl.backends.hil import HilClient
from sitl.backends.lockstep import Lockstep
from sitl.backends.messages import TRUTH_PERIOD_US
from sitl.core import plant as core
from sitl.core import truth
from sitl.core.plant import Plant, PlantState, RandomStreams
from sitl.core.sensors import Sensors
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.faults.failure_injection import InjectionResult

if TYPE_CHECKING:
    from sitl.backends.compiled_lockstep import CompiledLockstep

_COMPILED_LOCKSTEP = "sitl.backends.compiled_lockstep"
"""Module that is imported by name: it loads the compiler, which plain Python does without."""


class Caribou:
    """Backend in lockstep; with ``wait_for_arm`` vehicle time stops while disarmed."""

    def __init__(
        self, transport: Transport, stopped: Callable[[], bool], *, wait_for_arm: bool = False
    ) -> None:
        self._link, self._stopped = HilClient(transport), stopped
        self._lockstep = lockstep = Lockstep(self._link, stopped)
        self._exchange = lockstep.exchange_until_armed if wait_for_arm else lockstep.exchange
        self._compiled: CompiledLockstep | None = None
        if jit.COMPILED:
            module = import_module(_COMPILED_LOCKSTEP)
            self._compiled = module.CompiledLockstep(self._link, stopped)
        self._sent: tuple[int, bytes] | None = None
        """Vehicle time and content of a datagram that was sent and not answered."""

    def wait_for_autopilot(self) -> Timestep | None:
        """Return the time step at once: the first frame is repeated until it is answered."""
        return None if self._stopped() else DEFAULT_TIMESTEP

    def advance(
        self, plant: Plant, state: PlantState, sensors: Sensors, rng: RandomStreams
    ) -> tuple[PlantState, Sensors]:
        """Fly the ticks in which only numbers change; the last one is sent and not answered."""
        until_us = core.quiet_until_us(state)
        if self._compiled is None or state.time_us + plant.tick_us >= until_us:
            return state, sensors
        datagram = self._datagram(plant, state, sensors)
        self._link.send(datagram)
        flown = self._compiled.advance(plant, state, rng, until_us)
        if flown is not None:
            state, sensors, datagram = flown
            self._lockstep.has_answered = True
        self._sent = state.time_us, datagram
        return state, sensors

    def exchange(self, plant: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        """Send the sensors and return the actuators that answer them."""
        sent, self._sent = self._sent, None
        if sent is not None and sent[0] == state.time_us:
            return self._exchange(sent[1], state.time_us, sent=True)
        return self._exchange(self._datagram(plant, state, sensors), state.time_us)

    def _datagram(self, plant: Plant, state: PlantState, sensors: Sensors) -> bytes:
        """Return the datagram of a tick."""
        return self._link.datagram(sensors, _truth_frame(plant, state), state.faults.changes)

    def take_injections(self) -> Sequence[InjectionResult]:
        """Return the failures that were commanded since the last call."""
        return self._link.take_injections()


def _truth_frame(plant: Plant, state: PlantState) -> TruthFrame | None:
    """Return the true state for viewers, or None in ticks in which it is not due."""
    if state.time_us % TRUTH_PERIOD_US:
        return None
    return truth.to_frame(state.truth, plant.sea.latitude_deg, plant.sea.longitude_deg)
