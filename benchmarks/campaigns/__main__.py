"""Campaigns of eight unlike vehicles, each flown with a truth that is not its prior.

    python -m benchmarks.campaigns [--vehicles NAME,...] [--seeds 5] [--jobs N] [--keep DIR]
    python -m benchmarks.campaigns --vehicles drawn_1,drawn_2,... --seeds 1

Vehicles named drawn_N are drawn at random (`benchmarks.campaigns.drawn`). Each campaign is
`ground campaign --vehicle FILE --seed N` in the disturbed sea. A campaign that has ended is kept in
its folder and not flown again, so that the command continues where it was ended. Exit status 1 if a
target is missed.
"""

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.campaigns import drawn
from sysid.trials import usable_cores

ROOT = Path(__file__).parents[2]
OWN = Path(__file__).parent / "vehicles"
VEHICLES = {
    "caribou": "caribou_truth",
    "remus100": "remus100",
    "xfin": "xfin_auv",
    "my_vehicle": str(ROOT / "docs" / "my_vehicle.toml"),
    "short_fat": str(OWN / "short_fat.toml"),
    "long_slow": str(OWN / "long_slow.toml"),
    "unstable_yaw": str(OWN / "unstable_yaw.toml"),
    "heavy": str(OWN / "heavy.toml"),
}
"""Value of `--vehicle` by name."""
SHIPPED = ("caribou", "remus100", "xfin", "my_vehicle")
"""Vehicles of which every campaign must complete."""
MIN_OTHERS = 3
"""Smallest number of the other vehicles of which every campaign must complete."""
MIN_SHARE = 0.9
"""Smallest share of campaigns that are fit, and of redesigns that are at least as good."""
KEEP = Path("studies") / "campaigns"
WIDTH = 150
"""Width of the table where the output is no terminal."""
OUTCOME_FILE = "outcome.json"
NOT_FIT = "not fit for redesign"
"""Words of the error of a campaign whose model is not fit."""


class Outcome(NamedTuple):
    """Result of one campaign."""

    vehicle: str
    seed: int
    error: str
    """Reason why the campaign did not complete; empty if it did."""
    refused: bool = False
    """Whether it was refused before the first dive."""
    retests: int = 0
    """Number of dives with recommended tests."""
    heading: float = 0.0
    """95 % error of the straight run, redesigned over first gains."""
    depth: float = 0.0
    heading_deg: float = 0.0
    depth_m: float = 0.0
    """95 % errors of the straight run with the redesigned gains."""
    pm_deg: float = 0.0
    """Phase margin that the redesign was asked for."""
    kept_first: bool = False

    @property
    def fit(self) -> bool:
        """Whether the model was assessed as fit for redesign."""
        return not self.refused and NOT_FIT not in self.error

    @property
    def at_least_as_good(self) -> bool:
        """Whether heading and depth are held at least as well as with the first gains."""
        return not self.error and self.heading <= 1.0 and self.depth <= 1.0


def main() -> int:
    """Fly the campaigns that are missing; print the table. Return the exit status."""
    asked = _arguments()
    outcomes = []
    for name in asked.vehicles:
        for seed in range(1, asked.seeds + 1):
            outcomes.append(run(name, seed, asked.keep, asked.jobs))
            print(_line(outcomes[-1]), file=sys.stderr, flush=True)
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table(outcomes))
    targets = list(judge(outcomes))
    for text, met in targets:
        print(f"{'met   ' if met else 'MISSED'} {text}")
    return 0 if all(met for _, met in targets) else 1


def _arguments() -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.campaigns",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--vehicles", type=_names, default=tuple(VEHICLES))
    parser.add_argument("--seeds", type=int, default=5, help="campaigns per vehicle; default 5")
    parser.add_argument("--jobs", type=int, default=usable_cores(), help="processes per campaign")
    parser.add_argument("--keep", type=Path, default=KEEP, help=f"folder; default {KEEP}")
    return parser.parse_args()


def _names(text: str) -> tuple[str, ...]:
    """Return names of vehicles. Raises ArgumentTypeError."""
    names = tuple(text.split(","))
    unknown = [name for name in names if name not in VEHICLES and not _number_of(name)]
    if unknown:
        choices = ", ".join([*VEHICLES, f"{drawn.NAME}1, {drawn.NAME}2, ..."])
        raise argparse.ArgumentTypeError(f"{unknown[0]!r}: give one of {choices}")
    return names


def _number_of(name: str) -> str:
    """Return the number of a drawn vehicle as text; empty for another name."""
    number = name.removeprefix(drawn.NAME)
    return number if number != name and number.isdecimal() else ""


def _file_of(vehicle: str, keep: Path) -> str:
    """Return the value of `--vehicle`; write the file of a drawn one."""
    if vehicle in VEHICLES:
        return VEHICLES[vehicle]
    path = keep / f"{vehicle}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(drawn.text(int(_number_of(vehicle))), encoding="utf-8")
    return str(path)


def run(vehicle: str, seed: int, keep: Path, jobs: int) -> Outcome:
    """Fly a campaign, or read the outcome of one that has ended.

    Parameters
    ----------
    vehicle : str
        Name in `VEHICLES`, or of a drawn vehicle.
    seed : int
        Seed of the campaign.
    keep : Path
        Folder of the campaigns.
    jobs : int
        Number of processes.

    Returns
    -------
    Outcome
        Result, or reason of the failure.
    """
    folder = keep / f"{vehicle}_{seed}"
    if (folder / OUTCOME_FILE).is_file():
        return Outcome(**json.loads((folder / OUTCOME_FILE).read_text(encoding="utf-8")))
    shutil.rmtree(folder, ignore_errors=True)
    command = [sys.executable, "-m", "ground", "campaign", "--vehicle"]
    command += [_file_of(vehicle, keep)]
    command += ["--seed", str(seed), "--jobs", str(jobs), "--json", "--out", str(folder)]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    if process.returncode == 0:
        outcome = summarise(vehicle, seed, json.loads(process.stdout))
    else:
        error = _last_line(process.stderr)
        outcome = Outcome(vehicle, seed, error, refused=not (folder / "prototype").is_dir())
    folder.mkdir(parents=True, exist_ok=True)
    (folder / OUTCOME_FILE).write_text(json.dumps(outcome._asdict()), encoding="utf-8")
    return outcome


def _last_line(text: str) -> str:
    """Return the last line with text; a word if there is none."""
    return next((line for line in reversed(text.splitlines()) if line.strip()), "no reason given")


def summarise(vehicle: str, seed: int, summary: dict[str, Any]) -> Outcome:
    """Return the outcome of a completed campaign.

    Parameters
    ----------
    vehicle : str
        Name in `VEHICLES`.
    seed : int
        Seed of the campaign.
    summary : dict
        Content of its `summary.json`.

    Returns
    -------
    Outcome
        Errors of the redesigned gains beside those of the first ones.
    """
    first, redesigned = (summary["steady_error"][name] for name in ("initial", "redesigned"))
    return Outcome(
        vehicle=vehicle,
        seed=seed,
        error="",
        retests=len(summary["retests"]),
        heading=redesigned["heading_deg"] / first["heading_deg"],
        depth=redesigned["depth_m"] / first["depth_m"],
        heading_deg=redesigned["heading_deg"],
        depth_m=redesigned["depth_m"],
        pm_deg=summary["design"]["specification"]["pm_deg"],
        kept_first=summary["design"]["selection"]["kept_first"],
    )


def _line(outcome: Outcome) -> str:
    """Return the outcome of one campaign as text."""
    name = f"{outcome.vehicle} {outcome.seed}"
    if outcome.error:
        return f"{name}: {outcome.error}"
    kept = ", first gains kept" if outcome.kept_first else f", PM {outcome.pm_deg:g} deg"
    return (
        f"{name}: heading {outcome.heading:.2f}, depth {outcome.depth:.2f} times the first"
        f" gains'{kept}, {outcome.retests} retests"
    )


def table(outcomes: Sequence[Outcome]) -> Table:
    """Return one row per vehicle.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Results of the campaigns.

    Returns
    -------
    Table
        Numbers of campaigns, and medians of the errors.
    """
    heads = ("vehicle", "completed", "fit", "as good", "first kept", "retests", "heading", "depth")
    result = Table(*heads, "deg", "cm", "first reason of a failure", box=box.SIMPLE_HEAD)
    for name in dict.fromkeys(outcome.vehicle for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.vehicle == name]
        done = [outcome for outcome in own if not outcome.error]
        counts = (
            len(done),
            sum(outcome.fit for outcome in own),
            sum(outcome.at_least_as_good for outcome in own),
            sum(outcome.kept_first for outcome in own),
            sum(outcome.retests for outcome in own),
        )
        medians = [
            _median(values)
            for values in (
                [outcome.heading for outcome in done],
                [outcome.depth for outcome in done],
                [outcome.heading_deg for outcome in done],
                [100.0 * outcome.depth_m for outcome in done],
            )
        ]
        cells = [f"{count} of {len(own)}" for count in counts[:4]] + [str(counts[4])]
        errors = [outcome.error for outcome in own if outcome.error]
        result.add_row(name, *cells, *medians, errors[0] if errors else "")
    return result


def _median(values: Sequence[float]) -> str:
    """Return the median as text; empty without values."""
    return f"{sorted(values)[len(values) // 2]:.2f}" if values else ""


def judge(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, bool]]:
    """Yield each target as text, and whether it is met.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Results of the campaigns.

    Yields
    ------
    tuple of str and bool
        Target with the reached value, and whether it is met.
    """
    names = list(dict.fromkeys(outcome.vehicle for outcome in outcomes))
    complete = [name for name in names if not any(o.error for o in outcomes if o.vehicle == name)]
    shipped = [name for name in names if name in SHIPPED]
    others = [name for name in names if name not in SHIPPED]
    if shipped:
        reached = [name for name in shipped if name in complete]
        yield (
            f"every shipped and documented vehicle completes: {len(reached)} of {len(shipped)}",
            reached == shipped,
        )
    if others:
        reached = [name for name in others if name in complete]
        yield (
            f"at least {MIN_OTHERS} other vehicles complete: {len(reached)} of {len(others)}",
            len(reached) >= MIN_OTHERS,
        )
    flown = [outcome for outcome in outcomes if not outcome.refused]
    yield _share("verdict fit", [outcome.fit for outcome in flown])
    yield _share(
        "redesigned gains at least as good in heading and depth",
        [outcome.at_least_as_good for outcome in flown if not outcome.error],
    )


def _share(text: str, values: Iterable[bool]) -> tuple[str, bool]:
    """Return a target on a share of campaigns, and whether it is met."""
    flags = list(values)
    met = bool(flags) and sum(flags) >= MIN_SHARE * len(flags)
    return f"{text}: {sum(flags)} of {len(flags)}, at least {100 * MIN_SHARE:.0f} %", met


if __name__ == "__main__":
    sys.exit(main())
