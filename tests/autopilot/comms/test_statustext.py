"""Long texts are joined by the receiver to the text that was sent."""

import pytest

from autopilot.comms.statustext import EventPublisher
from autopilot.control.params import ParamTable
from autopilot.control.types import Severity
from autopilot.vehicle import Vehicle
from mavlink_io.dialect import MessageType, Values
from mavlink_io.logging.statustext import TextJoiner


def received_texts(text: str) -> list[str]:
    """Return the texts that a receiver joins from the chunks of one text."""
    vehicle, joiner, received = Vehicle(ParamTable()), TextJoiner(), list[str]()

    def receive(message: MessageType, values: Values) -> None:
        joined = joiner.add(1, message.unpack(message.pack(values)))
        if joined is not None:
            received.append(joined)

    publisher = EventPublisher(vehicle, lambda message: (), receive, receive)
    vehicle.send_statustext(text, Severity.CRITICAL)
    publisher.publish()
    return received


@pytest.mark.parametrize("length", [1, 49, 50, 51, 99, 100, 101, 150])
def test_text_of_any_length_is_joined(length: int) -> None:
    text = "".join(chr(ord("a") + n % 26) for n in range(length))
    assert received_texts(text) == [text]


def test_character_at_the_end_of_a_chunk_is_escaped() -> None:
    path = "x" * 47 + "/j\u00fcrgen/00012.mcap: no space left on device"
    assert received_texts(path) == [path.replace("\u00fc", "\\xfc")]
