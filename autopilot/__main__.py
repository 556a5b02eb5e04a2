"""The ``autopilot`` command."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from autopilot.app import App
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink
from autopilot.comms.signing_keys import SigningKeys
from autopilot.control.lqg_file import load as load_controllers
from autopilot.control.params import ParamTable
from autopilot.control.types import Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.onboard_log.storage import default_folder
from autopilot.param_file import load
from autopilot.param_store import ParamStore
from autopilot.telemetry.identity import AutopilotId, version
from autopilot.vehicle import Vehicle
from mavlink_io.errors import CaribouError, exit_with_error
from mavlink_io.host_check import exit_if_unsupported
from mavlink_io.parent_watch import end_with_stdin, on_end_signals
from mavlink_io.printable import printable
from mavlink_io.transport import SEND_TIMEOUT_S, open_transport
from mavlink_io.user_data_dir import user_data_dir

DEFAULT_GROUND = ["udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540"]
"""Default ground links: the ports of QGroundControl and MAVProxy, and of MAVSDK."""

OFF = "off"
"""Value of ``--logs`` and ``--state`` that turns the folder off."""
MAX_SEND_BLOCK_S = 0.2
"""Longest time that a send to a TCP client may block when the vehicle does not wait for the answer.

A client stops reading when the vehicle dives and Wi-Fi is lost."""


def _print_version(requested: bool) -> None:
    """Print the version and exit, when ``--version`` is given."""
    if requested:
        print(f"autopilot {version()}")
        raise typer.Exit


def fly(
    hil: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS", help="Link to the simulator or to the sensors of the vehicle."
        ),
    ] = "udpin:127.0.0.1:14560",
    gcs: Annotated[
        list[str] | None,
        typer.Option(metavar="ADDRESS", help="Link to a ground station. Repeatable."),
    ] = None,
    params: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Parameter file: one NAME,VALUE per line."),
    ] = None,
    controller: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="LQG controller that replaces the PIDs, from `ground redesign --method lqg`.",
        ),
    ] = None,
    sign: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS=KEYFILE",
            help="Sign the messages of a ground link with the key in a file. Repeatable.",
        ),
    ] = None,
    autopilot_id: Annotated[
        AutopilotId, typer.Option(help="Autopilot type reported in HEARTBEAT.")
    ] = AutopilotId.GENERIC,
    logs: Annotated[
        str,
        typer.Option(
            metavar="DIR|off",
            help=(
                "Folder of the onboard logs, or `off`; default: caribou/logs in the user's state"
                " directory."
            ),
        ),
    ] = "",
    state: Annotated[
        str,
        typer.Option(
            metavar="DIR|off",
            help=(
                "Folder where parameters are stored for the next start, or `off`; default: caribou"
                " in the user's state directory."
            ),
        ),
    ] = "",
    lifeline: Annotated[
        bool, typer.Option("--lifeline", help="Exit when standard input is closed.")
    ] = False,
    show_version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", is_eager=True, callback=_print_version
        ),
    ] = False,
) -> None:
    """Fly the vehicle: read sensors, command actuators and serve ground stations over MAVLink."""
    param_store = ParamStore(_folder(state, user_data_dir()))
    stored = param_store.load()
    table = ParamTable(
        stored | (load(params) if params else {}),
        stored,
        load_controllers(controller) if controller else None,
    )
    vehicle = Vehicle(table)
    keys = SigningKeys.from_options(sign or (), gcs or DEFAULT_GROUND)
    hil_link = HilLink(open_transport(hil, wait_for_device=True), vehicle.system)
    send_timeout_s = SEND_TIMEOUT_S if hil_link.lockstep else MAX_SEND_BLOCK_S
    transports = [
        open_transport(address, wait_for_device=True, send_timeout_s=send_timeout_s)
        for address in gcs or DEFAULT_GROUND
    ]
    onboard_log = OnboardLog(vehicle, _folder(logs, default_folder()), version())
    ground = GroundServer(vehicle, transports, autopilot_id, keys, onboard_log, param_store)
    links = ", ".join(link.transport.address for link in ground.links)
    print(
        f"autopilot: system {vehicle.system}, HIL {hil}, ground {links}",
        file=sys.stderr,
        flush=True,
    )
    if controller:
        vehicle.send_statustext(f"Controller: {controller.name}", Severity.INFO)
    for problem in param_store.problems:
        vehicle.send_statustext(f"Parameters: {problem}")
        print(f"autopilot: {printable(problem)}", file=sys.stderr, flush=True)
    stop = Stop()
    if lifeline:
        end_with_stdin()
    try:
        App(vehicle, hil_link, ground, onboard_log).run(stop)
    finally:
        for problem in (keys.save(), param_store.close(table)):
            if problem:
                print(f"autopilot: {printable(problem)}", file=sys.stderr)


def _folder(option: str, default: Path) -> Path | None:
    """Return the folder that an option names; None when it is ``off``."""
    return None if option == OFF else Path(option) if option else default


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


def main() -> None:
    """Run the ``autopilot`` command."""
    exit_if_unsupported("autopilot")
    try:
        typer.run(fly)
    except CaribouError as error:
        exit_with_error("autopilot", error)


if __name__ == "__main__":
    main()
