"""Screenshots of the documentation: ``python -m tests.screenshots [FOLDER]``.

It flies the mission of `ground demo` with the live page and photographs the page in headless
Chromium on the third side of the square.
"""

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.browser import WINDOWS_PX, opened

FOLDER = Path("docs")
COMMAND = (sys.executable, "-m", "ground", "demo", "--no-browser", "--no-stay", "--speed", "20")
THIRD_SIDE = "item 4 of"
TIMEOUT_S = 300.0


def photograph(folder: Path) -> Path:
    """Write live.png into a folder and return its path."""
    with (
        tempfile.TemporaryDirectory() as profile,
        subprocess.Popen(
            COMMAND, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as demo,
    ):
        assert demo.stderr is not None
        address = re.search(r"http://\S+", demo.stderr.readline())
        assert address is not None, "ground demo printed no address"
        with opened(address[0], Path(profile) / "profile") as page:
            deadline_s = time.monotonic() + TIMEOUT_S
            while THIRD_SIDE not in page.text("mission"):
                if time.monotonic() > deadline_s:
                    raise TimeoutError(f"the mission did not reach {THIRD_SIDE}")
                time.sleep(0.2)
            time.sleep(1.0)
            page.resize(WINDOWS_PX[-1][0], int(page.run("return document.body.scrollHeight")))
            picture = folder / "live.png"
            page.save_picture(picture)
    return picture


if __name__ == "__main__":
    print(photograph(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER))
