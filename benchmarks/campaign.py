"""Run time of a campaign: wall time and processor time of each stage, and speed of each dive.

    python benchmarks/campaign.py [--seed N]

Processor time is that of the whole machine as Linux counts it, so run no other programs. Divided by
the number of cores it is the time that a stage would take if all cores were always busy.
"""

import argparse
import os
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

# As in the ``ground`` command: one thread of linear algebra in the process that refits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from ground.campaign.run import Campaign, CampaignRequest
from ground.client.flight import FlightResult


class Moment(NamedTuple):
    """Start of a stage."""

    what: str
    wall_s: float
    processor_s: float
    """Processor time since the machine was started."""


def now(what: str) -> Moment:
    """Return the present times under the name of a stage."""
    user, nice, system, *_ = (
        Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()[1:]
    )
    used = int(user) + int(nice) + int(system)
    return Moment(what, time.perf_counter(), used / os.sysconf("SC_CLK_TCK"))


def fly(seed: int, folder: Path) -> tuple[list[Moment], dict[str, FlightResult]]:
    """Run a campaign; return the start of each stage, the end, and the result of each dive."""
    moments = [now("starting")]
    asked = CampaignRequest(folder / "campaign", seed=seed)
    campaign = Campaign(asked, lambda name, at: None, lambda words: moments.append(now(words)))
    campaign.run()
    return [*moments, now("the end")], campaign.outcomes


def stages_in_words(moments: list[Moment]) -> list[str]:
    """Return a table with one line per stage."""
    lines = [f"{'stage':64s}{'wall s':>8s}{'processor s':>13s}"]
    for began, ended in pairwise(moments):
        lines.append(_row(began.what, began, ended))
    return [*lines, _row("all", moments[0], moments[-1])]


def dives_in_words(outcomes: dict[str, FlightResult]) -> list[str]:
    """Return a table of the dives: vehicle time since arming over wall time since the request."""
    lines = [f"{'dive':64s}{'wall s':>8s}{'vehicle s':>13s}{'x real time':>13s}"]
    for name, flown in outcomes.items():
        speed = flown.vehicle_s / flown.wall_s
        lines.append(f"{name:64s}{flown.wall_s:8.1f}{flown.vehicle_s:13.0f}{speed:13.0f}")
    return lines


def _row(what: str, began: Moment, ended: Moment) -> str:
    """Return the line of one stage."""
    return (
        f"{what:64s}{ended.wall_s - began.wall_s:8.1f}{ended.processor_s - began.processor_s:13.1f}"
    )


def main() -> None:
    """Print the wall time and processor time of each stage of a campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        moments, outcomes = fly(asked.seed, Path(folder))
    sys.stdout.write("\n".join([*stages_in_words(moments), "", *dives_in_words(outcomes)]) + "\n")


if __name__ == "__main__":
    main()
