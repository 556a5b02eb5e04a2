"""Computations of a campaign, which its worker process runs while dives are under way.

The process keeps the folder of the campaign, so that each log is read once.
"""

import importlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from ground.campaign import refit, summary
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.summary_file import CampaignSummary, DesignSummary
from ground.report import page
from mavlink_io.errors import InputError
from sysid.refit import RefitRequest

MISSIONS = ("straight_run", "depth_change", "combined", "shallow_1m")
"""Missions that are flown with each set of gains."""
FITTED = ("rudder_steps", "elevator_steps", "rudder_sweeps", "elevator_sweeps")
"""Test missions that are fitted: the paper's steps, and sweeps, which excite the dynamics near the
crossover."""
HELD_OUT = ("rudder_heldout", "elevator_heldout")
"""Test missions that are predicted but not fitted."""


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


def identify(out: Path) -> None:
    """Refit the tests and write `model.json`."""
    folder = _folder(out)
    fitted, held_out = (
        [folder.log("identification", name) for name in names] for names in (FITTED, HELD_OUT)
    )
    request = RefitRequest(
        paths=[folder.log_path("identification", name) for name in FITTED],
        held_out=[folder.log_path("identification", name) for name in HELD_OUT],
        prior=folder.prior,
        alternative_methods=("paper",),
    )
    refit.write_model(refit.refit_logs(request, fitted, held_out), out / "model.json")


def design(out: Path) -> DesignSummary:
    """Redesign the gains and write `gains.param`; return the summary of the design."""
    folder = _folder(out)
    design = refit.redesign_for_campaign(folder.model, folder.prior)
    design.write_params(out / "gains.param")
    return summary.summarise_design(design)


@cache
def _model_figures(out: Path) -> page.ModelFigures:
    """Return the figures of tests and model; the worker keeps them for the report."""
    return page.model_figures(_folder(out))


def draw_tests(out: Path) -> None:
    """Draw the tests and the model for the report."""
    _model_figures(out)


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
    page.write(_folder(out), _model_figures(out))
