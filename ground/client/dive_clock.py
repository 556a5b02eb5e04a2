"""Vehicle time and wall time of a dive, and a vehicle time that stands still."""

from ground.client.recorder import Recorder
from ground.client.vehicle import MAX_PUMP_S, VehicleClientError
from mavlink_io.clock import wall_s

STALL_TIMEOUT_S = 120.0
"""Wall time without advance of vehicle time after which `fly` gives up; it warns after half of it.

A debugger, a paused simulator and one that compiles also stop vehicle time, usually for less."""
STALL_REASON = "no sensor data reach the autopilot: is the simulator still running?"


class DiveClock:
    """Vehicle time and wall time since the start of a dive.

    Parameters
    ----------
    recorder : Recorder
        Recorder of the vehicle's frames.
    system : int
        System id of the vehicle.
    timeout_s : float
        Wall time without advance of vehicle time after which `update` raises.
    """

    def __init__(self, recorder: Recorder, system: int, timeout_s: float = STALL_TIMEOUT_S) -> None:
        self._recorder, self._system, self._timeout_s = recorder, system, timeout_s
        self._start_s = self._updated_s = wall_s()
        self._vehicle_start_s = self._newest_s = recorder.system_s(system)
        self._stalled_s = 0.0

    @property
    def vehicle_s(self) -> float:
        """Vehicle time since the start."""
        return self._recorder.system_s(self._system) - self._vehicle_start_s

    @property
    def wall_s(self) -> float:
        """Wall time since the start."""
        return wall_s() - self._start_s

    @property
    def warning(self) -> str:
        """Reason why vehicle time stands still; empty while it advances."""
        if self._stalled_s < 0.5 * self._timeout_s:
            return ""
        return f"vehicle time has not advanced for {0.5 * self._timeout_s:g} s: {STALL_REASON}"

    def update(self) -> None:
        """Compare vehicle time with that of the last call.

        A pause of this program counts as `MAX_PUMP_S`, as for the heartbeats.

        Raises
        ------
        VehicleClientError
            Vehicle time has not advanced for the timeout.
        """
        now_s, newest_s = wall_s(), self._recorder.system_s(self._system)
        if newest_s != self._newest_s:
            self._newest_s, self._stalled_s = newest_s, 0.0
        else:
            self._stalled_s += min(now_s - self._updated_s, MAX_PUMP_S)
        self._updated_s = now_s
        if self._stalled_s > self._timeout_s:
            raise VehicleClientError(
                f"vehicle time has not advanced for {self._timeout_s:g} s: {STALL_REASON}"
                f" What was recorded is kept in {self._recorder.path}"
            )
