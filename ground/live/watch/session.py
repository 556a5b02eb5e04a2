"""Run ``ground watch``: one snapshot, or a live view until Ctrl-C."""

from pathlib import Path
from types import FrameType

from rich.console import Console
from rich.live import Live

from ground.cli.options import print_result
from ground.client.signing import open_signing
from ground.errors import INTERRUPTED, Interrupted
from ground.live.listeners import Listeners
from ground.live.watch import rows, view
from ground.live.watch.receiver import Receiver
from ground.terminal import console, is_redrawable
from mavlink_io.clock import wall_s
from mavlink_io.errors import OperationError
from mavlink_io.parent_watch import on_end_signals
from mavlink_io.transport import open_transport

REFRESH_S = 0.2
VEHICLE_TIMEOUT_S = 5.0
"""Maximum time that a snapshot waits for a vehicle (s)."""
LISTEN_S = 3.0
"""Time that a snapshot then receives (s); some messages arrive every two seconds only."""


def watch(
    connect: str,
    sign: Path | None,
    *,
    once: bool,
    json: bool,
    listener: Listeners | None = None,
) -> None:
    """Show the telemetry that is received at an address.

    Parameters
    ----------
    connect : str
        Address of the link.
    sign : Path or None
        File with the signing key.
    once : bool
        Whether to print one snapshot instead of the live view.
    json : bool
        Whether to print one snapshot as JSON.
    listener : Listeners, optional
        Listeners to the telemetry; the live view shows their pictures.

    Raises
    ------
    AddressError
        The address is invalid or cannot be opened.
    InputError
        The key cannot be read.
    OperationError
        No vehicle was received for a snapshot.
    Interrupted
        The user ended the program before a vehicle was received for a snapshot.
    """
    page = console()
    with open_signing(sign) as key:
        transport = open_transport(connect)
        # until here Ctrl-C interrupts: a key may be a pipe, a server may be slow
        stopped = Stopped()
        try:
            receiver = Receiver(transport, key)
            receiver.listener = listener
            if once or json or not is_redrawable(page):
                _listen_once(receiver, stopped)
                if json:
                    print_result(rows.as_json(receiver, wall_s()), "", json)
                else:
                    page.print(view.draw(receiver, wall_s()))
            else:
                _show_live(receiver, page, stopped, listener)
        finally:
            transport.close()


class Stopped:
    """Flag that becomes true at Ctrl-C, the normal end of a live view."""

    def __init__(self) -> None:
        self._stopped = False
        on_end_signals(self._stop)

    def __call__(self) -> bool:
        """Return whether the user has ended the view."""
        return self._stopped

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self._stopped = True


def _listen_once(receiver: Receiver, stopped: Stopped) -> None:
    """Receive from a vehicle for `LISTEN_S`. Raises OperationError, Interrupted without one."""
    until_s = wall_s() + VEHICLE_TIMEOUT_S
    receiver.listen(REFRESH_S)
    while receiver.vehicle_id is None and wall_s() < until_s and not stopped():
        receiver.listen(REFRESH_S)
    if receiver.vehicle_id is None and stopped():
        raise Interrupted(INTERRUPTED)
    if receiver.vehicle_id is None:
        raise OperationError(
            f"no vehicle on {receiver.address}: {receiver.trouble or receiver.diagnosis()}"
        )
    until_s = wall_s() + LISTEN_S
    while wall_s() < until_s and not stopped():
        receiver.listen(REFRESH_S)


def _show_live(
    receiver: Receiver, page: Console, stopped: Stopped, listener: Listeners | None
) -> None:
    """Receive and draw every REFRESH_S until stopped."""
    drawn_s = 0.0
    with Live(console=page, auto_refresh=False, screen=True) as live:
        while not stopped():
            receiver.listen(REFRESH_S)
            if wall_s() - drawn_s > REFRESH_S:
                drawn_s = wall_s()
                if listener is not None:
                    listener.poll()
                estimate = listener.picture() if listener is not None else None
                live.update(view.draw(receiver, drawn_s, estimate), refresh=True)
