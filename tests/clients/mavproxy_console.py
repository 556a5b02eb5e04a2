"""MAVProxy at its prompt: a real process with typed input and parsed output."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

TIMEOUT_S = 15.0
POLL_S = 0.02
END = "end-of-list"
"""Not a command: MAVProxy's error for it shows that all commands before it were executed."""
REPEATS_AFTER_LOSS = 3
UDP_SOCKETS = Path("/proc/net/udp")
"""Sockets of the system (proc_net(5)): local address in column 1, dropped datagrams in the last."""
PROGRAM = str(Path(sys.executable).with_name("mavproxy.py"))


class Console:
    """A running MAVProxy whose home directory is ``folder``; its output is read incrementally."""

    def __init__(self, folder: Path, master: str, baud: int | None = None) -> None:
        command = [
            sys.executable,
            PROGRAM,
            "--master",
            master,
            "--state-basedir",
            str(folder),
            "--aircraft",
            "test",
        ]
        command += ["--baudrate", str(baud)] if baud else []
        environment = {**os.environ, "HOME": str(folder), "PYTHONUNBUFFERED": "1"}
        self.folder = folder
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment,
        )
        self._port = int(master.rsplit(":", 1)[1]) if master.startswith("udp") else 0
        self.output = ""
        self._mark = 0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def type_line(self, line: str, *, again: bool = False) -> None:
        """Type a line; ignore the output before it, unless it is typed again."""
        if not again:
            self._mark = len(self.output)
        assert self._process.stdin is not None
        self._process.stdin.write(line.encode() + b"\n")
        self._process.stdin.flush()

    def wait_for(self, pattern: str, within_s: float = TIMEOUT_S) -> re.Match[str]:
        """Return the next match in the output. Raises TimeoutError with the output."""
        deadline_s = time.monotonic() + within_s
        while (match := re.compile(pattern, re.MULTILINE).search(self.output, self._mark)) is None:
            if time.monotonic() > deadline_s:
                raise TimeoutError(
                    f"{pattern!r} was not printed within {within_s:g} s, but"
                    f" {self.output[self._mark :]!r}"
                )
            time.sleep(POLL_S)
        self._mark = match.end()
        return match

    def ask(
        self, line: str, pattern: str, *, attempts: int = 1, within_s: float = TIMEOUT_S
    ) -> re.Match[str]:
        """Type a line and return the match in the answer; repeat it on a lossy line.

        A line is typed again, too, if datagrams were lost meanwhile: the answer may be among them.
        A late answer to an earlier attempt counts: what was done twice is not answered twice.
        """
        lost = self.lost_datagrams()
        for attempt in range(attempts - 1):
            self.type_line(line, again=attempt > 0)
            try:
                return self.wait_for(pattern, within_s / attempts)
            except TimeoutError:
                continue
        self.type_line(line, again=attempts > 1)
        for _ in range(REPEATS_AFTER_LOSS):
            try:
                return self.wait_for(pattern, within_s)
            except TimeoutError:
                if self.lost_datagrams() == lost:
                    raise
            lost = self.lost_datagrams()
            self.type_line(line, again=True)
        return self.wait_for(pattern, within_s)

    def lost_datagrams(self) -> int:
        """Return how many datagrams the kernel dropped because MAVProxy read too slowly.

        0 for a serial line, and where /proc/net/udp does not exist.
        """
        if not self._port or not UDP_SOCKETS.exists():
            return 0
        rows = [row.split() for row in UDP_SOCKETS.read_text(encoding="ascii").splitlines()[1:]]
        return sum(int(row[-1]) for row in rows if row[1].endswith(f":{self._port:04X}"))

    def messages(self) -> dict[str, tuple[int, dict[str, Any]]]:
        """Return the number of each message and its last fields, as ``status`` shows them."""
        self.type_line("status *")
        start = self._mark
        self.type_line(END)
        self.wait_for(f"Unknown command '{END}'")
        shown = self.output[start : self._mark]
        rows = re.findall(r"^(?:\S*> )*(\d+): ([A-Z_0-9]+) \{(.*)\}$", shown, re.MULTILINE)
        return {name: (int(count), _fields(text)) for count, name, text in rows}

    def close(self) -> None:
        if self.running:
            self._process.kill()
        self._process.wait()
        self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        while part := os.read(self._process.stdout.fileno(), 65_536):
            self.output += part.decode("utf-8", "replace")


def _fields(text: str) -> dict[str, Any]:
    return {name: _value(value) for name, value in re.findall(r"(\w+) : (\[[^\]]*\]|[^,]*)", text)}


def _value(text: str) -> Any:
    if text.startswith("["):
        return [_value(part) for part in text[1:-1].split(", ")]
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        return text
