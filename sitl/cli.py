"""Command ``sitl``: simulate the vehicle and the sea for an autopilot on the HIL link.

The simulator is imported only to simulate, so that ``--help`` and a wrong option answer at once.
"""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from mavlink_io.errors import CaribouError, InputError, exit_with_error
from mavlink_io.host_check import exit_if_unsupported
from mavlink_io.parent_watch import end_with_stdin
from sitl.scenario_types import MAX_OFFSET_M

MIN_SPEED, MAX_SPEED = 0.01, 10_000.0
"""Range of ``--speed``: vehicle seconds per second of wall time."""


def _print_version(requested: bool) -> None:
    """Print name and version and exit, if requested."""
    if requested:
        from importlib.metadata import version

        print(f"sitl {version('caribou-auv')}")
        raise typer.Exit


def simulate(
    vehicle: Annotated[
        str,
        typer.Option(help="Name of a supplied vehicle, or a vehicle file.", metavar="NAME|FILE"),
    ] = "caribou_truth",
    scenario: Annotated[
        str,
        typer.Option(help="Name of a supplied scenario, or a scenario file.", metavar="NAME|FILE"),
    ] = "calm",
    autopilot: Annotated[
        str, typer.Option(help="Autopilot to connect: caribou, px4 or ardupilot.", metavar="NAME")
    ] = "caribou",
    hil: Annotated[
        str | None,
        typer.Option(
            help="Address of the HIL link [udpout:127.0.0.1:14560; px4: tcpin:127.0.0.1:4560;"
            " ardupilot: udpin:127.0.0.1:9002].",
            metavar="ADDRESS",
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(
            help="Vehicle time per wall time, or max for no limit [1; ardupilot: max].",
            metavar="N|max",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random streams.")] = 1,
    sea_seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Seed of the waves and the current, for several vehicles in one sea [--seed].",
        ),
    ] = None,
    place: Annotated[
        str | None,
        typer.Option(
            help="Place of the start, in m from the site [start of the scenario].",
            metavar="NORTH,EAST",
        ),
    ] = None,
    wait_for_arm: Annotated[
        bool,
        typer.Option(
            "--wait-for-arm", help="caribou: stop vehicle time while the vehicle is disarmed."
        ),
    ] = False,
    no_lockstep: Annotated[
        bool,
        typer.Option(
            "--no-lockstep",
            help="caribou: run in real time and do not wait for the autopilot's answers.",
        ),
    ] = False,
    rate: Annotated[
        int | None, typer.Option(help="px4: sensor frames per second [250].", metavar="HZ")
    ] = None,
    hil_baro: Annotated[
        str | None,
        typer.Option(
            help="px4: pressure to send: air_equivalent [default] (the air pressure at an altitude"
            " of minus the depth, which PX4 reads as the depth), or water."
        ),
    ] = None,
    hil_position: Annotated[
        str | None,
        typer.Option(
            help="px4: position under water: sensors [default] (none), gps (true fixes), or"
            " vision (true pose as ODOMETRY)."
        ),
    ] = None,
    outputs: Annotated[
        str | None,
        typer.Option(
            help="px4, ardupilot: output numbers of rudder, elevator and thrust [1,2,3]; a minus"
            " sign reverses an output."
        ),
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="Write the true vehicle state to this new MCAP file.")
    ] = None,
    no_compile: Annotated[
        bool,
        typer.Option(
            "--no-compile",
            help="Where the machine code is not stored yet, simulate in Python, more slowly,"
            " instead of compiling it first, which takes minutes.",
        ),
    ] = False,
    lifeline: Annotated[
        bool, typer.Option("--lifeline", help="Exit when standard input is closed.")
    ] = False,
    show_version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Print the version and exit.",
            callback=_print_version,
            is_eager=True,
        ),
    ] = False,
) -> None:
    """Simulate the vehicle, its sensors and the sea in lockstep with an autopilot."""
    from sitl.app import SimulatorOptions, needs_compiler, run
    from sitl.backends.factory import BackendOptions, check_options, defaults_of

    if no_compile and needs_compiler():
        _restart_in_python()
    if lifeline:
        end_with_stdin()
    backend = BackendOptions(
        autopilot=autopilot,
        wait_for_arm=wait_for_arm,
        rate_hz=rate,
        barometer=hil_baro,
        position=hil_position,
        outputs=outputs,
        lockstep=not no_lockstep,
    )
    if no_lockstep and speed:
        raise InputError(
            f"--speed {speed} cannot be combined with --no-lockstep:"
            " vehicle time follows the wall clock"
        )
    check_options(backend)
    defaults = defaults_of(autopilot)
    run(
        SimulatorOptions(
            vehicle=vehicle,
            scenario=scenario,
            hil=hil or defaults.address,
            speed=_parse_speed(speed or defaults.speed),
            seed=seed,
            sea_seed=sea_seed,
            place_m=None if place is None else _parse_place(place),
            truth=truth,
            backend=backend,
        )
    )


def _restart_in_python() -> None:
    """Run this command again in the same process, with all kernels in Python."""
    os.environ["NUMBA_DISABLE_JIT"] = "1"  # read when the kernels are imported
    os.execv(sys.executable, [sys.executable, "-m", "sitl", *sys.argv[1:]])


def _parse_place(text: str) -> tuple[float, float]:
    """Return north and east (m) of ``NORTH,EAST``. Raises InputError."""
    try:
        north_m, east_m = map(float, text.split(","))
    except ValueError:
        north_m = east_m = math.nan
    if not (abs(north_m) <= MAX_OFFSET_M and abs(east_m) <= MAX_OFFSET_M):
        raise InputError(
            f"--place {text}: expected NORTH,EAST, numbers of metres up to {MAX_OFFSET_M:.0f}"
        )
    return north_m, east_m


def _parse_speed(text: str) -> float | None:
    """Return vehicle seconds per second of wall time; None (no limit) for ``max``.

    Raises InputError.
    """
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not MIN_SPEED <= speed <= MAX_SPEED:
        raise InputError(
            f"--speed {text}: expected a number from {MIN_SPEED} to {MAX_SPEED:.0f}, or max"
        )
    return speed


def main() -> None:
    """Run the command ``sitl``."""
    exit_if_unsupported("sitl")
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(simulate)
    try:
        app()
    except (CaribouError, OSError) as error:
        exit_with_error("sitl", error)
