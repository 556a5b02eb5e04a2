"""An autopilot server in memory with a ground station on each link that uses pymavlink."""

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.ground_server import GroundServer
from autopilot.control.params import ParamTable
from autopilot.control.types import Inputs
from autopilot.identities import IDENTITIES
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.vehicle import Vehicle
from mavlink_io.records import SENSORS_ALL, GpsFix, SensorFrame

TICK_US = 20_000
SURFACE_HPA = 1013.25
HPA_PER_M = 100.5525


def sensors(time_us: int, depth_m: float = 0.0) -> SensorFrame:
    """A sample of a level vehicle at rest that faces magnetic north.

    The last digit flickers, because the autopilot detects constant readings as a fault.
    """
    pressure = SURFACE_HPA + HPA_PER_M * depth_m
    dither = 1e-4 if time_us // TICK_US % 2 else -1e-4
    return SensorFrame(
        time_us,
        0.0,
        0.0,
        -9.80665 + dither,
        0.0,
        0.0,
        dither,
        0.2 + dither,
        0.0,
        0.4,
        pressure + dither,
        0.0,
        0.0,
        10.0,
        SENSORS_ALL,
        0,
    )


class Station:
    """A ground station at the other end of a link; it is also the server's transport."""

    def __init__(self, system: int = 255, component: int = 190) -> None:
        self.address = f"station {system}/{component}"
        self._mavlink = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._reader = mavlink.MAVLink(None)
        self._reader.robust_parsing = False
        self._outgoing: list[bytes] = []
        self._incoming = b""

    def handles(self) -> tuple[()]:
        return ()

    def send(self, data: bytes) -> None:
        self._incoming += data

    def receive(self) -> bytes:
        return self._outgoing.pop(0) if self._outgoing else b""

    def close(self) -> None:
        pass

    def transmit(self, message: Any) -> None:
        self._outgoing.append(message.pack(self._mavlink))

    def pop_received(self) -> list[Any]:
        data, self._incoming = self._incoming, b""
        return list(self._reader.parse_buffer(data) or ()) if data else []

    def pop_named(self, name: str) -> list[Any]:
        return [message for message in self.pop_received() if message.get_type() == name]


MAX_STEP_M = 0.03
"""Change of depth in a tick, 1.5 m/s: no jump of the pressure sensor, and within the limits."""


def approach(before_m: float, wanted_m: float) -> float:
    """Return the depth after a tick on the way to another one; NaN before the first tick."""
    if math.isnan(before_m):
        return wanted_m
    return before_m + min(MAX_STEP_M, max(-MAX_STEP_M, wanted_m - before_m))


class Harness:
    """A vehicle, its server, and one station per link."""

    def __init__(self, *stations: Station, autopilot: AutopilotId = AutopilotId.GENERIC) -> None:
        self.stations = stations or (Station(),)
        self.vehicle = Vehicle(ParamTable(IDENTITIES[autopilot].parameters))
        self.server = GroundServer(self.vehicle, self.stations, autopilot)
        self.time_us, self.depth_m = -TICK_US, math.nan

    @property
    def station(self) -> Station:
        return self.stations[0]

    def tick(self, count: int = 1, depth_m: float = 0.0, fix: GpsFix | None = None) -> None:
        """Run ticks; the depth moves there in steps that a pressure sensor can have."""
        for _ in range(count):
            self.time_us += TICK_US
            self.depth_m = approach(self.depth_m, depth_m)
            sample = sensors(self.time_us, self.depth_m)
            self.vehicle.tick(Inputs(sample, fix, None, None, stick=self.server.stick))
            self.server.publish_telemetry()
        self.server.flush()

    def serve(self) -> None:
        """Make the server process all messages that the stations have sent."""
        for link in self.server.links:
            for _ in range(20):
                self.server.receive(link)
        for _ in range(10):
            self.server.poll()
        self.server.flush()

    def ask(self, message: Any, station: Station | None = None) -> list[Any]:
        """Send one message and return the answers that the station receives."""
        asker = station or self.station
        asker.pop_received()
        asker.transmit(message)
        self.serve()
        return asker.pop_received()

    def command(self, number: int, *parameters: float, component: int = 1) -> list[Any]:
        """Send a COMMAND_LONG whose other parameters are NaN, and return the answers."""
        filled = [*parameters, *[float("nan")] * (7 - len(parameters))]
        return self.ask(mavlink.MAVLink_command_long_message(1, component, number, 0, *filled))


def only(messages: Sequence[Any], name: str) -> Any:
    """Return the only message of a name."""
    (message,) = [m for m in messages if m.get_type() == name]
    return message


def texts(messages: Sequence[Any]) -> list[str]:
    """Return the texts of STATUSTEXTs with their chunks joined."""
    whole: list[str] = []
    for message in messages:
        if message.get_type() == "STATUSTEXT":
            if message.chunk_seq:
                whole[-1] += message.text
            else:
                whole.append(message.text)
    return whole
