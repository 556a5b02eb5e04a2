"""Run time of whole campaigns, warm and in a fresh clone, and of the refit of their logs."""

import json
import re
import subprocess
import time
from itertools import pairwise
from pathlib import Path

from mcap.reader import make_reader

from benchmarks.speed import machine, ping_pong
from benchmarks.speed.machine import ROOT, Cost
from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.campaign.computations import FITTED, HELD_OUT
from mavlink_io.errors import OperationError
from mavlink_io.tick import TICK_S
from sysid.trials import usable_cores

FIRST_RESULT = "steady error"
"""Beginning of the first line that a campaign prints after its stages."""
PROGRESS = re.compile(r"\S+: (item \d+ of \d+|\d+ %), ")
"""Beginning of a line about the progress within a stage (`ground.cli.progress`)."""
FLOOR = "UDP ping-pong of all ticks on all cores"


class Stages:
    """Times at which the stages of a campaign begin."""

    def __init__(self) -> None:
        self._marks: list[tuple[str, float, float | None]] = []
        self._ended = False
        self.mark("starting")

    def mark(self, line: str) -> None:
        """Begin a stage with a line of the campaign; progress and results are no stages."""
        if not self._ended and not PROGRESS.match(line):
            self._ended = line.startswith(FIRST_RESULT)
            self._marks.append((line, time.perf_counter(), machine.used_cpu_s()))

    def times_s(self) -> dict[str, float]:
        """Return wall time, and processor time of the whole machine, of each stage."""
        times: dict[str, float] = {}
        for (name, wall_s, cpu_s), (_, next_wall_s, next_cpu_s) in pairwise(self._marks):
            times[f"{name}: wall time, s"] = next_wall_s - wall_s
            if cpu_s is not None and next_cpu_s is not None:
                times[f"{name}: processor time, s"] = next_cpu_s - cpu_s
        return times


def run_campaign(out: Path, sources: Path = ROOT, stages: Stages | None = None) -> Cost:
    """Run a campaign in a new process and return its cost. Raises OperationError."""
    arguments = ["-m", "ground", "campaign", "--seed", "1", "--force", "--out", str(out)]
    return machine.run(arguments, sources=sources, on_line=stages.mark if stages else None)


def warm_campaign(session: Session) -> Path:
    """Return a campaign that was run in this session; the first call runs it."""
    out = session.folder / "warm"
    if not (out / "summary.json").is_file():
        session.report("campaign: one that fills the caches")
        run_campaign(out)
    return out


def measure_campaign(session: Session) -> list[Measurement]:
    """Measure `campaign`, with the times of its stages in the last repetition."""
    out = warm_campaign(session)
    walls_s, floors_s, stages = [], [], Stages()
    for number in range(session.repetitions("campaign")):
        floors_s.append(_floor_s(out))
        stages = Stages()
        walls_s.append(run_campaign(session.folder / f"campaign-{number}", stages=stages).wall_s)
        session.report(f"campaign: {walls_s[-1]:.1f} s; floor {floors_s[-1]:.1f} s")
    return [
        Measurement(
            "campaign", tuple(walls_s), Reference(FLOOR, tuple(floors_s)), details=stages.times_s()
        )
    ]


def measure_fresh_clone(session: Session) -> list[Measurement]:
    """Measure `fresh-clone`. Raises OperationError outside a repository."""
    walls_s, floors_s = [], []
    for number in range(session.repetitions("fresh-clone")):
        clone, out = session.folder / f"clone-{number}", session.folder / f"fresh-{number}"
        _clone(clone)
        machine.run(["-m", "ground.compile_kernels"], sources=clone)
        walls_s.append(run_campaign(out, clone).wall_s)
        floors_s.append(_floor_s(out))
        session.report(f"fresh-clone: {walls_s[-1]:.1f} s; floor {floors_s[-1]:.1f} s")
    return [Measurement("fresh-clone", tuple(walls_s), Reference(FLOOR, tuple(floors_s)))]


def _clone(folder: Path) -> None:
    """Clone the last commit of the sources. Raises OperationError."""
    command = ["git", "clone", "--quiet", "--depth", "1", f"file://{ROOT}", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise OperationError(f"git: {error.strerror}") from None
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["failed"])[-1]
        raise OperationError(f"git clone: {reason}")


def _floor_s(campaign: Path) -> float:
    """Return the time in which all cores exchange the datagrams of all ticks of a campaign."""
    summary = json.loads((campaign / "summary.json").read_text(encoding="utf-8"))
    ticks = float(summary["vehicle_s"]) / TICK_S
    return ticks * ping_pong.round_trip_us() / 1e6 / usable_cores()


def measure_refit(session: Session) -> list[Measurement]:
    """Measure `refit` on the logs of a campaign."""
    logs = warm_campaign(session) / "identification"
    fitted, held_out = (
        [str(logs / f"{name}.mcap") for name in names] for names in (FITTED, HELD_OUT)
    )
    arguments = ["-m", "ground", "refit", *fitted]
    for log in held_out:
        arguments += ["--held-out", log]
    arguments += ["--out", str(session.folder / "model.json")]
    costs_s, reads_s = [], []
    for _ in range(session.repetitions("refit")):
        reads_s.append(_read_s([*fitted, *held_out]))
        costs_s.append(machine.run(arguments).cpu_s)
        session.report(f"refit: {costs_s[-1]:.1f} s of processor time; reading {reads_s[-1]:.1f} s")
    reference = Reference("the package mcap reads the logs", tuple(reads_s))
    return [Measurement("refit", tuple(costs_s), reference)]


def _read_s(logs: list[str]) -> float:
    """Return the processor time in which the package mcap reads all messages."""
    began_s = time.process_time()
    for log in logs:
        with Path(log).open("rb") as file:
            for _ in make_reader(file).iter_messages():
                pass
    return time.process_time() - began_s
