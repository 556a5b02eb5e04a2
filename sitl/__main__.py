"""``sitl``: simulate the vehicle and the sea for an autopilot on the HIL link."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from link.transport import AddressError, LinkLostError
from sitl.app import Options, TruthFileError, run
from sitl.pilots.lockstep import AutopilotSilentError
from sitl.tables import ScenarioError
from sitl.vehicle.config import VehicleError

FAILED, BAD_INPUT = 1, 2
DEFAULT_HIL = "udpout:127.0.0.1:14560"
SLOWEST, FASTEST = 0.01, 10_000.0


def simulate(
    vehicle: Annotated[str, typer.Option(help="A shipped one or a vehicle file.", metavar="NAME|FILE")] = "field",
    scenario: Annotated[str, typer.Option(help="calm, disturbed, or a scenario file.", metavar="NAME|FILE")] = "calm",
    hil: Annotated[str, typer.Option(help="Where the autopilot listens.", metavar="ADDRESS")] = DEFAULT_HIL,
    speed: Annotated[str, typer.Option(help="Times the wall clock.", metavar="N|max")] = "1",
    seed: Annotated[int, typer.Option(min=0, help="Of every random stream.")] = 1,
    wait_for_arm: Annotated[bool, typer.Option("--wait-for-arm", help="Hold vehicle time while disarmed.")] = False,
    truth: Annotated[Path | None, typer.Option(help="Log what really happens to this new MCAP file.")] = None,
) -> None:
    """Simulate Caribou, her tailcone, the sea and her sensors, in lockstep with an autopilot."""
    options = Options(vehicle, scenario, hil, _speed(speed), seed, wait_for_arm, truth)
    try:
        run(options)
    except (VehicleError, ScenarioError, AddressError, TruthFileError) as error:
        _leave(error, BAD_INPUT)
    except (AutopilotSilentError, LinkLostError, OSError) as error:
        _leave(error, FAILED)


def _speed(text: str) -> float | None:
    """Vehicle seconds a wall second, None for as fast as the machine can."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not SLOWEST <= speed <= FASTEST:
        _leave(f"--speed {text}: expected a number from {SLOWEST} to {FASTEST:.0f}, or max", BAD_INPUT)
    return speed


def _leave(problem: object, status: int) -> NoReturn:
    print(f"sitl: {problem}", file=sys.stderr)
    raise typer.Exit(status)


def main() -> None:
    """The console command."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(simulate)
    app()


if __name__ == "__main__":
    main()
