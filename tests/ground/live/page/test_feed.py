"""Feed from a flight to the process of the live page: it never blocks and stays small."""

import socket
import subprocess
from collections.abc import Iterator

import msgspec
import pytest

from ground.client.vehicle import StatusText
from ground.live.page import server
from ground.live.page.feed import LENGTH, MAX_SAMPLES, MAX_TEXTS, DiveFeed, FeedMessage, PageProcess
from tests.ground.live.page.telemetry import frame, heartbeat, motion

SECONDS = 100
"""Vehicle time that the page refuses: ten samples a second do not fit into one message."""


class Page:
    """Stands in for the process: takes messages, or refuses them."""

    def __init__(self) -> None:
        self.accepts = True
        self.messages: list[FeedMessage] = []

    def offer(self, message: FeedMessage) -> bool:
        if self.accepts:
            self.messages.append(message)
        return self.accepts


def flown(page: Page, start_s: float, duration_s: float, listener: DiveFeed) -> None:
    for tick in range(int(duration_s * 50)):
        for received in motion(start_s + tick / 50.0):
            listener.on_frame(received)


@pytest.fixture
def page() -> Page:
    return Page()


@pytest.fixture
def listener(page: Page) -> DiveFeed:
    return DiveFeed(page, "a dive")  # type: ignore[arg-type]


def numbers(message: FeedMessage) -> list[int]:
    return [number for _, _, number, _ in message.frames]


def test_motion_is_thinned_by_vehicle_time(page: Page, listener: DiveFeed) -> None:
    flown(page, 0.0, 4.0, listener)
    listener.poll(last=True)
    (message,) = page.messages
    assert numbers(message).count(motion(0.0)[-1].message_id) == 40
    assert message.counts.messages == 4 * 50 * 5
    assert message.ended


def test_refused_messages_leave_a_bounded_rest_with_the_newest_state(
    page: Page, listener: DiveFeed
) -> None:
    page.accepts = False
    listener.on_frame(heartbeat())
    for second in range(SECONDS):
        flown(page, second, 1.0, listener)
        listener.on_text(StatusText(6, f"text {second}"))
        listener.poll(last=True)
    page.accepts = True
    listener.poll(last=True)
    (message,) = page.messages
    assert len(message.frames) <= MAX_SAMPLES + 1
    assert heartbeat().message_id in numbers(message)
    assert [text.text for text in message.texts] == [
        f"text {second}" for second in range(SECONDS - MAX_TEXTS, SECONDS)
    ]
    newest_ms = max(
        int.from_bytes(payload[:4], "little")
        for _, _, number, payload in message.frames
        if number == motion(0.0)[-1].message_id
    )
    assert newest_ms > (SECONDS - 10) * 1000


def test_lost_frames_are_counted_by_sequence(page: Page, listener: DiveFeed) -> None:
    for sequence in (254, 255, 0, 3):
        listener.on_frame(heartbeat()._replace(sequence=sequence))
    listener.poll(last=True)
    assert page.messages[0].counts.lost == 2


def test_all_modes_are_passed_on(page: Page, listener: DiveFeed) -> None:
    for index in (1, 2):
        listener.on_frame(frame("AVAILABLE_MODES", mode_index=index, mode_name=f"MODE {index}"))
    listener.poll(last=True)
    assert len(page.messages[0].frames) == 2


class StoppedProcess(PageProcess):
    """A page process that never reads: the other end of its socket."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pair = socket.socketpair()
        self.other_end = pair[1].dup()
        monkeypatch.setattr(socket, "socketpair", lambda: pair)
        monkeypatch.setattr(subprocess, "Popen", lambda *arguments, **options: None)
        super().__init__(server.listen(port=None))

    def close(self) -> None:
        self._socket.close()
        self.other_end.close()


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Iterator[StoppedProcess]:
    process = StoppedProcess(monkeypatch)
    yield process
    process.close()


def test_offer_to_a_stopped_process_is_refused_without_blocking(stopped: StoppedProcess) -> None:
    message = FeedMessage("a", frames=[(1, 1, 30, bytes(28))] * 1000)
    taken = [stopped.offer(message) for _ in range(200)]
    assert taken[0]
    assert not taken[-1]
    stream = stopped.other_end.makefile("rb")
    whole = msgspec.msgpack.decode(stream.read(LENGTH.unpack(stream.read(LENGTH.size))[0]))
    assert whole[0] == "a"
    stream.close()


def test_offer_to_an_ended_process_is_dropped(stopped: StoppedProcess) -> None:
    stopped.other_end.close()
    assert all(stopped.offer(FeedMessage("a")) for _ in range(3))
