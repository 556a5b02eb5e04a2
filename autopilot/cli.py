"""The ``autopilot`` command.

What flies the vehicle is imported only to fly, so that ``--help`` and a wrong option answer at
once.
"""

from pathlib import Path
from typing import Annotated

import typer

from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io.errors import CaribouError, exit_with_error
from mavlink_io.host_check import exit_if_unsupported
from mavlink_io.user_data_dir import user_data_dir

DEFAULT_GROUND = ["udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540"]
"""Default ground links: the ports of QGroundControl and MAVProxy, and of MAVSDK."""

OFF = "off"
"""Value of ``--logs`` and ``--state`` that turns the folder off."""


def _print_version(requested: bool) -> None:
    """Print the version and exit, when ``--version`` is given."""
    if requested:
        from autopilot.telemetry.identity import version

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
    system_id: Annotated[
        int | None,
        typer.Option(
            min=1, max=255, metavar="N", help="System id, MAV_SYS_ID: another one for each vehicle."
        ),
    ] = None,
    sign: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS=KEYFILE",
            help="Sign the messages of a ground link with the key in a file. Repeatable.",
        ),
    ] = None,
    modem: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS[=SECONDS]",
            help=(
                "Ground link that is a satellite or acoustic modem: one HIGH_LATENCY2 in SECONDS"
                " (10 or more) and answers, nothing else. Repeatable."
            ),
        ),
    ] = None,
    accept: Annotated[
        str | None,
        typer.Option(
            metavar="SYSTEM,...",
            help="System ids of the ground stations that may command; default: all.",
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
                "Folder where parameters and mission are stored for the next start, or `off`;"
                " default: caribou in the user's state directory."
            ),
        ),
    ] = "",
    lifeline: Annotated[
        bool, typer.Option("--lifeline", help="Exit when standard input is closed.")
    ] = False,
    supervised: Annotated[
        bool,
        typer.Option(
            "--supervised",
            help="Start again within 2 s and continue the dive when the autopilot ends or hangs.",
        ),
    ] = False,
    show_version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", is_eager=True, callback=_print_version
        ),
    ] = False,
) -> None:
    """Fly the vehicle: read sensors, command actuators and serve ground stations over MAVLink."""
    from autopilot.onboard_log.storage import default_folder
    from autopilot.start import AutopilotOptions, run
    from autopilot.supervisor import ProcessStart, supervise

    options = AutopilotOptions(
        hil=hil,
        ground=gcs or DEFAULT_GROUND,
        params=params,
        controller=controller,
        system_id=system_id,
        sign=sign or (),
        modem=modem or (),
        accept=accept,
        autopilot_id=autopilot_id,
        logs=None if logs == OFF else Path(logs) if logs else default_folder(),
        state=None if state == OFF else Path(state) if state else user_data_dir(),
        lifeline=lifeline,
    )
    if not supervised:
        run(options)
        return

    def run_once(start: ProcessStart) -> None:
        """Fly in a child process; end it with the exit status of an error."""
        try:
            run(options, start)
        except CaribouError as error:
            exit_with_error("autopilot", error)

    supervise(run_once)


def main() -> None:
    """Run the ``autopilot`` command."""
    exit_if_unsupported("autopilot")
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(fly)
    try:
        app()
    except CaribouError as error:
        exit_with_error("autopilot", error)
