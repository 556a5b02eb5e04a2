"""Joining of the chunks of a STATUSTEXT that is longer than one message."""

from collections.abc import Hashable
from typing import NamedTuple

from mavlink_io.dialect import Message

CHUNK_LENGTH = 50
"""Number of bytes of a chunk that another one follows; of characters, as texts are ASCII."""


MISSING = "[...]"
"""Text in place of chunks that were lost."""


class _Beginning(NamedTuple):
    """Chunks of a text that is not complete."""

    text_id: int
    next_chunk: int
    text: str


class TextJoiner:
    """Collect the chunks of each sender's texts until a text is complete."""

    def __init__(self) -> None:
        self._incomplete: dict[Hashable, _Beginning] = {}

    def add(self, sender: Hashable, message: Message) -> str | None:
        """Add a chunk, and return the text if it is complete.

        Parameters
        ----------
        sender : hashable
            System and component id of the sender; the system id if that is all that is known.
        message : namedtuple
            Decoded STATUSTEXT.

        Returns
        -------
        str or None
            The complete text, with `MISSING` in place of lost chunks; None if more chunks follow,
            or for a second copy of a chunk. A text whose end was lost is dropped when another long
            one begins.
        """
        if not message.id:  # a text of one message
            return str(message.text)
        beginning = self._incomplete.get(sender)
        if beginning is None or message.id != beginning.text_id or not message.chunk_seq:
            beginning = _Beginning(message.id, 0, "")
        if message.chunk_seq < beginning.next_chunk:
            return None
        gap = MISSING if message.chunk_seq > beginning.next_chunk else ""
        text = f"{beginning.text}{gap}{message.text}"
        if len(message.text) == CHUNK_LENGTH:
            self._incomplete[sender] = _Beginning(message.id, message.chunk_seq + 1, text)
            return None
        self._incomplete.pop(sender, None)
        return text
