"""``sitl``: simulate the vehicle and the sea for an autopilot on the HIL link."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from mavlink_io.parent_watch import end_with_stdin
from mavlink_io.printable import printable
from mavlink_io.transport import AddressError, LinkLostError
from sitl.app import Options, TruthFileError, run
from sitl.backends.factory import BackendError, BackendOptions, check_options, defaults_of
from sitl.backends.lockstep import AutopilotTimeoutError
from sitl.backends.servo_outputs import OutputsError
from sitl.scenario_types import ScenarioError
from sitl.vehicle.config import VehicleFileError

FAILED, BAD_INPUT = 1, 2
MIN_SPEED, MAX_SPEED = 0.01, 10_000.0


def simulate(
    vehicle: Annotated[
        str, typer.Option(help="A shipped one or a vehicle file.", metavar="NAME|FILE")
    ] = "caribou_truth",
    scenario: Annotated[
        str, typer.Option(help="A shipped one or a scenario file.", metavar="NAME|FILE")
    ] = "calm",
    autopilot: Annotated[
        str, typer.Option(help="Who steers: caribou, px4 or ardupilot.", metavar="NAME")
    ] = "caribou",
    hil: Annotated[
        str | None, typer.Option(help="Where it is [its usual place].", metavar="ADDRESS")
    ] = None,
    speed: Annotated[
        str | None, typer.Option(help="Times the wall clock [1; ardupilot: max].", metavar="N|max")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of every random stream.")] = 1,
    wait_for_arm: Annotated[
        bool, typer.Option("--wait-for-arm", help="Hold vehicle time while disarmed.")
    ] = False,
    no_lockstep: Annotated[
        bool,
        typer.Option(
            "--no-lockstep", help="Run on the wall clock, whether anybody answers or not."
        ),
    ] = False,
    rate: Annotated[
        int | None, typer.Option(help="Frames a second for px4 [250].", metavar="HZ")
    ] = None,
    hil_baro: Annotated[
        str | None, typer.Option(help="px4: water [default] or air_equivalent.")
    ] = None,
    outputs: Annotated[
        str | None, typer.Option(help="Of px4, ardupilot: rudder, elevator, thrust [1,2,3].")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="Log what really happens to this new MCAP file.")
    ] = None,
    lifeline: Annotated[
        bool, typer.Option("--lifeline", help="End when standard input does.")
    ] = False,
) -> None:
    """Simulate Caribou, her tailcone, the sea and her sensors, in lockstep with an autopilot."""
    if lifeline:
        end_with_stdin()
    pilot = BackendOptions(
        autopilot, wait_for_arm, rate, hil_baro, outputs, lockstep=not no_lockstep
    )
    if no_lockstep and speed:
        _exit_with_error(
            f"--speed {speed}: not with --no-lockstep: the wall clock is the vehicle's own",
            BAD_INPUT,
        )
    try:
        check_options(pilot)
        usual = defaults_of(autopilot)
        run(
            Options(
                vehicle,
                scenario,
                hil or usual.address,
                _speed(speed or usual.speed),
                seed,
                truth,
                pilot,
            )
        )
    except (
        VehicleFileError,
        ScenarioError,
        AddressError,
        TruthFileError,
        BackendError,
        OutputsError,
    ) as error:
        _exit_with_error(error, BAD_INPUT)
    except (AutopilotTimeoutError, LinkLostError, OSError) as error:
        _exit_with_error(error, FAILED)


def _speed(text: str) -> float | None:
    """Vehicle seconds a wall second, None for as fast as the machine can."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not MIN_SPEED <= speed <= MAX_SPEED:
        _exit_with_error(
            f"--speed {text}: expected a number from {MIN_SPEED} to {MAX_SPEED:.0f}, or max",
            BAD_INPUT,
        )
    return speed


def _exit_with_error(problem: object, status: int) -> NoReturn:
    print(f"sitl: {printable(problem)}", file=sys.stderr)
    raise typer.Exit(status)


def main() -> None:
    """The console command."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(simulate)
    app()


if __name__ == "__main__":
    main()
