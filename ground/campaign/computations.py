"""Computations of a campaign, which its worker process runs while dives are under way.

The process keeps the folder of the campaign, so that each log is read once. The page is imported
where it is written: it loads matplotlib and python-control, which the process of the campaign does
not need and the worker loads during the tests.
"""

import importlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from msgspec.structs import replace

from ground.campaign import refit, retest, summary
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.retest import Retest
from ground.campaign.summary_file import CampaignSummary, DesignSummary
from ground.missions import script
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MissionItem
from mavlink_io.user_data_dir import write_output
from sysid.monitor import performance_spec
from sysid.refit import RefitRequest
from sysid.validation.results import ModelAssessment, NextTest

if TYPE_CHECKING:
    from ground.report.page import ModelFigures
    from sysid.control_analysis.control_systems import MarginsComparison

MISSIONS = ("straight_run", "depth_change", "combined", "shallow_1m")
"""Missions that are flown with each set of gains."""
FITTED = ("rudder_steps", "elevator_steps", "rudder_sweeps", "elevator_sweeps")
"""Test missions that are fitted: the paper's steps, and sweeps, which excite the dynamics near the
crossover."""
REHEARSED = "straight_run"
"""Mission that is simulated to compare redesigned and first gains; its errors are Table 5's."""
HELD_OUT = ("rudder_heldout", "elevator_heldout")
"""Test missions that are predicted but not fitted."""
RETESTS = tuple(f"retest_{number}" for number in range(1, 7))
"""Dives with the tests that the assessment recommends, as far as the water time permits."""


def load_modules(names: Sequence[str]) -> None:
    """Import modules."""
    for name in names:
        importlib.import_module(name)


@cache
def _folder(out: Path) -> CampaignFolder:
    """Return the folder of a campaign; the worker keeps it, so that each log is read once."""
    return CampaignFolder(out)


def read_log(out: Path, stage: str, mission: str) -> None:
    """Read a log that is needed later; then it is an error if it cannot be read."""
    with suppress(InputError):
        _folder(out).log(stage, mission)


class RetestRecord(NamedTuple):
    """A dive with a recommended test that has been flown."""

    mission: str
    held_out: bool


def identify(out: Path, retests: Sequence[RetestRecord] = ()) -> ModelAssessment | None:
    """Refit the tests and write `model.json`; return the assessment of the model.

    `retests` are the dives with recommended tests. Raises OperationError if the fit has no result.
    """
    folder = _folder(out)
    fitted = [*FITTED, *(retest.mission for retest in retests if not retest.held_out)]
    held_out = [*HELD_OUT, *(retest.mission for retest in retests if retest.held_out)]
    request = RefitRequest(
        paths=[folder.log_path("identification", name) for name in fitted],
        held_out=[folder.log_path("identification", name) for name in held_out],
        prior=folder.prior,
        alternative_methods=("paper",),
    )
    model = refit.refit_logs(
        request,
        [folder.log("identification", name) for name in fitted],
        [folder.log("identification", name) for name in held_out],
        force=True,
    )
    refit.write_model(model, out / "model.json")
    folder.forget_model()
    return model.assessment


def plan_retest(out: Path, recommended: NextTest, mission: str) -> Retest | None:
    """Return the dive with a recommended test."""
    folder = _folder(out)
    missions = {name: script.load(folder.mission_file(name)) for name in (*FITTED, *HELD_OUT)}
    return retest.plan(missions, recommended, mission)


def design(
    out: Path, first: Mapping[str, float], rehearsed: tuple[MissionItem, ...]
) -> DesignSummary:
    """Redesign the gains and write `gains.param`; return the summary of the design.

    `first` are the parameters of the first dives, without trims; `rehearsed` are the items of
    mission `REHEARSED`.
    """
    folder = _folder(out)
    refit.check_converged(
        folder.model,
        f"the failed model is {out / 'model.json'}; with a corrected vehicle file run the campaign"
        " again",
    )
    design, selection = refit.redesign_for_campaign(
        folder.model,
        folder.prior,
        first,
        rehearsed,
        summary.settling_s(folder.mission_file(REHEARSED)),
    )
    design.write_params(out / "gains.param")
    return replace(summary.summarise_design(design), selection=selection)


def add_parameters(
    out: Path, summary: DesignSummary, limits: Mapping[str, float], reasons: Mapping[str, str]
) -> DesignSummary:
    """Add the parameters that failsafes have limited to a design and to `gains.param`."""
    folder = _folder(out)
    limited = replace(
        summary,
        gains={**summary.gains, **limits},
        reasons={**summary.reasons, **reasons},
    )
    text = performance_spec.encode(folder.baseline, limited.gains, limited.reasons)
    write_output(out / "gains.param", text)
    return limited


@cache
def _model_figures(out: Path) -> "ModelFigures":
    """Return the figures of tests and model; the worker keeps them for the report."""
    from ground.report import page

    return page.model_figures(_folder(out))


_MARGINS: dict[Path, Mapping[str, "MarginsComparison"]] = {}
"""Margins by python-control of each campaign, which the worker keeps for the report."""


def prepare_report(
    out: Path, design: DesignSummary, gains: Mapping[str, Mapping[str, float]]
) -> None:
    """Draw the tests and the model, and compare the margins, for the report."""
    from ground.report import page

    _model_figures(out)
    analyses = page.loop_analyses(design)
    _MARGINS[out] = page.compare_margins(_folder(out), analyses, gains)


def compare(
    out: Path,
    totals: summary.Totals,
    design: DesignSummary,
    gains: Mapping[str, Mapping[str, float]],
    trims: Mapping[str, float],
) -> CampaignSummary:
    """Return the summary of the campaign without its wall time."""
    return summary.build(_folder(out), totals, design, gains, trims, MISSIONS)


def report(out: Path) -> None:
    """Write `report.html`."""
    from ground.report import page

    page.write(_folder(out), _model_figures(out), _MARGINS.get(out))
