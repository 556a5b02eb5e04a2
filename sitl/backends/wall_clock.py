"""Caribou's own autopilot without lockstep, as on the real vehicle: neither side waits.

The sensors send at their own rates in real time, and the tailcone applies the last actuators
received. Messages that the line loses or delays stay lost or late. The line carries only the
messages that docs/hardware.md defines for a vehicle, not the simulator's true state.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from mavlink_io.clock import wall_s
from mavlink_io.errors import ErrorCode
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import AddressError, Transport, baud_rate
from sitl.backends.hil import HilClient
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.faults.failure_injection import InjectionResult

ACTUATOR_TIMEOUT_S = 1.0
"""Wall time without actuators after which the duct is centred and the propeller stopped."""

BITS_PER_BYTE, MAX_LINE_SHARE = 10, 0.75
"""Bits per byte on the line (8N1), and the share of the line used: the rest absorbs bursts."""
SAMPLE_BYTES = 77
"""Size of a HIL_SENSOR frame."""
DEVICES_BYTES_PER_S = 2080
"""Data rate of all devices as in their data sheets; more than half is the DVL's ODOMETRY."""
RATES_HZ = (50, 25, 10)
"""Possible rates of HIL_SENSOR."""
MIN_BAUD = 38_400

MAX_LAG_S = 1.0
"""Largest lag of vehicle time behind the wall clock; a larger lag is not made up."""

_NEUTRAL = ActuatorFrame(time_us=0, flags=0, controls=(0.0,) * 16, mode=0)


class TooSlowError(AddressError):
    """The serial line cannot carry the sensor messages; the message gives the lowest baud rate."""

    code = ErrorCode.SERIAL_TOO_SLOW


class WallClock:
    """Backend that runs in real time; the vehicle drifts at neutral until actuators arrive."""

    def __init__(self, transport: Transport, stopped: Callable[[], bool]) -> None:
        """Open the backend on a transport.

        Raises TooSlowError: the serial line is too slow.
        """
        self._timestep = timestep_for_line(transport.address)
        self._link, self._stopped = HilClient(transport), stopped
        self._watchdog = Watchdog(_report_on_stderr, wall_s())
        self._start_s = wall_s()

    def wait_for_autopilot(self) -> Timestep | None:
        """Start the clock and return the time step at once."""
        self._start_s = wall_s()
        return None if self._stopped() else self._timestep

    def exchange(self, plant: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        """Send the sensors and return the actuators in force."""
        if self._stopped():
            return None
        self._check_lag(state.time_us * 1e-6)
        self._link.send(self._link.datagram(sensors, None, state.faults.changes))
        return self._watchdog.update(self._link.newest(), wall_s())

    def _check_lag(self, vehicle_s: float) -> None:
        """Report when this computer is too slow, and accept the lag as an offset."""
        lag_s = wall_s() - self._start_s - vehicle_s
        if lag_s > MAX_LAG_S:
            self._start_s += lag_s
            _report_on_stderr(f"too busy: vehicle time {vehicle_s:.1f} s is {lag_s:.1f} s late")

    def take_injections(self) -> Sequence[InjectionResult]:
        """Return the failures that were commanded since the last call."""
        return self._link.take_injections()


class Watchdog:
    """Actuator watchdog of the tailcone: neutral after a time without actuators (wall time)."""

    def __init__(self, report: Callable[[str], None], now_s: float) -> None:
        self._report, self._received_s = report, now_s
        self._newest: ActuatorFrame | None = None

    def update(self, received: ActuatorFrame | None, now_s: float) -> ActuatorFrame:
        """Return the actuators in force, given those received since the last call, if any."""
        if received is not None:
            if self._newest is None:
                self._report(f"actuators after {now_s - self._received_s:.1f} s")
            self._newest, self._received_s = received, now_s
        elif self._newest is not None and now_s - self._received_s > ACTUATOR_TIMEOUT_S:
            self._newest = None
            self._report(
                f"no actuators for {ACTUATOR_TIMEOUT_S:g} s: duct straight, propeller stopped"
            )
        return self._newest or _NEUTRAL


def timestep_for_line(address: str) -> Timestep:
    """Return the time step in which the line at an address can carry the sensor messages.

    Parameters
    ----------
    address : str
        Link address; without a baud rate the result is the default time step.

    Raises
    ------
    TooSlowError
        The line is too slow even for the lowest rate.
    """
    baud = baud_rate(address)
    if baud is None:
        return DEFAULT_TIMESTEP
    available = MAX_LINE_SHARE * baud / BITS_PER_BYTE - DEVICES_BYTES_PER_S
    rate_hz = next((rate for rate in RATES_HZ if rate * SAMPLE_BYTES <= available), None)
    if rate_hz is None:
        raise TooSlowError(
            f"address {address!r}: too slow for the sensors: expected {MIN_BAUD} baud or more"
        )
    return Timestep(1_000_000 // rate_hz)


def _report_on_stderr(text: str) -> None:
    """Print a message of the simulator."""
    print(f"sitl: {text}", file=sys.stderr, flush=True)
