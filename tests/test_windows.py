"""The programs on an operating system that they do not support."""

import platform
from collections.abc import Callable

import pytest

from autopilot.cli import main as autopilot
from ground.cli.main import main as ground
from sitl.cli import main as sitl


@pytest.mark.parametrize(
    ("program", "main"), [("autopilot", autopilot), ("ground", ground), ("sitl", sitl)]
)
def test_program_on_windows_ends_with_one_line(
    program: str, main: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(platform, "system", lambda: "Windows")
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == (
        f"{program}: Windows is not supported; run it on Linux or macOS, or in WSL 2"
    )
