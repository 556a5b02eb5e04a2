"""The documentation site: it builds without a warning, and its commands exist."""

import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.docs_blocks import DOCS, PAGES, ROOT, blocks_of

sys.path.insert(0, str(DOCS))

# beside the pages, on the path from here on
from site_pages import programs  # type: ignore[import-not-found]

PROGRAMS = programs()


def commands_of(page: Path) -> Iterator[list[str]]:
    """Yield the words of each command of our programs in the blocks of a page."""
    commands = [block.text for block in blocks_of(page) if block.kind in ("", "sh", "bash")]
    for text in commands:
        for line in text.replace("\\\n", " ").replace(" & ", "\n").splitlines():
            command = line.removeprefix("$ ").removesuffix("&").strip()
            if command.split(" ")[0] in PROGRAMS and "--->" not in line:
                words = shlex.split(command, comments=True)
                yield words[: words.index("|")] if "|" in words else words


COMMANDS = sorted({tuple(words) for page in PAGES for words in commands_of(page)})


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_command_of_docs_parses(words: tuple[str, ...]) -> None:
    """Commands, options and numbers of arguments exist; `...` stands for an argument."""
    command: Any = PROGRAMS[words[0]]
    arguments = list(words[1:])
    while arguments and arguments[0] in getattr(command, "commands", {}):
        command = command.commands[arguments.pop(0)]
    if "--help" not in arguments:
        command.make_context(words[0], arguments)


def test_site_builds_without_warnings(tmp_path: Path) -> None:
    """A page that no table of contents names, or a link to nothing, is a warning."""
    sources = tmp_path / "docs"
    shutil.copytree(DOCS, sources, ignore=shutil.ignore_patterns("generated", "__pycache__"))
    for file in ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"):
        shutil.copy(ROOT / file, tmp_path / file)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    sphinx = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going"]
    built = subprocess.run(
        [*sphinx, str(sources), str(tmp_path / "site")], capture_output=True, text=True, check=False
    )
    assert (built.returncode, built.stderr) == (0, "")
    page = (tmp_path / "site/generated/parameters.html").read_text(encoding="utf-8")
    assert "HDG_P" in page
