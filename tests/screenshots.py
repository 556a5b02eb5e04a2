"""Pictures of the documentation: ``python -m tests.screenshots [--out DIR] [--campaign DIR]``.

It flies the mission of `ground demo` with the live page and photographs the page in headless
Chromium on the third side of the square; then it flies the square again and photographs its report.
Last it draws the result of the campaign of seed 1, which it flies unless its folder is given.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.browser import WINDOWS_PX, opened

FOLDER = Path("docs")
COMMAND = (sys.executable, "-m", "ground", "demo", "--no-browser", "--no-stay", "--speed", "8")
THIRD_SIDE = "item 4 of"
TIMEOUT_S = 300.0
REPORT_PX = (1160, 1560)
"""Part of the report that is shown: verdict, track and the charts of the motion."""


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
            if THIRD_SIDE not in page.text("mission"):
                raise TimeoutError("the vehicle had left the third side: run it on an idle machine")
    return picture


def photograph_report(folder: Path) -> Path:
    """Write report.png, the upper part of the report of a dive, into a folder; return its path."""
    with tempfile.TemporaryDirectory() as work:
        log = Path(work) / "square.mcap"
        words = ("fly", "square", "--sitl", "--scenario", "disturbed", "--log", str(log))
        for arguments in (words, ("report", str(log))):
            subprocess.run((sys.executable, "-m", "ground", *arguments), check=True)
        picture = folder / "report.png"
        with opened(log.with_name("square-report.html"), Path(work) / "profile") as page:
            page.resize(*REPORT_PX)
            page.run(
                "const time = document.getElementById('time'); time.value = 600;"
                " time.dispatchEvent(new Event('input'));"
            )
            time.sleep(1.0)
            page.save_picture(picture)
    return picture


def draw_campaign(folder: Path, campaign: Path | None) -> Path:
    """Write campaign.png, the result of a campaign, into a folder; return its path.

    Without a finished campaign it flies that of seed 1, which takes minutes.
    """
    picture = folder / "campaign.png"
    with tempfile.TemporaryDirectory() as work:
        flown = campaign or Path(work) / "campaign"
        words: list[tuple[str, ...]] = [("report", str(flown), "--picture", str(picture))]
        if campaign is None:
            words.insert(0, ("campaign", "--seed", "1", "--out", str(flown)))
        for arguments in words:
            subprocess.run((sys.executable, "-m", "ground", *arguments), check=True)
    return picture


def _main() -> None:
    """Write all pictures."""
    parser = argparse.ArgumentParser(description="Renew the pictures of the documentation.")
    parser.add_argument("--out", type=Path, default=FOLDER, help="Folder of the pictures.")
    parser.add_argument("--campaign", type=Path, help="Folder of a finished campaign of seed 1.")
    options = parser.parse_args()
    print(photograph(options.out), photograph_report(options.out))
    print(draw_campaign(options.out, options.campaign))


if __name__ == "__main__":
    _main()
