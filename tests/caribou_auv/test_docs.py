"""Snippets of docs/python.md use names that exist."""

import ast
import re
from pathlib import Path

import caribou_auv as auv

ROOT = Path(__file__).parents[2]


def test_snippets_of_the_page_use_public_names() -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    trees = [ast.parse(s) for s in re.findall(r"```python[^\n]*\n(.*?)```", page, flags=re.DOTALL)]
    assert len(trees) > 5
    used = {
        node.attr
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "auv"
    }
    assert len(used) > 8
    assert used <= set(auv.__all__)
