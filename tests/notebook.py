"""Outputs of the notebook in the documentation: ``python -m tests.notebook [FILE]``.

It runs the cells in a Jupyter kernel and writes the notebook with text and figures, by default over
the one in docs. ``tests/docs/test_snippets.py`` runs it too.
"""

import os
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[1] / "docs" / "tutorials" / "afternoon.ipynb"
CELL_TIMEOUT_S = 900


def execute(target: Path) -> Path:
    """Write the notebook with the outputs of its cells and return the path."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # no warning about frozen modules
    NotebookClient(
        notebook, timeout=CELL_TIMEOUT_S, kernel_name="python3", record_timing=False
    ).execute()
    nbformat.write(notebook, target)  # type: ignore[no-untyped-call]
    return target


if __name__ == "__main__":
    print(execute(Path(sys.argv[1]) if len(sys.argv) > 1 else NOTEBOOK))
