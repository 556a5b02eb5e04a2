"""Operating systems that the programs support."""

import platform
import sys


def exit_if_unsupported(program: str) -> None:
    """End the program with one line and status 1 on Windows.

    The links need ``poll`` and POSIX serial lines, and a campaign POSIX signals.

    Parameters
    ----------
    program : str
        Name of the program, with which the line starts.
    """
    if platform.system() == "Windows":
        sys.exit(f"{program}: Windows is not supported; run it on Linux or macOS, or in WSL 2")
