"""Python in the documentation runs as written: snippets, notebook and example project."""

import json
import re
import shutil
from pathlib import Path

import pytest

from tests import notebook
from tests.helpers.subprocesses import run_python

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(900)]


def snippets(kind: str) -> str:
    """Return the blocks of the Python page whose first line ends with a pattern."""
    blocks = re.findall(rf"^```python{kind}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    assert blocks
    return "\n".join(blocks)


def test_snippets_of_the_python_page_run(tmp_path: Path) -> None:
    (tmp_path / "page.py").write_text(snippets("(?: pandas)?"), encoding="utf-8")
    output = run_python("page.py", folder=tmp_path)
    assert {"initial", "redesigned", "flown", "recorded"} <= set(output.split())
    assert (tmp_path / "gains.param").exists()


def test_tests_of_a_user_run(tmp_path: Path) -> None:
    """The test on the Python page and the example project use the installed plugin."""
    project = tmp_path / "project"
    shutil.copytree(ROOT / "examples" / "mission_tests", project)
    (project / "test_page.py").write_text(snippets(" test"), encoding="utf-8")
    assert "3 passed" in run_python("-m", "pytest", "-q", "-p", "no:cacheprovider", folder=project)


def test_notebook_runs_and_redesign_reduces_the_errors(tmp_path: Path) -> None:
    """Heading and depth errors fall by a third; pitch is that of the same changes of depth."""
    executed = tmp_path / "afternoon.ipynb"
    run_python("-m", "tests.notebook", str(executed), folder=ROOT)
    for file in (executed, notebook.NOTEBOOK):
        cells = [
            c for c in json.loads(file.read_text("utf-8"))["cells"] if c["cell_type"] == "code"
        ]
        outputs = [output for cell in cells for output in cell["outputs"]]
        assert sum("image/png" in output.get("data", {}) for output in outputs) == 3
        text = "".join("".join(output.get("text", "")) for output in outputs)
        assert "fit for redesign: True" in text
        initial, redesigned = (
            [float(number) for number in line.split()[1:4]]
            for line in text.splitlines()
            if re.match(r"(initial|redesigned) +\d", line)
        )
        heading, pitch, depth = (
            after / before for before, after in zip(initial, redesigned, strict=True)
        )
        assert heading < 0.67
        assert depth < 0.67
        assert pitch < 1.05
