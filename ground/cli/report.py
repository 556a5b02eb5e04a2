"""`ground report`: write the report of a campaign, or one figure of it."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import say


class Subject(StrEnum):
    """Subject of a figure."""

    RESULT = "result"
    MODEL = "model"


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a finished campaign.")],
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png|svg", help="Draw one figure instead of the report."),
    ] = None,
    of: Annotated[
        Subject,
        typer.Option(help="Subject of the figure: the result, or the validation of the model."),
    ] = Subject.RESULT,
) -> None:
    """Write report.html of a campaign, or draw one figure of its result or of its model."""
    if picture is None:
        from ground.report import page

        say(str(page.write(folder)))
    else:
        from ground.report import matplotlib_figures, summary_picture

        draw = summary_picture.draw if of is Subject.RESULT else matplotlib_figures.draw
        say(str(draw(folder, picture)))
