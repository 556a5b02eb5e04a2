"""Our own autopilot at the helm: strict lockstep over the HIL link, in steps of 20 ms."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mavlink_io.records import ActuatorFrame, TruthFrame
from mavlink_io.transport import Transport
from sitl.backends.hil import HilClient
from sitl.backends.lockstep import Lockstep
from sitl.backends.messages import TRUTH_PERIOD_US
from sitl.core import truth
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.faults.failure_injection import InjectionResult


class Caribou:
    """There from the start, or at least asked from the start; with ``wait_for_arm`` time stands
    while disarmed."""

    def __init__(
        self, transport: Transport, stopped: Callable[[], bool], *, wait_for_arm: bool = False
    ) -> None:
        self._link, self._stopped = HilClient(transport), stopped
        lockstep = Lockstep(self._link, stopped)
        self._ask = lockstep.ask_until_armed if wait_for_arm else lockstep.ask

    def meet(self) -> Timestep | None:
        return None if self._stopped() else DEFAULT_TIMESTEP

    def ask(self, sea: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        datagram = self._link.datagram(sensors, _truth_frame(sea, state), state.faults.changes)
        return self._ask(datagram, state.time_us)

    def take_orders(self) -> Sequence[InjectionResult]:
        return self._link.take_orders()


def _truth_frame(sea: Plant, state: PlantState) -> TruthFrame | None:
    """What viewers may see, when it is due."""
    if state.time_us % TRUTH_PERIOD_US:
        return None
    return truth.to_frame(state.truth, sea.sea.latitude_deg, sea.sea.longitude_deg)
