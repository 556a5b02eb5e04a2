"""Pieces of a download in the order of a file, however the link delivers them."""

from typing import BinaryIO


class OrderedPieces:
    """Append the pieces of a file to a sink without a gap; keep those after one."""

    def __init__(self, sink: BinaryIO, start: int) -> None:
        """Begin with the byte number ``start``: the sink has those before it."""
        self._sink = sink
        self.written = start
        """Number of bytes in the sink."""
        self.pending: dict[int, bytes] = {}
        """Pieces after a gap by offset."""

    def add(self, offset: int, data: bytes) -> bool:
        """Add a piece and append all that follow without a gap; return whether it is a new one."""
        is_new = offset + len(data) > self.written and offset not in self.pending
        self.pending[offset] = data
        for first in sorted(self.pending):
            if first > self.written:
                break
            rest = self.pending.pop(first)[self.written - first :]
            self._sink.write(rest)
            self.written += len(rest)
        return is_new
