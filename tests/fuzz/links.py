"""Fuzz targets on the links of the autopilot: main loop, services and tick in this process."""

import gc
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms import hil as hil_link
from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.services.ftp import payload as ftp
from mavlink_io.vehicle_modes import VehicleMode
from tests.fuzz.frames import ByteSource, messages_by_name, stream
from tests.helpers import commands
from tests.helpers.fake_hil import TICK_US, sensors
from tests.helpers.rig import SENSOR, Rig

MAX_TICK_CPU_S = 0.02
"""Requirement: CPU time in which a tick is served, whatever arrives on the links."""
SETTLE_TICKS = 12
"""Ticks after a case on the HIL link in which the vehicle must answer again.

The clock of the sensors is accepted again after five samples on one time base."""
PASSES = 3
"""Maximum number of passes of the main loop per sample: each pass reads one datagram of a link."""
CASES_PER_AUTOPILOT = {False: 200, True: 10}
"""Number of cases on one autopilot, by whether it is armed: later cases meet the state that earlier
ones have left. Failsafes that stay active end the other modes of an armed vehicle."""
MODES = tuple(mode.value for mode in VehicleMode)
"""Modes that an armed vehicle is commanded into before a case, in turn."""
CUSTOM_MODE = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
COMMAND_TICKS = 2
"""Number of ticks after which the commands before a case are processed."""
FIRST_TICKS = 3
"""Number of ticks of an autopilot before its first case."""

FILE_TRANSFER = dialect.by_name("FILE_TRANSFER_PROTOCOL")
HIL_MESSAGES = (
    SENSOR,
    *(message for number in hil_link._READERS if (message := dialect.by_id(number))),
    *messages_by_name("COMMAND_ACK", "STATUSTEXT", "SCALED_PRESSURE", "HEARTBEAT"),
)


class DefectError(AssertionError):
    """The program did what no input may make it do."""


class LinkReport(NamedTuple):
    """Measures of one case."""

    frames: int
    """Number of complete frames with a correct CRC."""
    tick_cpu_s: float
    """Largest CPU time of a pass of the main loop that answered a sample."""
    armed: bool
    """Whether the vehicle was armed when the frames arrived."""


class FuzzedAutopilot:
    """An autopilot under fuzzing.

    Parameters
    ----------
    armed : bool
        True: it writes onboard logs, and before each case it is armed and commanded into one of the
        modes, which it may refuse.
        False: cases find it as the cases before have left it, at first disarmed.
    """

    def __init__(self, *, armed: bool) -> None:
        self._folder = tempfile.TemporaryDirectory() if armed else None
        self.rig = Rig(Path(self._folder.name) if self._folder else None)
        self.cases, self._ticks = 0, 0
        for _ in range(FIRST_TICKS):
            self.tick()

    def begin_case(self, mode: int) -> None:
        """Count a case; arm a vehicle that has to be armed, and command it into a mode."""
        self.cases += 1
        if self._folder:
            self.rig.send(commands.long(mavlink.MAV_CMD_DO_SET_MODE, CUSTOM_MODE, mode))
            self.rig.send(commands.long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0))
            for _ in range(COMMAND_TICKS):
                self.tick()

    def tick(self) -> tuple[bool, float]:
        """Send a sample; return whether it was answered, and the CPU time of the pass."""
        self._ticks += 1
        time_us = self._ticks * TICK_US
        self.rig.simulator.send_values(SENSOR, sensors(time_us, depth_m=2.0))
        longest_s, answered = 0.0, False
        for _ in range(PASSES):
            began_s = time.thread_time()
            self.rig.step()
            longest_s = max(longest_s, time.thread_time() - began_s)
            while frames := self.rig.simulator.receive():
                answers = [frame.decode() for frame in frames]
                for answer in answers:
                    _check_answer(answer)
                answered |= any(getattr(a, "time_usec", -1) == time_us for a in answers)
            if answered:
                break
        return answered, longest_s

    def internal_errors(self) -> set[tuple[str, str]]:
        """Return part and source line of each exception that was caught."""
        return self.rig.server.guard._reported | self.rig.onboard_log._guard._reported

    def close(self) -> None:
        """End the autopilot and remove its logs."""
        self.rig.onboard_log.close()
        self.rig.close()
        if self._folder:
            self._folder.cleanup()


class LinkFuzz:
    """Two autopilots, a disarmed and an armed one, that receive cases in turn."""

    def __init__(self) -> None:
        self._autopilots: dict[bool, FuzzedAutopilot] = {}
        """Autopilots in use, by whether they are armed."""
        self._cases = 0
        served = Rig()
        handlers = served.server._services._table
        self._ground_messages = tuple(
            message for number in sorted(handlers) if (message := dialect.by_id(number))
        )
        served.close()
        gc.collect()
        gc.freeze()  # as the autopilot does at its start

    def ground(self, data: bytes) -> LinkReport:
        """Send frames of all messages that the vehicle serves."""
        return self._run_ground(stream(data, self._ground_messages))

    def file_transfer(self, data: bytes) -> LinkReport:
        """Send requests of the file transfer protocol."""
        return self._run_ground(_file_requests(data))

    def hil(self, data: bytes) -> LinkReport:
        """Send frames of all messages that sensors and devices send."""
        report, autopilot = self._run(
            stream(data, HIL_MESSAGES), lambda rig, sent: rig.simulator.transport.send(sent)
        )
        for _ in range(SETTLE_TICKS):
            if autopilot.tick()[0]:
                return report
        raise DefectError("no sample is answered any more")

    def close(self) -> None:
        """End the autopilots."""
        for autopilot in self._autopilots.values():
            autopilot.close()
        self._autopilots.clear()

    def _run_ground(self, sent: bytes) -> LinkReport:
        """Send bytes on the ground link."""
        return self._run(sent, lambda rig, data: rig.line.send(data))[0]

    def _run(
        self, sent: bytes, send: Callable[[Rig, bytes], None]
    ) -> tuple[LinkReport, FuzzedAutopilot]:
        """Send bytes on a link and run ticks until all was processed."""
        autopilot = self._next_autopilot()
        autopilot.begin_case(MODES[self._cases // 2 % len(MODES)])
        rig, armed = autopilot.rig, autopilot.rig.vehicle.armed
        send(rig, sent)
        longest_s = 0.0
        for _ in range(400):
            _, cpu_s = autopilot.tick()
            longest_s = max(longest_s, cpu_s)
            if not any(link.backlog for link in rig.server.links):
                break
        else:
            raise DefectError("received frames are not processed")
        if errors := autopilot.internal_errors():
            self.close()
            raise DefectError(f"internal error: {sorted(errors)}")
        while rig.line.receive():
            pass
        return LinkReport(len(Framer().feed(sent)), longest_s, armed), autopilot

    def _next_autopilot(self) -> FuzzedAutopilot:
        """Return the two autopilots in turn; new ones after `CASES_PER_AUTOPILOT`."""
        armed = self._cases % 2 == 1
        self._cases += 1
        present = self._autopilots.get(armed)
        if present is not None and present.cases < CASES_PER_AUTOPILOT[armed]:
            return present
        if present is not None:
            present.close()
        self._autopilots[armed] = FuzzedAutopilot(armed=armed)
        return self._autopilots[armed]


def _check_answer(answer: Any) -> None:
    """Raise DefectError for a command to an actuator that no actuator may receive."""
    controls = getattr(answer, "controls", ())
    if not all(math.isfinite(value) and -1.0 <= value <= 1.0 for value in controls):
        raise DefectError(f"controls {controls}")


def _file_requests(data: bytes) -> bytes:
    """Return FILE_TRANSFER_PROTOCOL frames; paths are those of the vehicle or any bytes."""
    source, sent = ByteSource(data), b""
    paths = [b"/", b"/logs", b"/params/current.param", b"@PARAM/param.pck", b"/../etc/passwd"]
    paths += [b"/logs/../../x", b"//", b"/params/", b"\xff\xfe", b"@PARAM/param.pck?withdefaults=1"]
    for sequence in range(32):
        if source.empty:
            break
        opcode, size, session = source.byte() % 18, source.byte(), source.byte() % 4
        offset = int.from_bytes(source.take(4), "little") >> (source.byte() % 32)
        choice = source.byte()
        body = paths[choice % len(paths)] if choice < 192 else source.take(size % 239)
        packet = ftp.Packet(
            sequence=sequence,
            session=session,
            opcode=opcode,
            size=size if choice % 3 else len(body),
            offset=offset,
            data=body,
        )
        values = FILE_TRANSFER.values(
            target_network=0, target_system=1, target_component=1, payload=packet.encode()
        )
        sent += encode(FILE_TRANSFER, values, sequence, 255, 190)
    return sent
