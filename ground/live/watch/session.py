"""One session of ``ground watch``: a look, or a live view until Ctrl-C."""

from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.live import Live

from ground.cli.options import print_result
from ground.client.signing import open_signing
from ground.errors import OperationError
from ground.live.watch import rows, view
from ground.live.watch.receiver import Receiver
from ground.terminal import console
from mavlink_io.clock import wall_s
from mavlink_io.parent_watch import on_end_signals
from mavlink_io.transport import open_transport

if TYPE_CHECKING:
    from ground.live.listeners import Listeners

REFRESH_S = 0.2
VEHICLE_TIMEOUT_S = 5.0
"""How long one look waits for a vehicle."""
LISTEN_S = 3.0
"""How long it then listens: long enough for what comes every two seconds."""


def watch(
    connect: str,
    sign: Path | None,
    *,
    once: bool,
    json: bool,
    prior: str | None = None,
    gains: Path | None = None,
) -> None:
    """Show what is heard at an address; with a ``prior``, also what tests tell of her, with
    ``gains`` whether she keeps what they promise.

    Raises:
        AddressError, BadInputError, FailedError: as one would expect of each.
    """
    follower = _listeners(prior, gains)
    stopped = _Stopped()
    page = console()
    with open_signing(sign) as key:
        transport = open_transport(connect)
        try:
            ears = Receiver(transport, key)
            ears.follower = follower
            if once or json or not page.is_terminal:
                _listen_once(ears, stopped)
                if json:
                    print_result(rows.as_json(ears, wall_s()), "", json)
                else:
                    page.print(view.draw(ears, wall_s()))
            else:
                _show_live(ears, page, stopped, follower)
        finally:
            transport.close()


def _listeners(prior: str | None, gains: Path | None) -> "Listeners | None":
    """Who makes something of what she tells; nobody unless asked. Raises BadInputError."""
    from ground.live.listeners import Listeners, VisibleListener

    each: list[VisibleListener] = []
    if prior:
        from ground.live.session import LiveSession as Estimating

        each.append(Estimating(prior))
    if gains:
        from ground.client.param_file import require_baseline
        from ground.live.performance_monitor import PerformanceMonitor

        each.append(PerformanceMonitor(require_baseline(gains)))
    found = Listeners(each)
    found.begin({})
    return found if each else None


class _Stopped:
    """Turns true at Ctrl-C: a view has nothing that would be lost, so that this is how it properly
    ends."""

    def __init__(self) -> None:
        self._stopped = False
        on_end_signals(self._stop)

    def __call__(self) -> bool:
        return self._stopped

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self._stopped = True


def _listen_once(ears: Receiver, stopped: _Stopped) -> None:
    """Listen until a vehicle was heard for a while. Raises FailedError when there is none."""
    until_s = wall_s() + VEHICLE_TIMEOUT_S
    ears.listen(REFRESH_S)
    while ears.vehicle_id is None and wall_s() < until_s and not stopped():
        ears.listen(REFRESH_S)
    if ears.vehicle_id is None:
        raise OperationError(f"no vehicle on {ears.address}: {ears.trouble or ears.why_nothing()}")
    until_s = wall_s() + LISTEN_S
    while wall_s() < until_s and not stopped():
        ears.listen(REFRESH_S)


def _show_live(
    ears: Receiver, page: Console, stopped: _Stopped, follower: "Listeners | None"
) -> None:
    drawn_s = 0.0
    with Live(console=page, auto_refresh=False, screen=True) as live:
        while not stopped():
            ears.listen(REFRESH_S)
            if wall_s() - drawn_s > REFRESH_S:
                drawn_s = wall_s()
                if follower is not None:
                    follower.poll()
                told = follower.picture() if follower is not None else None
                live.update(view.draw(ears, drawn_s, told), refresh=True)
