"""Parts of the safety benchmark: their dives, their results and the rows of their tables."""

import math
import statistics
from pathlib import Path
from typing import NamedTuple

from autopilot.control.params import Config
from benchmarks.safety import cases, flight
from benchmarks.safety.cases import Case
from benchmarks.safety.flight import Outcome
from mavlink_io.errors import InputError
from sysid.trials import map_trials

PARTS = ("faults", "pairs", "parameters", "missions")
"""Parts, in the order of the table."""
DEPTH_MARGIN_M = 0.5
"""Depth beyond FS_DEPTH_M that counts as noise of the depth measurement."""


class Sizes(NamedTuple):
    """Number of dives of each part."""

    seeds: int = 20
    """Of each fault of the catalogue and vehicle."""
    pairs: int = 2000
    missions: int = 1000
    vehicles: tuple[str, ...] = cases.VEHICLES


class Row(NamedTuple):
    """One line of the table of `make soak`."""

    what: str
    target: str
    printed: str
    met: bool


def rows(sizes: Sizes, keep: Path, *, jobs: int = 1) -> list[Row]:
    """Fly every part and return the rows of the table.

    Parameters
    ----------
    sizes : Sizes
        Numbers of dives.
    keep : Path
        Folder of the finished dives, which are not flown again.
    jobs : int
        Number of processes.

    Returns
    -------
    list of Row
        One row for each part.
    """
    return [row_of(part, fly_part(part, sizes, keep, jobs=jobs), sizes) for part in PARTS]


def cases_of(part: str, sizes: Sizes) -> list[Case]:
    """Return the dives of a part."""
    if part == "faults":
        return cases.single_faults(sizes.vehicles, range(sizes.seeds))
    if part == "pairs":
        return cases.pairs(sizes.pairs)
    if part == "parameters":
        return cases.parameter_dives()
    return cases.random_missions(sizes.missions)


def find_case(name: str, vehicle: str, seed: int) -> Case:
    """Return the dive of a name.

    Raises InputError.
    """
    kind, _, rest = name.partition(":")
    try:
        if kind == "fault":
            unit, fault = rest.split("-")
            return cases.single_fault(unit, fault, vehicle, seed)
        if kind == "pair":
            return cases.pair(int(rest))
        if kind == "mission":
            return cases.random_mission(int(rest))
        return next(case for case in cases.parameter_dives(vehicle) if case.name == name)
    except (ValueError, StopIteration):
        raise InputError(
            f"dive {name!r}: expected fault:UNIT-KIND, pair:N, mission:N or parameter:NAME=VALUE"
        ) from None


def fly_part(part: str, sizes: Sizes, keep: Path, *, jobs: int = 1) -> list[Outcome]:
    """Fly the dives of a part that are not kept yet; return all outcomes."""
    return map_trials(
        flight.fly, cases_of(part, sizes), Outcome, jobs=jobs, keep=keep / f"{part}.jsonl"
    )


def row_of(part: str, outcomes: list[Outcome], sizes: Sizes) -> Row:
    """Return the line of the table for a part."""
    failed = [outcome for outcome in outcomes if failure(outcome)]
    counts = {
        reason: sum(failure(outcome) == reason for outcome in failed)
        for reason in dict.fromkeys(map(failure, failed))
    }
    found = ", ".join(f"{count} {reason}" for reason, count in counts.items()) or "none fails"
    size = {
        "faults": f"{len(cases.catalogue_names())} faults x {len(sizes.vehicles)} vehicles"
        f" x {sizes.seeds} seeds (0 to {sizes.seeds - 1})",
        "pairs": f"pairs 0 to {sizes.pairs - 1}",
        "parameters": f"{len(outcomes)} values",
        "missions": f"missions 0 to {sizes.missions - 1}",
    }[part]
    return Row(f"{part}: {size}", "0 fail", f"{len(outcomes)} dives: {found}", not failed)


def failure(outcome: Outcome) -> str:
    """Return why a dive fails; empty if it does not."""
    if outcome.ending == "endless":
        return "endless"
    if outcome.avoidable:
        return "avoidable contact"
    limit_m = _depth_limit_m(outcome)
    if outcome.name.startswith("parameter") and outcome.deepest_m > limit_m + DEPTH_MARGIN_M:
        return "beyond the depth limit"
    return ""


def _depth_limit_m(outcome: Outcome) -> float:
    """Return FS_DEPTH_M of a dive with a changed parameter."""
    name, _, value = outcome.name.partition(":")[2].partition("=")
    return float(value) if name == "FS_DEPTH_M" else Config().fs_depth_m


def report(part: str, sizes: Sizes, keep: Path, *, jobs: int = 1) -> str:
    """Fly a part and return its report: row, time to safe per fault, and the dives that fail."""
    outcomes = fly_part(part, sizes, keep, jobs=jobs)
    row = row_of(part, outcomes, sizes)
    endings = [outcome.ending for outcome in outcomes]
    summary = ", ".join(f"{endings.count(name)} {name}" for name in sorted(set(endings)))
    contacts = sum(not math.isnan(outcome.contact_s) for outcome in outcomes)
    lines = [
        row.what,
        f"  {row.printed}",
        f"  endings: {summary}; {contacts} touch the floor, those of the oracle included",
    ]
    if part == "faults":
        lines += _times_to_safe(outcomes)
    lines += [
        f"  {failure(outcome)}: python -m benchmarks.safety --dive {outcome.name}"
        f" --vehicle {outcome.vehicle} --seed {outcome.seed}"
        for outcome in outcomes
        if failure(outcome)
    ]
    return "\n".join(lines)


def _times_to_safe(outcomes: list[Outcome]) -> list[str]:
    """Return the time from fault to the end at the surface, one line for each fault."""
    lines = ["  time to safe (s): fault, median, longest, dives that do not end afloat"]
    for name in dict.fromkeys(outcome.name for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.name == name]
        times = [outcome.safe_s for outcome in own if not math.isnan(outcome.safe_s)]
        others = len(own) - len(times)
        shown = f"{statistics.median(times):6.0f} {max(times):6.0f}" if times else "     -      -"
        lines.append(f"    {name.partition(':')[2]:28s} {shown} {others:4d}")
    return lines
