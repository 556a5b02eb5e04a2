"""The ``autopilot`` command."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from autopilot.app import App
from autopilot.comms.ground_server import GroundServer
from autopilot.comms.hil import HilLink
from autopilot.comms.signing_keys import Keys
from autopilot.control.lqg_file import LqgFileError
from autopilot.control.lqg_file import load as load_laws
from autopilot.control.params import ParamError, ParamTable
from autopilot.control.types import Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.onboard_log.storage import default_folder
from autopilot.param_file import load
from autopilot.param_store import ParamStore
from autopilot.telemetry.identity import AutopilotId, version
from autopilot.vehicle import Vehicle
from mavlink_io.parent_watch import end_with_stdin, on_end_signals
from mavlink_io.printable import printable
from mavlink_io.signing import KeyFileError
from mavlink_io.transport import SEND_TIMEOUT_S, AddressError, LinkLostError, open_transport
from mavlink_io.user_data_dir import user_data_dir

DEFAULT_GROUND = ["udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540"]
"""Where QGroundControl and MAVProxy, and where MAVSDK listen."""

OFF = "off"
MAX_SEND_BLOCK_S = 0.2
"""The longest that a TCP client which reads nothing may hold up a vehicle that does not wait for
her autopilot: what Wi-Fi leaves behind when she dives."""

WORK_FAILED, BAD_INPUT = 1, 2


def fly(
    hil: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Link to the simulator or the vehicle.")
    ] = "udpin:127.0.0.1:14560",
    gcs: Annotated[
        list[str] | None,
        typer.Option(metavar="ADDRESS", help="Link to the ground; may be repeated."),
    ] = None,
    params: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Parameters: lines of NAME,VALUE.")
    ] = None,
    laws: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Laws that fly in place of the PIDs, by `ground laws`."),
    ] = None,
    sign: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS=KEYFILE", help="Sign that link to the ground; may be repeated."
        ),
    ] = None,
    autopilot_id: Annotated[
        AutopilotId, typer.Option(help="Personality told in HEARTBEAT.")
    ] = AutopilotId.GENERIC,
    logs: Annotated[
        str,
        typer.Option(
            metavar="DIR|off",
            help=(
                "Where the vehicle keeps her own logs; default: caribou/logs in the user's state"
                " directory."
            ),
        ),
    ] = "",
    state: Annotated[
        str,
        typer.Option(
            metavar="DIR|off",
            help=(
                "Where parameters are kept for the next start; default: caribou in the user's state"
                " directory."
            ),
        ),
    ] = "",
    lifeline: Annotated[
        bool, typer.Option("--lifeline", help="End when standard input does.")
    ] = False,
) -> None:
    """Fly the vehicle: sensors in, actuators out, MAVLink to the ground."""
    try:
        keeper = ParamStore(_folder(state, user_data_dir()))
        kept = keeper.load()
        table = ParamTable(
            kept | (load(params) if params else {}), kept, load_laws(laws) if laws else None
        )
        vehicle = Vehicle(table)
        keys = Keys.from_options(sign or (), gcs or DEFAULT_GROUND)
        hil_link = HilLink(open_transport(hil, wait_for_device=True), vehicle.system)
        send_timeout_s = SEND_TIMEOUT_S if hil_link.lockstep else MAX_SEND_BLOCK_S
        transports = [
            open_transport(each, wait_for_device=True, send_timeout_s=send_timeout_s)
            for each in gcs or DEFAULT_GROUND
        ]
        logbook = OnboardLog(vehicle, _folder(logs, default_folder()), version())
        ground = GroundServer(vehicle, transports, autopilot_id, keys, logbook, keeper)
    except (AddressError, KeyFileError, LqgFileError, ParamError) as error:
        raise SystemExit(_print_error(error, BAD_INPUT)) from None
    links = ", ".join(link.transport.address for link in ground.links)
    print(
        f"autopilot: system {vehicle.system}, HIL {hil}, ground {links}",
        file=sys.stderr,
        flush=True,
    )
    if laws:
        vehicle.say(f"Laws: {laws.name}", Severity.INFO)
    for complaint in keeper.complaints:
        vehicle.say(f"Parameters: {complaint}")
        print(f"autopilot: {printable(complaint)}", file=sys.stderr, flush=True)
    stop = Stop()
    if lifeline:
        end_with_stdin()
    try:
        App(vehicle, hil_link, ground, logbook).run(stop)
    except LinkLostError as error:
        raise SystemExit(_print_error(error, WORK_FAILED)) from None
    finally:
        for complaint in (keys.save(), keeper.close(table)):
            if complaint:
                print(f"autopilot: {printable(complaint)}", file=sys.stderr)


def _folder(given: str, default: Path) -> Path | None:
    return None if given == OFF else Path(given) if given else default


class Stop:
    """Turns true at the first signal that asks the process to end."""

    def __init__(self) -> None:
        self._asked = False
        on_end_signals(self._ask)

    def __call__(self) -> bool:
        return self._asked

    def _ask(self, *_: object) -> None:
        self._asked = True


def _print_error(error: Exception, status: int) -> int:
    print(f"autopilot: {printable(error)}", file=sys.stderr)
    return status


def main() -> None:
    """Run the command."""
    typer.run(fly)


if __name__ == "__main__":
    main()
