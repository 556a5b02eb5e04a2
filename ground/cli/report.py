"""`ground report`: write the report of a campaign or of dives, or one figure of a campaign."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import refuse_given, say
from ground.output_files import check_output
from mavlink_io.errors import InputError


class Subject(StrEnum):
    """Subject of a figure."""

    RESULT = "result"
    MODEL = "model"


def report(
    context: typer.Context,
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR|LOG...",
            help="Folder of a finished campaign, or logs of one dive or several: .mcap, .bin, .ulg,"
            " .tlog or .csv.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html",
            help="Page of dives. Default: beside the first log, LOG-report.html.",
        ),
    ] = None,
    servo_channels: Annotated[
        str | None,
        typer.Option(metavar="RUDDER,ELEVATOR,THRUST", help="Servo outputs, as in `ground refit`."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|svg", help="Draw one figure of a campaign instead of the report."
        ),
    ] = None,
    of: Annotated[
        Subject,
        typer.Option(help="Subject of the figure: the result, or the validation of the model."),
    ] = Subject.RESULT,
) -> None:
    """Write the report of a campaign, of one dive, or of several dives side by side."""
    if picture is None:
        refuse_given(context, "--of", "is for --picture, which is not given")
    folders = [path for path in paths if path.is_dir()]
    if folders and len(paths) > 1:
        raise InputError(f"{folders[0]}: is a folder; give one campaign, or logs of dives")
    if not folders:
        if picture is not None:
            raise InputError(f"--picture {picture}: is drawn of a campaign; give its folder")
        from ground.report import dives
        from sysid.data.readers.servo_channels import OutputOptions, parse

        target = check_output("--out", out or dives.default_target(paths[0]), paths)
        options = OutputOptions(parse(servo_channels) if servo_channels is not None else None)
        say(str(dives.write(paths, target, options)))
    elif out is not None or servo_channels is not None:
        option = "--out" if out is not None else "--servo-channels"
        raise InputError(f"{option}: is for logs of dives; a campaign's report is in its folder")
    elif picture is None:
        from ground.report import page

        say(str(page.write(paths[0])))
    else:
        from ground.report import matplotlib_figures, summary_picture

        summary_picture.check_picture_format(picture)
        check_output("--picture", picture, _files_without_pictures(paths[0]))
        draw = summary_picture.draw if of is Subject.RESULT else matplotlib_figures.draw
        say(str(draw(paths[0], picture)))


def _files_without_pictures(folder: Path) -> list[Path]:
    """Return the files of a campaign that no picture may replace."""
    from ground.report.summary_picture import PICTURE_FORMATS

    return [path for path in folder.rglob("*") if path.suffix not in PICTURE_FORMATS]
