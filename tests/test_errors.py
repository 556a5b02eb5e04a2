"""Error classes of all packages: base class, code, exit status, and the table of docs/errors.md."""

import importlib
import inspect
import pkgutil
import re
import sys
from collections import Counter
from pathlib import Path

import pytest

import autopilot.cli
import sitl.app
import sitl.cli
from mavlink_io.errors import (
    BAD_INPUT,
    FAILED,
    CaribouError,
    ErrorCode,
    InputError,
    OperationError,
    exit_with_error,
)
from mavlink_io.transport import AddressError, LinkLostError

PACKAGES = ("mavlink_io", "autopilot", "sitl", "sysid", "ground")
COMPILES_PHYSICS = "sitl.preload"
"""Module that compiles the physics when it is imported, and defines no class."""
DOCUMENTED = re.compile(r"^\| `(\w+)` \| (\d) \| .+ \|$", re.MULTILINE)
ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs/errors.md"


def error_classes() -> list[type[Exception]]:
    """Return the exception classes that the packages define and that are not internal."""
    names = [
        module.name
        for package in PACKAGES
        for module in pkgutil.walk_packages(
            importlib.import_module(package).__path__, f"{package}."
        )
        if module.name != COMPILES_PHYSICS
    ]
    return [
        member
        for name in names
        for _, member in inspect.getmembers(importlib.import_module(name), inspect.isclass)
        if member.__module__ == name
        and issubclass(member, Exception)
        and not member.__name__.startswith("_")
    ]


@pytest.mark.slow
def test_every_error_class_has_its_own_documented_code() -> None:
    classes = [entry for entry in error_classes() if entry is not CaribouError]
    ours = [entry for entry in classes if issubclass(entry, InputError | OperationError)]
    assert ours == classes
    without_code = [entry for entry in ours if "code" not in vars(entry)]
    assert not without_code
    codes = Counter(entry.code for entry in ours)
    assert codes == Counter(ErrorCode)  # each code belongs to exactly one class
    documented = DOCUMENTED.findall(DOCS.read_text(encoding="utf-8"))
    assert documented == sorted((entry.code, str(entry.exit_status)) for entry in ours)


def test_documented_codes_are_found_in_the_table() -> None:
    documented = [code for code, _ in DOCUMENTED.findall(DOCS.read_text(encoding="utf-8"))]
    assert documented == sorted(ErrorCode)


def test_exit_with_error_prints_one_escaped_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        exit_with_error("sitl", InputError("file\x1b[2J\n: wrong"))
    assert end.value.code == BAD_INPUT
    assert capsys.readouterr() == ("", "sitl: file\\x1b[2J\\n: wrong\n")


def test_autopilot_bad_address_ends_with_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--hil", "nowhere", "--state", "off", "--logs", "off")
    monkeypatch.setattr(sys, "argv", ["autopilot", *options])
    with pytest.raises(SystemExit) as end:
        autopilot.cli.main()
    assert end.value.code == BAD_INPUT
    printed = capsys.readouterr()
    assert printed.err.startswith("autopilot: address 'nowhere'")
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (AddressError("nowhere"), BAD_INPUT),
        (LinkLostError("gone"), FAILED),
        (OSError(28, "No space left on device"), FAILED),
    ],
)
def test_sitl_exit_status_follows_error_class(
    error: Exception, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(options: object) -> None:
        raise error

    monkeypatch.setattr(sitl.app, "run", fail)
    monkeypatch.setattr(sys, "argv", ["sitl"])
    with pytest.raises(SystemExit) as end:
        sitl.cli.main()
    assert end.value.code == status
