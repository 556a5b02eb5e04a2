"""Joining of the chunks of a STATUSTEXT that is longer than one message."""

from mavlink_io.dialect import Message

CHUNK_LENGTH = 50
"""Number of bytes of a chunk that another one follows; of characters, as texts are ASCII."""


class TextJoiner:
    """Collect the chunks of each system's texts until a text is complete."""

    def __init__(self) -> None:
        self._incomplete: dict[int, tuple[int, str]] = {}

    def add(self, system: int, message: Message) -> str | None:
        """Add a chunk, and return the text if it is complete.

        Parameters
        ----------
        system : int
            System id of the sender.
        message : namedtuple
            Decoded STATUSTEXT.

        Returns
        -------
        str or None
            The complete text; None if more chunks follow. A text whose end was lost is dropped when
            another one begins.
        """
        text_id, beginning = self._incomplete.pop(system, (0, ""))
        text: str = (beginning if message.id == text_id else "") + message.text
        if message.id and len(message.text) == CHUNK_LENGTH:
            self._incomplete[system] = message.id, text
            return None
        return text
