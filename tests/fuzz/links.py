"""Fuzz targets on the links of the autopilot: main loop, services and tick in this process."""

import gc
import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.comms import hil as hil_link
from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.dialect import MessageType
from mavlink_io.services.ftp import payload as ftp
from tests.fuzz.frames import ByteSource, messages_by_name, stream
from tests.helpers.fake_hil import TICK_US, sensors
from tests.helpers.rig import SENSOR, Rig

MAX_TICK_CPU_S = 0.02
"""Requirement: CPU time in which a tick is served, whatever arrives on the links."""
SETTLE_TICKS = 12
"""Ticks after a case on the HIL link in which the vehicle must answer again.

The clock of the sensors is accepted again after five samples on one time base."""
PASSES = 3
"""Maximum number of passes of the main loop per sample: each pass reads one datagram of a link."""
CASES_PER_RIG = 200
"""Number of cases on one autopilot: later cases meet the state that earlier ones have left."""

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


class LinkFuzz:
    """One autopilot that receives cases on one of its links."""

    def __init__(self) -> None:
        self._rig: Rig | None = None
        self._cases, self._ticks = 0, 0
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
        return self._run(data, self._ground_messages, lambda rig, sent: rig.line.send(sent))

    def file_transfer(self, data: bytes) -> LinkReport:
        """Send requests of the file transfer protocol."""
        return self._run_sent(_file_requests(data), lambda rig, sent: rig.line.send(sent))

    def hil(self, data: bytes) -> LinkReport:
        """Send frames of all messages that sensors and devices send."""
        report = self._run(data, HIL_MESSAGES, lambda rig, sent: rig.simulator.transport.send(sent))
        rig = self._present_rig()
        for _ in range(SETTLE_TICKS):
            if self._tick(rig)[0]:
                return report
        raise DefectError("no sample is answered any more")

    def close(self) -> None:
        """End the autopilot."""
        if self._rig is not None:
            self._rig.close()
            self._rig = None

    def _run(
        self, data: bytes, messages: tuple[MessageType, ...], send: Callable[[Rig, bytes], None]
    ) -> LinkReport:
        """Send the frames that the bytes select."""
        return self._run_sent(stream(data, messages), send)

    def _run_sent(self, sent: bytes, send: Callable[[Rig, bytes], None]) -> LinkReport:
        """Send bytes on a link and run ticks until all was processed."""
        rig = self._present_rig()
        send(rig, sent)
        longest_s = 0.0
        for _ in range(400):
            _, cpu_s = self._tick(rig)
            longest_s = max(longest_s, cpu_s)
            if not any(link.backlog for link in rig.server.links):
                break
        else:
            raise DefectError("received frames are not processed")
        reported = rig.server.guard._reported | rig.onboard_log._guard._reported
        if reported:
            self.close()
            raise DefectError(f"internal error: {sorted(reported)}")
        while rig.line.receive():
            pass
        return LinkReport(len(Framer().feed(sent)), longest_s)

    def _present_rig(self) -> Rig:
        """Return the autopilot; a new one after `CASES_PER_RIG` cases."""
        self._cases += 1
        if self._rig is None or self._cases % CASES_PER_RIG == 0:
            self.close()
            self._rig, self._ticks = Rig(), 0
            for _ in range(3):
                self._tick(self._rig)
        return self._rig

    def _tick(self, rig: Rig) -> tuple[bool, float]:
        """Send a sample; return whether it was answered, and the CPU time of the pass."""
        self._ticks += 1
        time_us = self._ticks * TICK_US
        rig.simulator.send_values(SENSOR, sensors(time_us, depth_m=2.0))
        longest_s, answered = 0.0, False
        for _ in range(PASSES):
            began_s = time.thread_time()
            rig.step()
            longest_s = max(longest_s, time.thread_time() - began_s)
            while frames := rig.simulator.receive():
                answers = [frame.decode() for frame in frames]
                for answer in answers:
                    _check_answer(answer)
                answered |= any(getattr(a, "time_usec", -1) == time_us for a in answers)
            if answered:
                break
        return answered, longest_s


def _check_answer(answer: Any) -> None:
    """Raise DefectError for a command to an actuator that no actuator may receive."""
    controls = getattr(answer, "controls", ())
    if not all(math.isfinite(value) and -1.0 <= value <= 1.0 for value in controls):
        raise DefectError(f"controls {controls}")


def _file_requests(data: bytes) -> bytes:
    """Return FILE_TRANSFER_PROTOCOL frames; paths are those of the vehicle or any bytes."""
    source, sent = ByteSource(data), b""
    paths = (b"/", b"/logs", b"/params/current.param", b"@PARAM/param.pck", b"/../etc/passwd")
    paths += (b"/logs/../../x", b"//", b"/params/", b"\xff\xfe", b"@PARAM/param.pck?withdefaults=1")
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
