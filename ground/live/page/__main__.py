"""Process of the live page of a flight: ``python -m ground.live.page FEED LISTENER``.

The arguments are descriptors that `ground.live.page.feed` passes on. It ends when the feed ends.
"""

import signal
import socket
import sys

import msgspec

from ground.live.page.feed import LENGTH, FeedMessage
from ground.live.page.page_state import PageState
from ground.live.page.server import PageServer
from mavlink_io.codec import Frame


def main() -> None:
    """Serve the page until the feed ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    feed, listener = (socket.socket(fileno=int(number)) for number in sys.argv[1:3])
    state, decoder = PageState(), msgspec.msgpack.Decoder(FeedMessage)
    with feed, PageServer(state, listener), feed.makefile("rb") as stream:
        while len(head := stream.read(LENGTH.size)) == LENGTH.size:
            data = stream.read(LENGTH.unpack(head)[0])
            if len(data) < LENGTH.unpack(head)[0]:
                break
            show(state, decoder.decode(data))


def show(state: PageState, message: FeedMessage) -> None:
    """Add a message of the feed to the state of the page."""
    with state.dive(message.dive) as dive:
        dive.counts = message.counts
        dive.travel_deg = message.travel_deg or dive.travel_deg
        dive.items = message.items or dive.items
        dive.estimate = message.estimate
        for system, component, number, payload in message.frames:
            dive.on_frame(Frame(system, component, number, 0, payload, b""))
        for text in message.texts:
            dive.on_text(text)
        if message.ended:
            dive.end(message.ended)


if __name__ == "__main__":
    main()
