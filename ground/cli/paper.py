"""`ground paper`: compare the tables of the paper with the values that this software derives."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import Json, print_result, to_json


def paper(
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Also write paper.json and figures of the loops of Table 4 to this folder.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Compare Tables 1 to 5 of the paper with the values that this software derives."""
    from ground.report import paper_poles, paper_tables

    table_4 = paper_poles.compute()
    result = paper_tables.collect(table_4)
    text = paper_tables.format_text(result, table_4)
    if out is not None:
        from ground.report import poles

        out.mkdir(parents=True, exist_ok=True)
        (out / "paper.json").write_text(to_json(result), encoding="utf-8")
        text = "\n".join([text, "", *map(str, poles.draw(table_4, out))])
    print_result(result, text, json)
