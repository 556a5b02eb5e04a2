"""Start and end of the autopilot process: options, stored parameters, links and signals."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from autopilot.app import App
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink
from autopilot.comms.signing_keys import SigningKeys
from autopilot.control.lqg_file import load as load_controllers
from autopilot.control.params import ParamTable
from autopilot.control.types import Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_file import load
from autopilot.param_store import ParamStore
from autopilot.telemetry.identity import AutopilotId, version
from autopilot.vehicle import Vehicle
from mavlink_io.parent_watch import end_with_stdin, on_end_signals
from mavlink_io.printable import printable
from mavlink_io.transport import SEND_TIMEOUT_S, open_transport

MAX_SEND_BLOCK_S = 0.2
"""Longest time that a send to a TCP client may block when the vehicle does not wait for the answer.

A client stops reading when the vehicle dives and Wi-Fi is lost."""


class Options(NamedTuple):
    """Options of the command line."""

    hil: str
    """Address of the link to the simulator or to the sensors."""
    ground: Sequence[str]
    """Addresses of the ground links."""
    params: Path | None
    """Parameter file."""
    controller: Path | None
    """LQG controller that replaces the PIDs."""
    sign: Sequence[str]
    """ADDRESS=KEYFILE of each signed ground link."""
    autopilot_id: AutopilotId
    logs: Path | None
    """Folder of the onboard logs; None for none."""
    state: Path | None
    """Folder of the stored parameters; None for none."""
    lifeline: bool
    """Whether the process ends when standard input is closed."""


def run(options: Options) -> None:
    """Fly until an end signal.

    Raises
    ------
    CaribouError
        An option cannot be used, or the HIL link is lost.
    """
    param_store = ParamStore(options.state)
    stored = param_store.load()
    table = ParamTable(
        stored | (load(options.params) if options.params else {}),
        stored,
        load_controllers(options.controller) if options.controller else None,
    )
    vehicle = Vehicle(table)
    keys = SigningKeys.from_options(options.sign, options.ground)
    hil = HilLink(open_transport(options.hil, wait_for_device=True), vehicle.system)
    send_timeout_s = SEND_TIMEOUT_S if hil.lockstep else MAX_SEND_BLOCK_S
    transports = [
        open_transport(address, wait_for_device=True, send_timeout_s=send_timeout_s)
        for address in options.ground
    ]
    onboard_log = OnboardLog(vehicle, options.logs, version())
    ground = GroundServer(vehicle, transports, options.autopilot_id, keys, onboard_log, param_store)
    links = ", ".join(link.transport.address for link in ground.links)
    _say(f"system {vehicle.system}, HIL {options.hil}, ground {links}")
    if options.controller:
        vehicle.send_statustext(f"Controller: {options.controller.name}", Severity.INFO)
    for problem in param_store.problems:
        vehicle.send_statustext(f"Parameters: {problem}")
        _say(printable(problem))
    stop = Stop()
    if options.lifeline:
        end_with_stdin()
    try:
        App(vehicle, hil, ground, onboard_log).run(stop)
    finally:
        for problem in (keys.save(), param_store.close(table)):
            if problem:
                _say(printable(problem))


def _say(text: str) -> None:
    """Print a line on standard error."""
    print(f"autopilot: {text}", file=sys.stderr, flush=True)


class Stop:
    """Flag that becomes true at the first end signal (SIGINT, SIGTERM or SIGHUP)."""

    def __init__(self) -> None:
        self._requested = False
        on_end_signals(self._request)

    def __call__(self) -> bool:
        """Return whether an end signal was received."""
        return self._requested

    def _request(self, *_: object) -> None:
        """Set the flag; called by the signal handler."""
        self._requested = True
