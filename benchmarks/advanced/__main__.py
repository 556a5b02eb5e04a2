"""PID redesign and LQG of the same specification, on one model and on the same seeds.

    python -m benchmarks.advanced [CASE ...] [--model FILE.json] [--runs N] [--out FILE.json]

Without a model it flies a campaign first. Exit status 1 where no gains or laws meet the specification.
"""

import argparse
import os
import sys
from pathlib import Path

from benchmarks import study
from benchmarks.advanced import designed, flown
from benchmarks.redesign import campaign
from benchmarks.redesign.campaign import Campaign
from benchmarks.study import Outcome
from sysid import model as models
from sysid.design import DesignRefused
from sysid.model import ModelError


def main() -> None:
    asked = _arguments()
    try:
        known = Campaign(models.read(asked.model), campaign.measured_trims(asked.seed)) if asked.model else None
        model, trims = known or campaign.fly(asked.seed)
        both = designed.designed(model, trims)
    except ModelError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except DesignRefused as refusal:
        print(refusal, file=sys.stderr)
        sys.exit(1)
    outcomes = [Outcome("advanced", "predicted", 1, tuple(designed.promised(model, both)))]
    study.show(outcomes[0])
    cell = flown.cell(both.contenders)
    for case in asked.case or flown.CASES:
        outcomes.append(study.run(cell, case, asked.runs or cell.runs, asked.seed, asked.jobs))
        study.show(outcomes[-1])
        if asked.out:
            asked.out.write_text(study.as_json(outcomes, asked.seed), encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="*", choices=[[], *flown.CASES], help="which seas or vehicles; all without one")
    parser.add_argument("--model", type=Path, help="a model.json instead of a campaign's")
    parser.add_argument("--runs", type=int, help="dives of each case; 20 unless told")
    parser.add_argument("--seed", type=int, default=1, help="of the campaign and of the first dive")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="JSON of all figures")
    return parser.parse_args()


if __name__ == "__main__":
    main()
