"""The Monte-Carlo study of redesigned gains in the water.

    python -m benchmarks.redesign [CELL ...] [--case NAME ...] [--runs N] [--model FILE.json] [--out FILE.json]

Without a model it flies a campaign first. Each figure is printed beside its target; a missed one is marked, and makes
the exit status 1.
"""

import argparse
import os
import sys
from functools import cache
from pathlib import Path

from benchmarks import study
from benchmarks.redesign import campaign
from benchmarks.redesign.campaign import Campaign, Values
from benchmarks.redesign.cells import QUESTIONS
from benchmarks.study import Outcome
from sysid import model as models
from sysid.design import DesignRefused
from sysid.model import ModelError


def main() -> None:
    asked = _arguments()
    gains, outcomes = cache(lambda: _gains(asked.model, asked.seed)), list[Outcome]()
    for question in [QUESTIONS[name] for name in asked.cell or QUESTIONS]:
        cell = question.cell(gains)
        for case in [case for case in question.cases if not asked.case or case in asked.case]:
            outcomes.append(study.run(cell, case, asked.runs or cell.runs, asked.seed, asked.jobs))
            study.show(outcomes[-1])
            if asked.out:
                asked.out.write_text(study.as_json(outcomes, asked.seed), encoding="utf-8")
    sys.exit(0 if all(figure.met for outcome in outcomes for figure in outcome.figures) else 1)


def _arguments() -> argparse.Namespace:
    cases = sorted({case for question in QUESTIONS.values() for case in question.cases})
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cell", nargs="*", choices=[[], *QUESTIONS], help="which cells; all without one")
    parser.add_argument("--case", action="append", choices=cases, metavar="NAME", help=", ".join(cases))
    parser.add_argument("--runs", type=int, help="of each case; 20 for most")
    parser.add_argument("--seed", type=int, default=1, help="of the campaign and of the first run")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--model", type=Path, help="redesign from this model.json instead of a campaign's")
    parser.add_argument("--out", type=Path, help="JSON of all figures")
    return parser.parse_args()


def _gains(model: Path | None, seed: int) -> dict[str, Values]:
    """The sets of gains to compare; a model that cannot be read or gives no gains ends the study."""
    try:
        flown = Campaign(models.read(model), campaign.measured_trims(seed)) if model else campaign.fly(seed)
        return campaign.gain_sets(flown.trims, campaign.redesigned(flown).gains)
    except ModelError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except DesignRefused as refusal:
        print(refusal, file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
