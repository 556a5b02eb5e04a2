"""`ground paper`: compare the tables of the paper with the values that this software derives."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import Json, print_result, to_json


def paper(
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Also write paper.json and pictures of Table 4's loops here."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """The paper's Tables 1 to 5 beside what this software derives, without flying."""
    from ground.report import paper_poles, paper_tables, poles

    found = paper_poles.compute()
    result = paper_tables.collect(found)
    words = paper_tables.format_text(result, found)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "paper.json").write_text(to_json(result), encoding="utf-8")
        words = "\n".join([words, "", *map(str, poles.draw(found, out))])
    print_result(result, words, json)
