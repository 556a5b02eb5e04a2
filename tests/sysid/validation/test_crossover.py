"""Highest feasible crossover, and default gains of loops whose gains are unknown."""

from pathlib import Path

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.models import parameters
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.validation import crossover

ROOT = Path(__file__).parents[3]
FILES = [
    ROOT / "docs" / "my_vehicle.toml",
    *sorted((ROOT / "benchmarks" / "campaigns" / "vehicles").glob("*.toml")),
]


def nominal(name: str | Path) -> CandidateVehicle:
    return parameters.candidate_vehicle(
        config.load(name), dict.fromkeys(PLANES, 0.0), np.zeros(len(NAMES))
    )


@pytest.mark.parametrize("plane", Plane)
def test_highest_feasible_crossover_rate_phase_is_minus_120_deg(plane: Plane) -> None:
    vehicle = nominal("caribou_nominal")
    frequency = crossover.highest_feasible_radps(vehicle, plane)
    angle = np.angle(crossover.response(vehicle, plane))
    assert np.degrees(np.interp(frequency, GRID_RADPS, angle)) == pytest.approx(-120.0, abs=1.5)
    later = (frequency * 1.05 < GRID_RADPS) & (frequency * 1.4 > GRID_RADPS)
    assert np.all(np.degrees(angle[later]) < -120.0)


def test_gains_for_caribou_are_those_of_the_paper() -> None:
    assert crossover.gains_for(nominal("caribou_nominal")) == pytest.approx(
        TABLE_3_INITIAL, rel=0.02
    )


@pytest.mark.parametrize("plane", Plane)
@pytest.mark.parametrize(
    "vehicle", ["caribou_nominal", "remus100", "xfin_auv", *FILES], ids=lambda file: Path(file).stem
)
def test_gains_for_any_vehicle_cross_at_the_same_share_of_its_reach(
    vehicle: str | Path, plane: Plane
) -> None:
    """Table 3's gains scaled by effectiveness alone crossed at a quarter of it on fast vehicles."""
    model = nominal(vehicle)
    loop = crossover.loop(model, plane, crossover.gains_for(model))
    margins = loop_transfer.margins(loop)
    share = margins.crossover_radps / crossover.highest_feasible_radps(model, plane)
    assert 0.5 < share < 0.85
    assert margins.pm_deg > 30.0
