"""Options of a campaign, its missions and the seeds of its dives."""

from pathlib import Path
from typing import NamedTuple

from ground.campaign import prototype
from ground.campaign.computations import FITTED, HELD_OUT, MISSIONS, RETESTS

TRIM_MISSION = "trim"
"""Straight and level mission from which the trims are measured."""
IDENTIFICATION = (*FITTED[:2], *HELD_OUT, *FITTED[2:])
"""Test missions in the order of flying, longest first, so that all cores finish together."""
ALL_MISSIONS = (TRIM_MISSION, *IDENTIFICATION, *MISSIONS)
DEFAULT_EXTRA_WATER_S = 1800.0
"""Default of the vehicle time for recommended tests (s)."""


class CampaignRequest(NamedTuple):
    """Options of a campaign."""

    out: Path
    vehicle: str = "caribou_truth"
    scenario: str = "disturbed"
    seed: int = 1
    speed: str = "max"
    include_paper_gains: bool = False
    """Whether to fly the missions also with the paper's improved gains."""
    force: bool = False
    """Replace the campaign that is in the folder."""
    resume: bool = False
    """Continue the campaign that is in the folder; begin it if the folder is empty."""
    jobs: int = 1
    """Number of dives and computations that run at the same time; each uses about one core."""
    truth: str = ""
    """Vehicle file that is flown, or `perturbed`; empty: `prototype.default_truth`."""
    extra_water_s: float = DEFAULT_EXTRA_WATER_S
    """Vehicle time for the tests that the assessment recommends for a model that is not fit (s)."""

    @property
    def flown_vehicle(self) -> str:
        """Vehicle file that is flown, or `perturbed`."""
        return self.truth or prototype.default_truth(self.vehicle)


def dive_seed(seed: int, mission: str) -> int:
    """Return the seed of a dive: different for each mission, equal for all sets of gains.

    Parameters
    ----------
    seed : int
        Seed of the campaign.
    mission : str
        Name of a mission of the campaign.

    Returns
    -------
    int
        Seed of the simulation.
    """
    return seed * 1000 + (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT, *RETESTS).index(mission)
