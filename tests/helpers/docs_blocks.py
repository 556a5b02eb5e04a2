"""Fenced blocks of the documentation pages."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md")))
_BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block of a page."""

    page: str
    """Path of the page from the root of the project."""
    kind: str
    """Text after the opening fence, as "python" or "sh"; empty without one."""
    text: str

    @property
    def first_line(self) -> str:
        """Return the first line without white space around it."""
        return self.text.split("\n", 1)[0].strip()


def blocks_of(page: Path) -> list[Block]:
    """Return the blocks of a page."""
    name = page.relative_to(ROOT).as_posix()
    text = page.read_text(encoding="utf-8")
    return [Block(name, kind, inner) for kind, inner in _BLOCK.findall(text)]


def all_blocks() -> Iterator[Block]:
    """Yield the blocks of all pages."""
    for page in PAGES:
        yield from blocks_of(page)


def python_of(page: str) -> str:
    """Return the blocks of Python of a page of docs, joined."""
    text = "\n".join(block.text for block in blocks_of(DOCS / page) if block.kind == "python")
    assert text, f"{page}: has no block of Python"
    return text
