"""The main loop of the autopilot in this process, between a simulator and a ground station."""

from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from autopilot.app import App
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink
from autopilot.control.params import ParamTable
from autopilot.control.types import Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport
from tests.helpers.fake_hil import sensors

SENSOR = dialect.by_name("HIL_SENSOR")


class Rig:
    """App loop between a simulator and one ground station, in this process."""

    def __init__(self, folder: Path | None = None) -> None:
        self._ends = [open_transport(f"memory:{name}") for name in ("hil", "hil", "gcs", "gcs")]
        near, far, self.line, gcs = self._ends
        self.simulator = Endpoint(near, 2, 1)
        self._station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._framer = Framer()
        self.vehicle = Vehicle(ParamTable())
        self.onboard_log = OnboardLog(self.vehicle, folder)
        self.server = GroundServer(
            self.vehicle, [gcs], AutopilotId.GENERIC, onboard_log=self.onboard_log
        )
        self.app = App(self.vehicle, HilLink(far, 1), self.server, self.onboard_log)

    def close(self) -> None:
        for end in self._ends:
            end.close()

    def send(self, *messages: Any) -> None:
        """Send messages of the ground station in one datagram."""
        self.line.send(b"".join(message.pack(self._station) for message in messages))

    def receive(self) -> list[Frame]:
        """Return the frames that the ground station has received since the last call."""
        self.server.flush()
        frames: list[Frame] = []
        while data := self.line.receive():
            frames += self._framer.feed(data)
        return frames

    def texts(self) -> list[Any]:
        self.server.poll()
        return [frame.decode() for frame in self.receive() if frame.name == "STATUSTEXT"]

    def step(self) -> None:
        self.app.step(min(self.server.poll(), 0.0))

    def tick(self, time_us: int) -> Any:
        """Send one sample and return its answer."""
        self.simulator.send_values(SENSOR, sensors(time_us))
        self.step()
        (frame,) = self.simulator.receive()
        return frame.decode()

    def reports(self) -> list[Any]:
        """Return STATUSTEXTs of severity CRITICAL; only the first chunk of each."""
        return [m for m in self.texts() if m.severity == Severity.CRITICAL and m.chunk_seq == 0]
