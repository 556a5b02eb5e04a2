"""Connections of the live page: how many there are, and how long one may wait for a request."""

import asyncio
from typing import cast

from uvicorn.protocols.http.h11_impl import H11Protocol

MAX_CONNECTIONS = 64
"""Maximum number of open connections; a browser opens at most six."""
REQUEST_TIMEOUT_S = 10.0
"""Wall time in which the head of a request must arrive."""


class PageConnection(H11Protocol):
    """One connection to the page.

    A connection without a request in progress is closed after REQUEST_TIMEOUT_S, however slowly a
    part of its request arrives. Where there are MAX_CONNECTIONS, the one that has waited longest
    gives way to a new one; a new one is refused if all of them are being answered. A stream of
    events is a request in progress.
    """

    _deadline: asyncio.TimerHandle | None = None
    """Closes the connection; None while a request is in progress, and for a refused one."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Open the connection, or refuse it.

        Parameters
        ----------
        transport : Transport
            The connection.
        """
        others = [cast(PageConnection, one) for one in self.connections]
        waiting = [one for one in others if one._deadline is not None]
        answering = [one for one in others if one._is_answering]
        super().connection_made(transport)
        self._await_request()
        if len(waiting) + len(answering) >= MAX_CONNECTIONS:
            first = min(waiting, key=PageConnection._due_s, default=self)
            first._end_deadline()
            first.transport.abort()

    def data_received(self, data: bytes) -> None:
        """Take a part of a request.

        Parameters
        ----------
        data : bytes
            The part.
        """
        super().data_received(data)
        if self._is_answering:
            self._end_deadline()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._await_request()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection.

        Parameters
        ----------
        exc : Exception or None
            Reason; None if one side has closed it.
        """
        self._end_deadline()
        super().connection_lost(exc)

    @property
    def _is_answering(self) -> bool:
        """Whether a request is in progress."""
        return self.cycle is not None and not self.cycle.response_complete

    def _await_request(self) -> None:
        """Close the connection after REQUEST_TIMEOUT_S without a request."""
        self._end_deadline()
        if not self._is_answering:
            self._deadline = self.loop.call_later(REQUEST_TIMEOUT_S, self.transport.close)

    def _end_deadline(self) -> None:
        """Let the connection stay open."""
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _due_s(self) -> float:
        """Return the time at which the connection is closed, clock of the loop."""
        assert self._deadline is not None
        return self._deadline.when()
