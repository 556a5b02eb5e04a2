"""Start and end of the autopilot process: options, stored parameters, links and signals."""

import gc
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from autopilot import steady_ticks
from autopilot.app import App
from autopilot.comms.commanders import Commanders, systems_of
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink
from autopilot.comms.modems import modem_intervals
from autopilot.comms.signing_keys import SigningKeys
from autopilot.control import modes
from autopilot.control.lqg_file import load as load_controllers
from autopilot.control.params import ParamTable
from autopilot.control.requests import LoadFence, LoadMission, LoadRally, Request
from autopilot.control.types import Severity
from autopilot.disk import lock_folder
from autopilot.identities import IDENTITIES
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_file import load
from autopilot.param_store import ParamStore
from autopilot.record_json import RecordError
from autopilot.resume import PLAN_NAMES, Items, StateFiles, continued_state, plans_of
from autopilot.supervisor import Beat, ProcessStart
from autopilot.telemetry.autopilot_id import AutopilotId
from autopilot.telemetry.identity import version
from autopilot.vehicle import Vehicle
from mavlink_io.mission_items import FENCE_TYPE, MISSION_TYPE, RALLY_TYPE
from mavlink_io.parent_watch import end_with_stdin, on_end_signals
from mavlink_io.printable import printable
from mavlink_io.transport import SEND_TIMEOUT_S, baud_rate, open_transport

MAX_SEND_BLOCK_S = 0.2
"""Longest time that a send to a TCP client may block when the vehicle does not wait for the answer.

A client stops reading when the vehicle dives and Wi-Fi is lost."""
_LOAD_REQUESTS: dict[int, Callable[[Items], Request]] = {
    MISSION_TYPE: LoadMission,
    FENCE_TYPE: LoadFence,
    RALLY_TYPE: LoadRally,
}
"""Request that loads each kind of plan."""


class AutopilotOptions(NamedTuple):
    """Options of the command line."""

    hil: str
    """Address of the link to the simulator or to the sensors."""
    ground: Sequence[str]
    """Addresses of the ground links."""
    params: Path | None
    """Parameter file."""
    controller: Path | None
    """LQG controller that replaces the PIDs."""
    system_id: int | None
    """MAV_SYS_ID in place of the stored one; None for the stored one."""
    sign: Sequence[str]
    """ADDRESS=KEYFILE of each signed ground link."""
    modem: Sequence[str]
    """ADDRESS or ADDRESS=SECONDS of each ground link that is a modem."""
    accept: str | None
    """System ids that may command, separated by commas; None for all."""
    autopilot_id: AutopilotId
    logs: Path | None
    """Folder of the onboard logs; None for none."""
    state: Path | None
    """Folder of the stored parameters, plans and checkpoint; None for none."""
    lifeline: bool
    """Whether the process ends when standard input is closed."""


def run(options: AutopilotOptions, start: ProcessStart | None = None) -> None:
    """Fly until an end signal.

    Parameters
    ----------
    options : AutopilotOptions
        Options of the command line.
    start : ProcessStart or None
        Start by a supervisor, which continues a dive; None for a start by hand.

    Raises
    ------
    CaribouError
        An option cannot be used, or the HIL link is lost.
    """
    param_store = ParamStore(options.state)
    stored = param_store.load()
    table = ParamTable(
        {
            **IDENTITIES[options.autopilot_id].parameters,
            **stored,
            **(load(options.params) if options.params else {}),
            **({"MAV_SYS_ID": float(options.system_id)} if options.system_id else {}),
        },
        stored,
        load_controllers(options.controller) if options.controller else None,
    )
    # A supervised autopilot starts again within milliseconds; to load machine code takes longer.
    simulated = baud_rate(options.hil) is None and start is None
    vehicle = Vehicle(table, compiled=simulated and steady_ticks.is_compiled())
    commanders = Commanders(() if options.accept is None else systems_of(options.accept))
    keys = SigningKeys.from_options(options.sign, options.ground)
    hil = HilLink(open_transport(options.hil, wait_for_device=True), vehicle.system)
    waits = hil.lockstep and start is None  # a supervisor ends an autopilot that waits for long
    send_timeout_s = SEND_TIMEOUT_S if waits else MAX_SEND_BLOCK_S
    transports = [
        open_transport(address, wait_for_device=True, send_timeout_s=send_timeout_s)
        for address in options.ground
    ]
    onboard_log = OnboardLog(vehicle, options.logs, version())
    ground = GroundServer(
        vehicle,
        transports,
        options.autopilot_id,
        keys,
        onboard_log,
        param_store,
        commanders=commanders,
        modems=modem_intervals(options.modem, options.ground),
    )
    stop = Stop(start.beat if start else None)  # before others know that it runs, and may end it
    links = ", ".join(link.transport.address for link in ground.links)
    _say(f"system {vehicle.system}, HIL {options.hil}, ground {links}")
    if options.controller:
        vehicle.send_statustext(f"Controller: {options.controller.name}", Severity.INFO)
    if options.state and not lock_folder(options.state):
        param_store.problems.append(
            f"{options.state}: another autopilot stores its parameters here too; give each its own"
            " --state"
        )
    for problem in param_store.problems:
        vehicle.send_statustext(f"Parameters: {problem}")
        _say(printable(problem))
    files = StateFiles(options.state, vehicle.system, options.hil)
    app = App(vehicle, hil, ground, onboard_log, files)
    _load_plans(vehicle, files)
    if start is not None:
        _continue_dive(vehicle, app, files, start)
    if options.lifeline:
        end_with_stdin()
    ordered_end = False
    # Without it a full garbage collection visits all imported code, which takes 15 ms.
    gc.collect()
    gc.freeze()
    try:
        app.run(stop)
        ordered_end = not stop.orphaned
    finally:
        plans = plans_of(vehicle.state) if ordered_end else None
        for problem in (keys.save(), param_store.close(table), files.close(plans)):
            if problem:
                _say(printable(problem))


def _load_plans(vehicle: Vehicle, files: StateFiles) -> None:
    """Load mission, fence and rally points of the last run; report those that cannot be used."""
    for kind, load_request in _LOAD_REQUESTS.items():
        try:
            items = files.load_plan(kind)
        except RecordError as error:
            vehicle.send_statustext(
                f"{PLAN_NAMES[kind].capitalize()} not loaded: {error}: upload it again"
            )
            _say(printable(str(error)))
            continue
        if items:
            vehicle.handle_request(load_request(items))


def _continue_dive(vehicle: Vehicle, app: App, files: StateFiles, start: ProcessStart) -> None:
    """Continue the dive of a process that has ended without an order."""
    try:
        checkpoint = files.load_checkpoint()
    except RecordError as error:
        vehicle.send_statustext(f"Dive not continued: {error}", Severity.CRITICAL)
        _say(printable(str(error)))
        return
    if checkpoint is None:
        if start.restarts:
            vehicle.send_statustext("Autopilot restarted while disarmed", Severity.CRITICAL)
        return
    state = continued_state(checkpoint, vehicle.state)
    mode = modes.by_number(checkpoint.intended_mode)
    if start.may_continue:
        vehicle.continue_from(state, checkpoint.intended_mode)
        text = f"Autopilot restarted: dive continued in {mode.name if mode else 'its mode'}"
    else:
        vehicle.surface_from(state)
        text = "Autopilot ended again and again: new state, SURFACE"
    app.continue_from(checkpoint.clock)
    if checkpoint.ground_was_received:
        app.continue_ground_timeout()
    vehicle.send_statustext(text, Severity.CRITICAL)
    _say(text)


def _say(text: str) -> None:
    """Print a line on standard error."""
    print(f"autopilot: {text}", file=sys.stderr, flush=True)


class Stop:
    """Flag that becomes true at the first end signal (SIGINT, SIGTERM or SIGHUP).

    Each call sends a sign of life to a supervisor; the end of the supervisor sets the flag too.
    """

    def __init__(self, beat: Beat | None = None) -> None:
        self._requested, self._beat = False, beat
        on_end_signals(self._request)

    @property
    def orphaned(self) -> bool:
        """Whether the supervisor has ended."""
        return self._beat is not None and self._beat.orphaned

    def __call__(self) -> bool:
        """Return whether the program has to end."""
        if self._beat is not None:
            self._beat()
        return self._requested or self.orphaned

    def _request(self, *_: object) -> None:
        """Set the flag; called by the signal handler."""
        self._requested = True
