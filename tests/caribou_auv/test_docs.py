"""Snippets of docs/python.md and the example project."""

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PYTEST = (
    *(sys.executable, "-m", "pytest", "-q", "-p", "no:caribou", "-p", "caribou_auv.pytest_plugin"),
    *("-p", "no:cacheprovider", "-c", "pytest.ini"),
)


def run_pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of a folder as a project of its own."""
    (folder / "pytest.ini").write_text("[pytest]\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [*PYTEST, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(900)
def test_every_snippet_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    snippets = re.findall(r"```python *(\w*)\n(.*?)```", page, flags=re.DOTALL)
    assert [kind for kind, _ in snippets] == ["", "", "pandas", "", "", "", "test"]
    names: dict[str, object] = {}
    for kind, text in snippets:
        if kind == "test":
            (tmp_path / "test_page.py").write_text(text)
            done = run_pytest(tmp_path)
            assert "1 passed" in done.stdout, done.stdout + done.stderr
        elif kind != "pandas" or find_spec("pandas"):
            exec(compile(text, "docs/python.md", "exec"), names)
    assert set(names) > {"dive", "model", "design", "redesigned", "again"}


@pytest.mark.process
@pytest.mark.timeout(600)
def test_example_project_passes_with_the_plugin(tmp_path: Path) -> None:
    for path in (ROOT / "examples" / "mission_tests").iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    done = run_pytest(tmp_path)
    assert "2 passed" in done.stdout, done.stdout + done.stderr
