"""Run ``ground live``: receive a vehicle and serve the page until Ctrl-C."""

import os
import sys
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from ground.client.signing import open_signing
from ground.client.vehicle import StatusText
from ground.live.page import server
from ground.live.page.dive import LinkCounts
from ground.live.page.page_state import PageState
from ground.live.page.plan import PlanReader
from ground.live.watch.receiver import LISTENER_RATES_HZ, OWN_ID, Receiver
from ground.live.watch.session import Stopped
from mavlink_io.codec import Frame
from mavlink_io.transport import open_transport

LISTEN_S = 0.05
"""Maximum wall time between two polls (s)."""
PICTURE_RATES_HZ = {
    "ATTITUDE": 10.0,
    "ACTUATOR_OUTPUT_STATUS": 10.0,
    "LOCAL_POSITION_NED": 5.0,
    "ATTITUDE_TARGET": 2.0,
    "POSITION_TARGET_LOCAL_NED": 2.0,
}
"""Message rates (Hz) that the page requests where the vehicle sends less."""


class Estimator(Protocol):
    """The live estimate, as `ground.live.session.LiveSession`."""

    def on_frame(self, frame: Frame) -> None:
        """Add a frame."""

    def on_text(self, text: StatusText) -> None:
        """Add a text."""

    def poll(self) -> None:
        """Update the estimate when due."""

    def panel(self) -> dict[str, Any]:
        """Return the estimate for the page."""


class _Listener:
    """Passes what a `Receiver` gets to the page, the plan reader and the estimate."""

    def __init__(self, receiver: Receiver, state: PageState, estimator: Estimator | None) -> None:
        self._receiver, self._state, self._estimator = receiver, state, estimator
        self._plans: PlanReader | None = None
        self._name = receiver.address
        with state.dive(self._name):
            pass

    def begin(self, parameters: object) -> None:
        """Do nothing: an observer reads no parameters."""

    def on_frame(self, frame: Frame) -> None:
        """Pass on a frame."""
        with self._state.dive(self._name) as dive:
            dive.on_frame(frame)
        if self._plans is not None:
            self._plans.feed(frame)
        if self._estimator is not None:
            self._estimator.on_frame(frame)

    def on_text(self, text: StatusText) -> None:
        """Pass on a text."""
        with self._state.dive(self._name) as dive:
            dive.on_text(text)
        if self._estimator is not None:
            self._estimator.on_text(text)

    def poll(self, *, last: bool = False) -> None:
        """Update plans, estimate and counts; show the end after the ``last`` call."""
        receiver = self._receiver
        if self._plans is None and receiver.vehicle_id is not None:
            self._plans = PlanReader(receiver.send, OWN_ID, receiver.vehicle_id)
        if self._plans is not None and not last:
            self._plans.poll()
        if self._estimator is not None:
            self._estimator.poll()
        with self._state.dive(self._name) as dive:
            dive.counts = LinkCounts(
                receiver.frames,
                receiver.received_bytes,
                receiver.lost_frames,
                receiver.rejected_frames,
            )
            dive.trouble = receiver.trouble or ("" if receiver.vehicle_id else receiver.diagnosis())
            dive.items = self._plans.items if self._plans else ()
            dive.estimate = self._estimator.panel() if self._estimator else None
            if last:
                dive.end("`ground live` has ended")


def live(
    connect: str,
    sign: Path | None,
    *,
    host: str,
    port: int | None,
    announce: Callable[[str], None],
    estimator: Estimator | None = None,
) -> None:
    """Serve the page of the vehicle at an address until Ctrl-C.

    Parameters
    ----------
    connect : str
        Address of the link.
    sign : Path or None
        File with the signing key.
    host : str
        Address of the interface that serves the page.
    port : int or None
        TCP port of the page; None to choose one.
    announce : callable
        Receives the address of the page.
    estimator : Estimator, optional
        Live estimate that has begun.

    Raises
    ------
    AddressError
        The address of the link is invalid or cannot be opened.
    InputError
        The key cannot be read, or the page's port cannot be used.
    """
    state = PageState()
    with open_signing(sign) as key:
        transport = open_transport(connect)
        # until here Ctrl-C interrupts: a key may be a pipe, a server may be slow
        stopped = Stopped()
        try:
            receiver = Receiver(transport, key)
            receiver.rates_hz = LISTENER_RATES_HZ if estimator else PICTURE_RATES_HZ
            listener = _Listener(receiver, state, estimator)
            receiver.listener = listener
            opened = server.listen(host, port)
            with server.PageServer(state, opened):
                announce(server.url(opened))
                while not stopped():
                    receiver.listen(LISTEN_S)
                    listener.poll()
                listener.poll(last=True)
        finally:
            transport.close()


def open_browser(address: str) -> bool:
    """Open the page in the user's browser, if this machine has a display.

    Parameters
    ----------
    address : str
        Address of the page.

    Returns
    -------
    bool
        Whether a browser was started.
    """
    has_display = sys.platform == "darwin" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    )
    return has_display and webbrowser.open(address)
