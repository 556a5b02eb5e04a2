"""`ground live` and `ground demo` as processes."""

import http.client
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from ground.live.page.session import open_browser
from tests.helpers.subprocesses import autopilot, free_port


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "ground", *words]


@contextmanager
def serving(*words: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A command that serves the page, and the page's port."""
    with subprocess.Popen(
        command(*words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        try:
            assert child.stderr is not None
            address = re.search(r"http://127\.0\.0\.1:(\d+)/", child.stderr.readline())
            assert address is not None
            yield child, int(address[1])
        finally:
            child.kill()


def panels(port: int) -> Iterator[dict[str, Any]]:
    """Yield the panels that a page sends."""
    with closing(http.client.HTTPConnection("127.0.0.1", port)) as connection:
        connection.request("GET", "/events")
        response = connection.getresponse()
        while line := response.readline():
            news = json.loads(line[6:]) if line.startswith(b"data: ") else {}
            if "panel" in news:
                yield news["panel"]
        response.close()


def mode(panel: dict[str, Any]) -> str | None:
    return next((row["text"] for row in panel["rows"] if row["label"] == "mode"), None)


@pytest.mark.process
def test_live_shows_a_vehicle_and_ends_at_ctrl_c() -> None:
    port = free_port()
    with (
        autopilot(f"udpin:127.0.0.1:{free_port()}", f"udpout:127.0.0.1:{port}"),
        serving("live", "--connect", f"udpin:127.0.0.1:{port}", "--no-browser") as (child, page),
    ):
        for panel in panels(page):
            if mode(panel) == "HOLD":
                break
        assert panel["link"]["state"] == "live"
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate()
        assert child.returncode == 0
        assert errors == ""


@pytest.mark.process
@pytest.mark.parametrize("name", ["live", "watch"])
def test_view_that_waits_for_its_key_ends_at_ctrl_c(name: str, tmp_path: Path) -> None:
    key = tmp_path / "key"
    os.mkfifo(key, 0o600)
    words = (name, "--connect", f"udpin:127.0.0.1:{free_port()}", "--sign", str(key))
    with subprocess.Popen(command(*words), stderr=subprocess.PIPE, text=True) as child:
        try:
            with pytest.raises(subprocess.TimeoutExpired):
                child.wait(5.0)
            child.send_signal(signal.SIGINT)
            assert child.wait(20.0) == 130
        finally:
            child.kill()


@pytest.mark.process
def test_live_without_vehicle_says_why() -> None:
    address = f"udpin:127.0.0.1:{free_port()}"
    with serving("live", "--connect", address, "--no-browser") as (_, page):
        panel = next(panel for panel in panels(page) if panel["link"]["text"])
        assert panel["link"]["state"] == "waiting"
        assert "no vehicle yet" in panel["link"]["text"]


@pytest.mark.process
def test_live_on_a_foreign_address_is_refused_in_one_line() -> None:
    options = ["--connect", f"udpin:127.0.0.1:{free_port()}", "--host", "192.0.2.1"]
    done = subprocess.run(
        command("live", "--no-browser", *options), capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("ground: --host 192.0.2.1")
    assert done.stderr.count("\n") == 1


@pytest.mark.process
@pytest.mark.slow
def test_demo_flies_a_square_on_its_page() -> None:
    with serving("demo", "--no-browser", "--no-stay", "--speed", "max") as (child, page):
        seen = list(panels(page))
        output, _ = child.communicate()
        assert child.returncode == 0
    assert seen[-1]["link"]["text"] == "the dive has ended"
    assert "s flown" in output


def test_no_browser_is_opened_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert not open_browser("http://127.0.0.1:1/")
