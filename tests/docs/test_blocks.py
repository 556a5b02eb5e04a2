"""Every fenced block of the documentation is executed, or its content is compared with the source.

A block without a class fails ``test_every_block_has_a_check``. The classes:

- commands: our programs are run by ``test_commands.py``; targets of make, modules and scripts exist
  here; programs of others are in FOREIGN;
- Python: run by the test that PYTHON names;
- TOML: read here by the program that reads such files;
- JSON: its keys are those of the published schema;
- output: the source file that OUTPUT names prints its fixed words;
- diagrams: their packages exist;
- tables of contents: built by ``test_site.py``.
"""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ground.missions import plans
from ground.sweep import plan_file
from sitl import scenario
from sitl.vehicle import config
from sysid.data import readers
from tests.docs.test_site import PROGRAMS
from tests.helpers.docs_blocks import DOCS, ROOT, Block, all_blocks

BLOCKS = tuple(all_blocks())
PYTHON = {
    "docs/python.md": "tests/docs/test_snippets.py",
    "docs/gains.md": "tests/docs/test_commands.py",
    "docs/logs.md": "tests/docs/test_commands.py",
    "docs/sweep.md": "tests/docs/test_commands.py",
    "docs/navigation.md": "tests/processes/mavsdk_offboard_client.py",
    "docs/tutorials/own_autopilot.md": "tests/docs/test_commands.py",
}
"""File with the test that runs the Python of a page."""
FOREIGN = (
    "cp",
    "dask",
    "echo",
    "pip",
    "sim_vehicle.py",
    "socat",
    "./waf",
    "export PATH=",
    "(umask 077;",
    "PX4_SYS_AUTOSTART=",
    "for minutes in",
)
"""Beginnings of lines for the shell or for programs of others."""
OUTPUT = {
    "docs/errors.md": (("ground/cli/main.py", '"error"', '"code"', '"message"'),),
    "docs/identification.md": (
        ("ground/live/estimate_view.py", "static gain, 1/s", "crossover, rad/s", "go on: "),
    ),
    "docs/reports.md": (("ground/client/assessment.py", "needs attention", " trim is not set ("),),
    "docs/summary.md": (
        ("ground/campaign/summary_file.py", "heading_deg", "pitch_deg", "depth_m"),
        ("ground/campaign/summary.py", "initial", "redesigned"),
    ),
    "docs/sweep.md": (
        ("ground/report/sweep.py", "dives", "passed", "probability", "95 % interval"),
        ("ground/cli/sweep.py", " dives in ", ", digest ", "` evaluates them"),
    ),
    "docs/tutorials/own_autopilot.md": (("examples/autopilot.py", " s ", " m ", " deg"),),
}
"""Source files, each with fixed words of an output that it prints, by the page of the output."""
DIAGRAM = "HIL link (UDP; serial on the vehicle)"
"""First line of the pictures of the packages."""


def is_command(line: str) -> bool:
    """Return whether a line is a command with a program that exists."""
    line = line.removeprefix("$ ").split("  #")[0].strip()
    words = line.split()
    if not words or line.startswith("#"):
        return True
    match words:
        case ["make", target, *_]:
            makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
            return re.search(rf"^{re.escape(target)}:", makefile, re.M) is not None
        case ["python", "-c", *_]:
            return True
        case ["python", "-m", module, *_]:
            path = ROOT / module.replace(".", "/")
            return module == "pytest" or path.with_suffix(".py").exists() or path.is_dir()
        case ["python", script, *_]:
            return (ROOT / script).exists()
    return words[0] in PROGRAMS or line.startswith(FOREIGN)


def class_of(block: Block) -> str:
    """Return the class of a block; empty without one."""
    if block.kind in ("toml", "json"):
        return block.kind
    if block.kind.startswith("python"):
        return "python" if block.page in PYTHON else ""
    if block.kind == "{toctree}":
        return "contents"
    if block.kind not in ("", "sh", "bash", "text"):
        return ""
    if block.first_line.startswith(DIAGRAM):
        return "diagram"
    lines = block.text.replace("\\\n", " ").splitlines()
    if all(is_command(line) for line in lines):
        return "commands"
    if block.first_line.startswith("# ACT_TRAVEL_DEG"):
        return "csv"
    shown = [line for line in lines if line.startswith("$ ")]
    return "output" if block.page in OUTPUT and all(map(is_command, shown)) else ""


def blocks_of_class(name: str) -> list[Block]:
    return [block for block in BLOCKS if class_of(block) == name]


def test_every_block_has_a_check() -> None:
    missing = [f"{b.page}: {b.kind}: {b.first_line}" for b in BLOCKS if not class_of(b)]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize("page", PYTHON)
def test_python_of_page_is_run_by_its_test(page: str) -> None:
    assert any(block.page == page for block in blocks_of_class("python"))
    assert page.removeprefix("docs/").split("/")[-1] in (ROOT / PYTHON[page]).read_text("utf-8")


def test_no_table_names_a_block_that_is_gone() -> None:
    pages = {block.page for block in blocks_of_class("output")}
    assert set(OUTPUT) == pages
    assert {block.page for block in blocks_of_class("diagram")} == {
        "README.md",
        "docs/architecture.md",
    }


@pytest.mark.parametrize("page", OUTPUT)
def test_output_has_the_words_of_the_source(page: str) -> None:
    shown = "\n".join(block.text for block in blocks_of_class("output") if block.page == page)
    for file, *words in OUTPUT[page]:
        source = (ROOT / file).read_text(encoding="utf-8")
        for word in words:
            assert word in shown
            assert word in source, f"{file} does not print {word!r}"


def test_packages_of_the_diagrams_exist() -> None:
    for block in blocks_of_class("diagram"):
        for package in ("sitl", "autopilot", "ground", "sysid"):
            assert package in block.text
            assert (ROOT / package).is_dir()


def test_csv_of_the_logs_page_is_read(tmp_path: Path) -> None:
    (block,) = blocks_of_class("csv")
    (tmp_path / "dive.csv").write_text(block.text, encoding="utf-8")
    assert readers.read(tmp_path / "dive.csv").parameters == {"ACT_TRAVEL_DEG": 20.0}


def keys_of(schema: Any, found: set[str]) -> set[str]:
    """Return the names of properties in a JSON schema."""
    if isinstance(schema, dict):
        properties = schema.get("properties")
        found |= set(properties) if isinstance(properties, dict) else set()
        for value in schema.values():
            keys_of(value, found)
    elif isinstance(schema, list):
        for value in schema:
            keys_of(value, found)
    return found


def keys_in(value: Any) -> set[str]:
    """Return the keys in a JSON value."""
    if isinstance(value, list):
        return set().union(*map(keys_in, value))
    if isinstance(value, dict):
        return set(value).union(*map(keys_in, value.values()))
    return set()


def test_model_file_of_the_docs_has_keys_of_the_schema() -> None:
    (block,) = blocks_of_class("json")
    schema = json.loads((DOCS / "model.schema.json").read_text("utf-8"))
    free = {"yaw", "N_dr"}  # a plane and a coefficient: keys of mappings
    assert keys_in(json.loads(block.text)) - free <= keys_of(schema, set())


def read_scenario(path: Path) -> None:
    scenario.load(str(path))


def read_mission(path: Path) -> None:
    assert plans.load(str(path)).items


def read_vehicle_part(path: Path) -> None:
    """Read a table of a vehicle file, appended to a whole one."""
    whole = (ROOT / "sitl" / "vehicle" / "caribou_nominal.toml").read_text(encoding="utf-8")
    path.write_text(f"{whole}\n{path.read_text('utf-8')}", encoding="utf-8")
    assert config.load(path).drop_weight is not None


def read_sweep(path: Path) -> None:
    """Read a plan beside the files that it names."""
    folder = path.parent
    (folder / "tests-8.param").write_text("HDG_P,0.5\n", encoding="utf-8")
    shutil.copy(ROOT / "ground" / "missions" / "rudder_steps.toml", folder / "tests-8.toml")
    plan_file.load(path)


READERS: dict[str, Callable[[Path], None]] = {
    "[[fault]]": read_scenario,
    "[drop_weight]": read_vehicle_part,
    "[site]": read_scenario,
    "[[current.layer]]": read_scenario,
    "# water.toml": read_sweep,
    'name = "first"': read_mission,
}
"""Reader of the TOML blocks with a first line."""


@pytest.mark.parametrize(
    "block", blocks_of_class("toml"), ids=lambda block: f"{block.page} {block.first_line}"
)
def test_toml_of_the_docs_is_read(block: Block, tmp_path: Path) -> None:
    if block.first_line == "# class.toml":
        return  # flown by test_commands.py
    path = tmp_path / "shown.toml"
    path.write_text(block.text, encoding="utf-8")
    READERS[block.first_line](path)
