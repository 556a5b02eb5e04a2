"""Our own autopilot as on the real vehicle: nobody waits for anybody.

The instruments speak at their own pace on the wall clock, and the tailcone does what it heard last.
What the line loses or delays stays lost or late. The line carries what docs/hardware.md has a
vehicle say, and no more: the simulator's own state stays at home."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from mavlink_io.clock import wall_s
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import AddressError, Transport, baud_rate
from sitl.backends.hil import HilClient
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import DEFAULT_TIMESTEP, Timestep
from sitl.faults.failure_injection import InjectionResult

ACTUATOR_TIMEOUT_S = 1.0
"""Wall time without actuators after which the tailcone puts the duct straight and stops the
propeller."""

BITS_PER_BYTE, MAX_LINE_SHARE = 10, 0.75
"""A byte is ten bits on the line (8N1), and so much of the line is used: the rest is for what comes
late at once."""
SAMPLE_BYTES = 77
"""HIL_SENSOR."""
DEVICES_BYTES_PER_S = 2080
"""All devices at the rates of their data sheets; the Doppler log's ODOMETRY is more than half of
it."""
RATES_HZ = (50, 25, 10)
MIN_BAUD = 38_400

MAX_LAG_S = 1.0
"""Of vehicle time behind the wall clock; the clock in ``app`` does not make up for more."""

_NEUTRAL = ActuatorFrame(0, 0, (0.0,) * 16, 0)


class TooSlowError(AddressError):
    """The line there cannot carry what the instruments say; the message says what would."""


class WallClock:
    """There from the start, whoever else is: time runs, and she floats until somebody steers."""

    def __init__(self, transport: Transport, stopped: Callable[[], bool]) -> None:
        """Raises TooSlowError."""
        self._pace = timestep_for_line(transport.address)
        self._link, self._stopped = HilClient(transport), stopped
        self._watchdog = Watchdog(_report_on_stderr, wall_s())
        self._began_s = wall_s()

    def meet(self) -> Timestep | None:
        self._began_s = wall_s()
        return None if self._stopped() else self._pace

    def ask(self, sea: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        if self._stopped():
            return None
        self._look_at_the_clock(state.time_us * 1e-6)
        self._link.send(self._link.datagram(sensors, None, state.faults.changes))
        return self._watchdog.obey(self._link.newest(), wall_s())

    def _look_at_the_clock(self, vehicle_s: float) -> None:
        """Say so where this machine is too slow: what is late for a second stays late."""
        late_s = wall_s() - self._began_s - vehicle_s
        if late_s > MAX_LAG_S:
            self._began_s += late_s
            _report_on_stderr(f"too busy: vehicle time {vehicle_s:.1f} s comes {late_s:.1f} s late")

    def take_orders(self) -> Sequence[InjectionResult]:
        return self._link.take_orders()


class Watchdog:
    """What a tailcone does: what it heard last, and nothing once that is too long ago. All times
    are wall time."""

    def __init__(self, tell: Callable[[str], None], now_s: float) -> None:
        self._tell, self._heard_s = tell, now_s
        self._newest: ActuatorFrame | None = None

    def obey(self, heard: ActuatorFrame | None, now_s: float) -> ActuatorFrame:
        """The actuators in force, after those ``heard`` if there are any."""
        if heard is not None:
            if self._newest is None:
                self._tell(f"actuators after {now_s - self._heard_s:.1f} s")
            self._newest, self._heard_s = heard, now_s
        elif self._newest is not None and now_s - self._heard_s > ACTUATOR_TIMEOUT_S:
            self._newest = None
            self._tell(
                f"no actuators for {ACTUATOR_TIMEOUT_S:g} s: duct straight, propeller stopped"
            )
        return self._newest or _NEUTRAL


def timestep_for_line(address: str) -> Timestep:
    """The steps in which the line at an address can carry the instruments; without a baud rate, our
    autopilot's own.

    Raises TooSlowError: not even the slowest fit.
    """
    baud = baud_rate(address)
    if baud is None:
        return DEFAULT_TIMESTEP
    room = MAX_LINE_SHARE * baud / BITS_PER_BYTE - DEVICES_BYTES_PER_S
    rate_hz = next((rate for rate in RATES_HZ if rate * SAMPLE_BYTES <= room), None)
    if rate_hz is None:
        raise TooSlowError(
            f"address {address!r}: too slow for the instruments: expected {MIN_BAUD} baud or more"
        )
    return Timestep(1_000_000 // rate_hz)


def _report_on_stderr(text: str) -> None:
    print(f"sitl: {text}", file=sys.stderr, flush=True)
