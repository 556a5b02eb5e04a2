"""`ground report`: write the report of a campaign, or one figure of it."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import say


class Subject(StrEnum):
    """Of a picture."""

    RESULT = "result"
    MODEL = "model"


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A campaign's folder.")],
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png|svg", help="Draw one picture instead.")
    ] = None,
    of: Annotated[Subject, typer.Option(help="What the picture shows.")] = Subject.RESULT,
) -> None:
    """Write report.html of a campaign, or one picture: of its result, or of the evidence for its
    model."""
    from ground.report import matplotlib_figures, page
    from ground.report import summary_picture as pictures

    draw = pictures.draw if of is Subject.RESULT else matplotlib_figures.draw
    say(str(draw(folder, picture) if picture else page.write(folder)))
