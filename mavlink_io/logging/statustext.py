"""Joins the chunks of a STATUSTEXT that is longer than one message."""

from mavlink_io.dialect import Message

CHUNK_LENGTH = 50


class TextJoiner:
    """Collects the chunks of each system until a text is whole."""

    def __init__(self) -> None:
        self._open: dict[int, tuple[int, str]] = {}

    def add(self, system: int, message: Message) -> str | None:
        """The whole text that ``message`` completes, or None while the rest of it is to follow.

        A text whose end was lost is given up when another one begins.
        """
        known_id, begun = self._open.pop(system, (0, ""))
        text: str = (begun if message.id == known_id else "") + message.text
        if message.id and len(message.text) == CHUNK_LENGTH:
            self._open[system] = message.id, text
            return None
        return text
