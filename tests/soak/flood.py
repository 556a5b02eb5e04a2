"""Soak row: 5,000 messages a second of one kind beside a dive at speed 1."""

import contextlib
import itertools
import multiprocessing
import os
import random
import select
import socket
import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.services.ftp.payload import Packet
from tests.fuzz.frames import stream
from tests.helpers.fake_hil import sensors
from tests.helpers.subprocesses import BACKGROUND_NICENESS, REAL_TIME_NICENESS, autopilot, free_port
from tests.soak.row import Batch, Row

RATE_HZ, BURST = 5000, 50
"""Messages per second, and messages that are sent at once."""
CASE_S = 60.0
"""Duration of the flood of one case."""
MIN_RATE = 0.98
"""Share of the rate that a flood has to reach, or the case fails."""
TICK_S, COMMAND_S = 0.02, 0.25
"""Interval of the sensor samples and of the operator's commands."""
MAX_ACK_S = 0.1
"""Requirement: longest time until a command is acknowledged."""
MAX_TICK_P99_S = 0.02
"""A tick is on time if its answer comes before the next sample."""
BUCKETS_MS = (1, 2, 5, 10, 20, 50, 100, 1000)
"""Upper limits of the classes of the times."""
OPERATOR, FLOODER = (255, 190), (254, 190)
REQUEST_MESSAGE, AUTOPILOT_VERSION = 512, 148


def _command(number: int, *parameters: float) -> dict[str, Any]:
    """Return the fields of a COMMAND_LONG."""
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return {
        "target_system": 1,
        "target_component": 1,
        "command": number,
        "confirmation": 0,
        **{f"param{n}": value for n, value in enumerate(filled, 1)},
    }


def _frame(name: str, sender: tuple[int, int] = FLOODER, /, **fields: Any) -> bytes:
    """Return an encoded message."""
    message = dialect.by_name(name)
    return encode(message, message.values(**fields), 0, *sender)


_TARGET = {"target_system": 1, "target_component": 1}
_HEARTBEAT = {
    "type": 6,
    "autopilot": 8,
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": 4,
    "mavlink_version": 3,
}
_FILE_LIST = Packet(sequence=1, session=0, opcode=3, size=1, data=b"/").encode()


def _kinds() -> dict[str, list[bytes]]:
    """Return the messages of each kind of flood; a flood repeats them."""
    handled = tuple(
        dialect.by_name(name)
        for name in ("COMMAND_LONG", "PARAM_SET", "MISSION_ITEM_INT", "MANUAL_CONTROL", "PING")
    )
    mixed = stream(random.Random(1).randbytes(4000), handled)
    return {
        "commands": [_frame("COMMAND_LONG", **_command(REQUEST_MESSAGE, AUTOPILOT_VERSION))],
        "modes": [_frame("COMMAND_LONG", **_command(REQUEST_MESSAGE, 435, 0))],
        "parameter lists": [_frame("PARAM_REQUEST_LIST", **_TARGET)],
        "parameters": [
            _frame("PARAM_SET", param_id=b"HDG_P", param_value=n / 100, param_type=9, **_TARGET)
            for n in range(1, 50)
        ],
        "missions": [_frame("MISSION_COUNT", count=1000, mission_type=0, **_TARGET)],
        "files": [
            _frame("FILE_TRANSFER_PROTOCOL", payload=_FILE_LIST, target_network=0, **_TARGET)
        ],
        "senders": [
            _frame("HEARTBEAT", (system, component), **_HEARTBEAT)
            for system in range(2, 250)
            for component in range(1, 40)
        ],
        "pings": [_frame("PING", time_usec=1, seq=1, target_system=0, target_component=0)],
        "texts": [_frame("STATUSTEXT", severity=6, text=b"flood")],
        "mixed": [frame.raw for frame in Framer().feed(mixed)],
        "noise": [random.Random(n).randbytes(60) for n in range(50)],
    }


KINDS = tuple(_kinds())


def _flood(port: int, kind: str, duration_s: float, sent: Any) -> None:
    """Send messages from another process, and count them in shared memory."""
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, BACKGROUND_NICENESS)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    messages = itertools.cycle(_kinds()[kind])
    deadline_s = (begin_s := time.monotonic()) + duration_s
    for burst in range(round(duration_s * RATE_HZ / BURST)):
        if time.monotonic() > deadline_s:
            return
        time.sleep(max(0.0, begin_s + burst * BURST / RATE_HZ - time.monotonic()))
        for _ in range(BURST):
            sender.sendto(next(messages), ("127.0.0.1", port))
        sent.value += BURST


@contextmanager
def flooded(port: int, kind: str, duration_s: float) -> Iterator[Any]:
    """Flood a port meanwhile; yield the number of sent messages, in its ``value``."""
    context = multiprocessing.get_context("spawn")
    sent = context.RawValue("q", 0)
    process = context.Process(target=_flood, args=(port, kind, duration_s, sent), daemon=True)
    process.start()
    try:
        yield sent
    finally:
        process.kill()
        process.join()


class Dive:
    """Sensors at 50 Hz and an operator's commands, each with the time to its answer."""

    def __init__(self, hil: int, ground: int) -> None:
        self._hil, self._ground = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in "12")
        self._hil.connect(("127.0.0.1", hil))
        self._ground.connect(("127.0.0.1", ground))
        self._framers = {self._hil: Framer(), self._ground: Framer()}
        self._tick = 0
        self._sent_s: dict[int, float] = {}
        self._asked_s: list[float] = []
        self.tick_s: list[float] = []
        self.ack_s: list[float] = []

    def run(self, duration_s: float) -> None:
        """Exchange messages for a wall time."""
        begin_s = next_tick_s = next_command_s = time.monotonic()
        while (now_s := time.monotonic()) < begin_s + duration_s:
            if now_s >= next_tick_s:
                next_tick_s += TICK_S
                self._send_sample(now_s)
            if now_s >= next_command_s:
                next_command_s += COMMAND_S
                self._send_command(now_s)
            timeout_s = max(0.0, min(next_tick_s, next_command_s) - time.monotonic())
            ready, _, _ = select.select(list(self._framers), (), (), timeout_s)
            for link in ready:
                self._receive(link)

    def close(self) -> None:
        """Close the links."""
        self._hil.close()
        self._ground.close()

    @property
    def unanswered(self) -> int:
        """Number of samples and commands without an answer."""
        return len(self._sent_s) + len(self._asked_s)

    def _send_sample(self, now_s: float) -> None:
        """Send a sensor sample."""
        self._tick += 1
        time_us = self._tick * round(TICK_S * 1e6)
        self._sent_s[time_us] = now_s
        message = dialect.by_name("HIL_SENSOR")
        self._hil.send(encode(message, sensors(time_us, depth_m=2.0), 0, 2, 1))

    def _send_command(self, now_s: float) -> None:
        """Send a command of the operator."""
        self._asked_s.append(now_s)
        self._ground.send(
            _frame("COMMAND_LONG", OPERATOR, **_command(REQUEST_MESSAGE, AUTOPILOT_VERSION))
        )

    def _receive(self, link: socket.socket) -> None:
        """Match answers to their questions."""
        try:
            data = link.recv(65_535)
        except ConnectionRefusedError:
            return
        now_s = time.monotonic()
        for frame in self._framers[link].feed(data):
            if frame.name == "HIL_ACTUATOR_CONTROLS":
                (time_us,) = struct.unpack("<Q", frame.payload[:8].ljust(8, b"\0"))
                if time_us in self._sent_s:
                    self.tick_s.append(now_s - self._sent_s.pop(time_us))
            elif frame.name == "COMMAND_ACK" and self._asked_s:
                answer = frame.decode()
                if (answer.target_system, answer.target_component) == OPERATOR:
                    self.ack_s.append(now_s - self._asked_s.pop(0))


def run(first: int, count: int) -> Batch:
    """Flood a vehicle, one kind per case."""
    batch = Batch()
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, REAL_TIME_NICENESS)  # the clock of the measurement
    for case in range(first, first + count):
        kind = KINDS[case % len(KINDS)]
        hil, ground = free_port(), free_port()
        with autopilot(f"udpin:127.0.0.1:{hil}", f"udpin:127.0.0.1:{ground}") as child:
            child.set_niceness(REAL_TIME_NICENESS)
            dive = Dive(hil, ground)
            dive.run(2.0)
            _count(batch, "quiet", dive.tick_s)
            dive.tick_s.clear()
            dive.ack_s.clear()
            with flooded(ground, kind, 2.0 * CASE_S) as sent:
                while not sent.value:  # the flooding process loads its libraries
                    dive.run(0.1)
                began_s, before = time.monotonic(), sent.value
                dive.run(CASE_S)
                rate_hz = (sent.value - before) / (time.monotonic() - began_s)
            dive.run(0.5)
            dive.close()
            if not child.running:
                batch.fail(case, f"{kind}: the autopilot has ended")
        _count(batch, "tick", dive.tick_s)
        _count(batch, "ack", dive.ack_s)
        batch.add("floods")
        batch.add("sent per second", rate_hz)
        if rate_hz < MIN_RATE * RATE_HZ:
            batch.fail(case, f"{kind}: only {rate_hz:.0f} messages/s were sent")
        late = [time_s for time_s in dive.ack_s if time_s > MAX_ACK_S]
        if late or dive.unanswered > 1:
            text = f"{kind}: {len(late)} of {len(dive.ack_s)} acknowledgements late"
            slowest_s = max(dive.ack_s, default=0.0)
            batch.fail(case, f"{text}, slowest {slowest_s:.3f} s, {dive.unanswered} unanswered")
    return batch


def _count(batch: Batch, name: str, times_s: Sequence[float]) -> None:
    """Add times to the classes of a name."""
    for time_s in times_s:
        bucket = next((limit for limit in BUCKETS_MS if 1e3 * time_s <= limit), 10_000)
        batch.add(f"{name} <= {bucket} ms")
    batch.add(f"{name}s", len(times_s))
    batch.add(f"max {name} s", max(times_s, default=10.0))


def share_within(counts: Mapping[str, float], name: str, limit_ms: float) -> float:
    """Return the share of answers within a time."""
    total = counts.get(f"{name}s", 0.0)
    within = sum(counts.get(f"{name} <= {ms} ms", 0.0) for ms in BUCKETS_MS if ms <= limit_ms)
    return within / total if total else 0.0


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    ticks, quiet = (share_within(counts, name, 1e3 * MAX_TICK_P99_S) for name in ("tick", "quiet"))
    acks = share_within(counts, "ack", 1e3 * MAX_ACK_S)
    rate_hz = counts.get("sent per second", 0.0) / max(1.0, counts.get("floods", 0.0))
    return (
        f"{rate_hz:.0f} messages/s, {counts.get('ticks', 0):.0f} ticks,"
        f" {100 * ticks:.2f} % answered within 20 ms"
        f" ({100 * quiet:.2f} % without flood), slowest"
        f" {1e3 * counts.get('max tick s', 0):.0f} ms; {counts.get('acks', 0):.0f} commands,"
        f" {100 * acks:.2f} % within 100 ms, slowest {1e3 * counts.get('max ack s', 0):.0f} ms"
    )


ROW = Row(
    title="flood of 5,000 messages/s for 60 s at speed 1, each kind",
    full_size=len(KINDS),
    batch_size=1,
    run=run,
    describe=describe,
    holds=lambda counts: (
        not counts.get("failures") and share_within(counts, "tick", 1e3 * MAX_TICK_P99_S) >= 0.99
    ),
    requirement="tick on time (p99), every command answered within 100 ms",
)
