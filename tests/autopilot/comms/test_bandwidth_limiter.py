"""Send queue of a slow line: rate limit, all replies, and the newest telemetry."""

from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.comms.bandwidth_limiter import QueuedFrame, SendQueue, TokenBucket
from autopilot.comms.ground_links import (
    BATCH_S,
    BandwidthLimitedLink,
    GroundLink,
    ground_link,
)
from mavlink_io import dialect
from mavlink_io.codec import MAX_FRAME_BYTES, Frame, Framer, encode

BAUDS = st.sampled_from((1200, 9600, 38_400, 57_600, 115_200, 921_600))


class Line:
    """Serial-line transport that records the time of each write."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.now_s = 0.0
        self.written: list[tuple[float, bytes]] = []

    def handles(self) -> tuple[()]:
        return ()

    def send(self, data: bytes) -> None:
        self.written.append((self.now_s, data))

    def receive(self) -> bytes:
        return b""

    def close(self) -> None:
        pass

    def frames(self) -> list[Frame]:
        return Framer().feed(b"".join(data for _, data in self.written))


class Step(NamedTuple):
    """A message to send, and the pause after it."""

    kind: str
    number: int
    pause_s: float


steps = st.lists(
    st.builds(
        Step,
        st.sampled_from(("vital", "telemetry", "bulk")),
        st.integers(0, 2),
        st.sampled_from((0.0, 0.003, 0.2)),
    ),
    max_size=80,
)
PING, FILE = (dialect.by_name(name) for name in ("PING", "FILE_TRANSFER_PROTOCOL"))
STREAMS = tuple(dialect.by_name(name) for name in ("ATTITUDE", "VFR_HUD", "GLOBAL_POSITION_INT"))


def fields(message: dialect.MessageType, stamp: int) -> tuple[Any, ...]:
    """Return zeros with the stamp as first field."""
    blank = message.unpack(b"")
    return (stamp, *blank[1:])


def send_step(link: GroundLink, step: Step, stamp: int) -> None:
    if step.kind == "vital":
        link.write(PING, fields(PING, stamp))
    elif step.kind == "telemetry":
        message = STREAMS[step.number]
        link.stream(message, (stamp, *(1 for _ in message.fields[1:])))
    else:
        payload = stamp.to_bytes(4, "little").ljust(251, b"\1")
        link.write(FILE, (0, 255, 190, payload))


def run(baud: int, step_list: list[Step]) -> Line:
    """Send the steps on a link that is flushed like in the server, until the queue is empty."""
    line = Line(f"serial:/dev/x:{baud}")
    link = ground_link(line, 1)
    assert isinstance(link, BandwidthLimitedLink)

    def pass_time(duration_s: float) -> None:
        until_s = line.now_s + duration_s
        while (wait_s := link.wait_s(line.now_s)) is not None and line.now_s + wait_s <= until_s:
            line.now_s += wait_s
            link.flush(line.now_s)
        line.now_s = max(line.now_s, until_s)

    for stamp, step in enumerate(step_list, start=1):
        send_step(link, step, stamp)
        pass_time(step.pause_s)
    pass_time(600.0)
    assert link.wait_s(line.now_s) is None
    return line


def stamps(line: Line, name: str) -> list[int]:
    values = [frame.decode() for frame in line.frames() if frame.name == name]
    if name == "FILE_TRANSFER_PROTOCOL":
        return [int.from_bytes(bytes(value.payload[:4]), "little") for value in values]
    return [value[0] for value in values]


@given(BAUDS, steps)
def test_limited_link_never_exceeds_rate(baud: int, step_list: list[Step]) -> None:
    written = run(baud, step_list).written
    rate = 0.7 * baud / 10
    for first in range(len(written)):
        sent = 0
        for time_s, data in written[first:]:
            sent += len(data)
            assert (
                sent
                <= max(MAX_FRAME_BYTES, 0.1 * rate) + rate * (time_s - written[first][0]) + 1e-6
            )


@given(BAUDS, steps)
def test_limited_link_sends_every_reply_in_order(baud: int, step_list: list[Step]) -> None:
    line = run(baud, step_list)
    numbered = list(enumerate(step_list, start=1))
    assert stamps(line, "PING") == [stamp for stamp, step in numbered if step.kind == "vital"]
    assert stamps(line, "FILE_TRANSFER_PROTOCOL") == [
        stamp for stamp, step in numbered if step.kind == "bulk"
    ]
    sequences = [frame.sequence for frame in line.frames()]
    assert sequences == [n & 0xFF for n in range(1, len(sequences) + 1)], (
        "dropped frames leave no gap in the sequence"
    )


@given(BAUDS, steps)
def test_limited_link_sends_newest_telemetry_in_order(baud: int, step_list: list[Step]) -> None:
    line = run(baud, step_list)
    for number, message in enumerate(STREAMS):
        queued = [
            n
            for n, step in enumerate(step_list, start=1)
            if (step.kind, step.number) == ("telemetry", number)
        ]
        sent = stamps(line, message.name)
        assert sent == sorted(set(sent))
        assert sent[-1:] == queued[-1:]


def test_limited_link_sends_reply_before_queued_frames() -> None:
    line = Line("serial:/dev/x:9600")
    link = ground_link(line, 1)
    for stamp in range(20):
        send_step(link, Step("bulk", 0, 0.0), stamp)
        send_step(link, Step("telemetry", stamp % 3, 0.0), stamp)
    link.flush(0.0)
    send_step(link, Step("vital", 0, 0.0), 7)
    already = len(line.frames())
    for tenth in range(1, 20):
        link.flush(0.1 * tenth)
    assert line.frames()[already].name == "PING"


def test_limited_link_shares_rate_between_bulk_and_telemetry() -> None:
    line = Line("serial:/dev/x:57600")
    link = ground_link(line, 1)
    for stamp in range(3000):
        line.now_s = stamp * BATCH_S
        while link.room_bytes() >= MAX_FRAME_BYTES:
            send_step(link, Step("bulk", 0, 0.0), stamp)
        for number in range(3):
            send_step(link, Step("telemetry", number, 0.0), stamp)
        link.flush(line.now_s)
    amounts = {"bulk": 0, "telemetry": 0}
    for frame in line.frames():
        amounts["bulk" if frame.name == "FILE_TRANSFER_PROTOCOL" else "telemetry"] += len(frame.raw)
    total = sum(amounts.values())
    assert total == pytest.approx(0.7 * 5760 * 60.0, rel=0.02), "the whole rate is used"
    assert amounts["bulk"] == pytest.approx(0.5 * total, rel=0.02)
    assert all(stamps(line, message.name) for message in STREAMS)


@pytest.mark.parametrize(
    "address", ["serial:/dev/x:9600", "serial:/dev/x:57600", "tcp:127.0.0.1:5760"]
)
def test_room_bytes_limits_delay_of_replies(address: str) -> None:
    line = Line(address)
    link = ground_link(line, 1)
    for tick in range(200):
        line.now_s = tick * 0.05
        while link.room_bytes() >= MAX_FRAME_BYTES:
            send_step(link, Step("bulk", 0, 0.0), tick)
        link.flush(line.now_s)
    line.now_s += 0.05
    link.flush(line.now_s)
    send_step(link, Step("vital", 0, 0.0), 1)
    asked_s = line.now_s
    while not stamps(line, "PING"):
        line.now_s += 0.01
        link.flush(line.now_s)
    assert line.now_s - asked_s < 0.5
    assert len(stamps(line, "FILE_TRANSFER_PROTOCOL")) > 15


def test_discarded_frames_are_never_sent() -> None:
    line = Line("serial:/dev/x:9600")
    link = ground_link(line, 1)
    for stamp, kind in enumerate(("vital", "telemetry", "bulk")):
        send_step(link, Step(kind, 0, 0.0), stamp)
    link.flush(0.0, discard=True)
    link.flush(9.0)
    assert line.written == []
    assert link.wait_s(9.0) is None


def forwarded(name: str, stamp: int, system: int = 9) -> Frame:
    message = dialect.by_name(name)
    (frame,) = Framer().feed(encode(message, fields(message, stamp), stamp, system, 1))
    return frame


def test_forwarded_frames_follow_the_same_priorities() -> None:
    line = Line("serial:/dev/x:9600")
    link = ground_link(line, 1)
    for stamp in range(1, 30):
        link.forward(forwarded("ATTITUDE", stamp))
        link.forward(forwarded("ATTITUDE", stamp, system=8))
        link.forward(forwarded("PARAM_VALUE", stamp))
        link.forward(forwarded("FILE_TRANSFER_PROTOCOL", stamp))
    for second in range(100):
        link.flush(float(second))
    received = [
        (frame.system, frame.sequence) for frame in line.frames() if frame.name == "ATTITUDE"
    ]
    assert received == [(9, 29), (8, 29)]
    assert [f.sequence for f in line.frames() if f.name == "PARAM_VALUE"] == list(range(1, 30))
    assert 0 < len([f for f in line.frames() if f.name == "FILE_TRANSFER_PROTOCOL"]) < 29, (
        "dropped frames are requested again"
    )


def test_queue_blocks_until_first_frame_fits() -> None:
    queue = SendQueue()
    queue.add_reply(QueuedFrame(100, lambda: b"a"))
    queue.add_telemetry("kind", QueuedFrame(1, lambda: b"b"))
    assert queue.pop(99) is None
    assert (queue.pop(100), queue.pop(1), queue.pop(1000)) == (b"a", b"b", None)


def test_token_bucket_limits_unused_bytes_to_burst() -> None:
    budget = TokenBucket(10_000.0)
    assert budget.available_bytes(5.0) == 1000.0
    budget.spend(1000)
    assert [budget.available_bytes(now_s) for now_s in (5.0, 5.0625, 1e9)] == [0.0, 625.0, 1000.0]
