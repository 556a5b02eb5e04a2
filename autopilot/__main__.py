"""The ``autopilot`` command."""

import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from autopilot.app import App
from autopilot.hil import HilLink
from autopilot.identity import AutopilotId, version
from autopilot.keys import Keys
from autopilot.logbook.book import Logbook
from autopilot.logbook.store import default_folder
from autopilot.params import ParamError, ParamTable, load
from autopilot.server import GroundServer
from autopilot.vehicle import Vehicle
from link.signing import KeyFileError
from link.transport import AddressError, LinkLostError, open_transport

DEFAULT_GROUND = ["udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540"]
"""Where QGroundControl and MAVProxy, and where MAVSDK listen."""

NO_LOGS = "off"

WORK_FAILED, BAD_INPUT = 1, 2


def fly(
    hil: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Link to the simulator or the vehicle.")
    ] = "udpin:127.0.0.1:14560",
    gcs: Annotated[
        list[str] | None, typer.Option(metavar="ADDRESS", help="Link to the ground; may be repeated.")
    ] = None,
    params: Annotated[Path | None, typer.Option(metavar="FILE", help="Parameters: lines of NAME,VALUE.")] = None,
    sign: Annotated[
        list[str] | None, typer.Option(metavar="ADDRESS=KEYFILE", help="Sign that link to the ground; may be repeated.")
    ] = None,
    autopilot_id: Annotated[AutopilotId, typer.Option(help="Personality told in HEARTBEAT.")] = AutopilotId.GENERIC,
    logs: Annotated[
        str,
        typer.Option(
            metavar="DIR|off",
            help="Where the vehicle keeps her own logs; default: caribou/logs in the user's state directory.",
        ),
    ] = "",
) -> None:
    """Fly the vehicle: sensors in, actuators out, MAVLink to the ground."""
    try:
        table = ParamTable(load(params) if params else None)
        vehicle, system = Vehicle(table), table.config.system_id
        keys = Keys.from_options(sign or (), gcs or DEFAULT_GROUND)
        hil_link = HilLink(open_transport(hil, awaited=True), system)
        transports = [open_transport(address, awaited=True) for address in gcs or DEFAULT_GROUND]
        logbook = Logbook(vehicle, _log_folder(logs), version())
        ground = GroundServer(vehicle, transports, autopilot_id, keys, logbook=logbook)
    except (AddressError, KeyFileError, ParamError) as error:
        raise SystemExit(_complain(error, BAD_INPUT)) from None
    links = ", ".join(link.transport.address for link in ground.links)
    print(f"autopilot: system {system}, HIL {hil}, ground {links}", file=sys.stderr, flush=True)
    try:
        App(vehicle, hil_link, ground, logbook).run(Stop())
    except LinkLostError as error:
        raise SystemExit(_complain(error, WORK_FAILED)) from None
    finally:
        if complaint := keys.save():
            print(f"autopilot: {complaint}", file=sys.stderr)


def _log_folder(given: str) -> Path | None:
    return None if given == NO_LOGS else Path(given) if given else default_folder()


class Stop:
    """Turns true at the first signal that asks the process to end."""

    def __init__(self) -> None:
        self._asked = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

    def __call__(self) -> bool:
        return self._asked

    def _ask(self, *_: object) -> None:
        self._asked = True


def _complain(error: Exception, status: int) -> int:
    print(f"autopilot: {error}", file=sys.stderr)
    return status


def main() -> None:
    """Run the command."""
    typer.run(fly)


if __name__ == "__main__":
    main()
