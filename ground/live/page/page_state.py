"""State of the live page: the dives, and what a browser has not seen yet."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

import msgspec

from ground.live.page.dive import ShownDive
from ground.live.page.history import COLUMNS
from ground.live.page.plan import DrawnPlan

MAX_DIVES = 200
"""Number of dives that are kept; the oldest is dropped."""


class PageState:
    """Dives that are shown, for one thread that writes and one that serves the browsers."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._dives: dict[str, ShownDive] = {}
        self._newest = ""
        self.closing = False
        """Whether the browsers get a last picture and the server ends."""

    @contextmanager
    def dive(self, name: str) -> Iterator[ShownDive]:
        """Lend the dive of a name, which is created at its first use, while the lock is held.

        Parameters
        ----------
        name : str
            Name of the dive.

        Yields
        ------
        ShownDive
            The dive; only valid inside the context.
        """
        with self._lock:
            if name not in self._dives:
                self._dives[name] = ShownDive(name)
                self._newest = name
                while len(self._dives) > MAX_DIVES:
                    self._dives.pop(next(iter(self._dives)))
            yield self._dives[name]

    def news(self, browser: "Browser") -> bytes:
        """Return what a browser has not received, as JSON; empty if there is nothing new.

        Parameters
        ----------
        browser : Browser
            What the browser asked for and has received; it is updated.

        Returns
        -------
        bytes
            A JSON object.
        """
        with self._lock:
            dive = self._dives.get(browser.asked) or self._dives.get(self._newest)
            if dive is None:
                return b""
            message: dict[str, Any] = {}
            if browser.dive is not dive:
                browser.dive, browser.next_row = dive, 0
                browser.panel = browser.plan = browser.names = None
                message["columns"] = COLUMNS
            names = list(self._dives)
            if names != browser.names:
                message["dives"] = browser.names = names
            if browser.next_row < dive.history.count:
                message["rows"] = dive.history.since(browser.next_row)
                browser.next_row = dive.history.count
            if (plan := dive.plan()) != browser.plan:
                message["plan"] = browser.plan = plan
            if (panel := dive.panel()) is not browser.panel:
                message["panel"] = browser.panel = panel
        return msgspec.json.encode(message) if message else b""


class Browser:
    """What one browser asked for, and what it has received.

    Parameters
    ----------
    asked : str
        Name of the dive; another text means the newest one.
    """

    def __init__(self, asked: str = "") -> None:
        self.asked = asked
        self.dive: ShownDive | None = None
        self.next_row = 0
        self.names: list[str] | None = None
        self.plan: DrawnPlan | None = None
        self.panel: dict[str, Any] | None = None
