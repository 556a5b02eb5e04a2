"""The verdict of six deliberately bad dives names what was wrong and what to do next."""

from pathlib import Path
from typing import NamedTuple

import pytest

from ground.client import assessment, flight, verdict
from ground.client.assessment import Outcome
from ground.client.flight import Dive
from ground.simulation.processes import SimulatedVehicle, Simulation

pytestmark = pytest.mark.process

LEGS = """
name = "two legs"

[[step]]
depth_m = 3.0
heading_deg = 20.0
thrust_pct = 58.0
duration_s = {0}

[[step]]
heading_deg = 60.0
duration_s = {0}

[[step]]
surface = true
"""
TRIMS = {"TRIM_RUD_DEG": 6.0, "TRIM_ELE_DEG": 0.4}
"""Trims of caribou_truth, whose rudder is 6 deg off (figure 7 of the paper)."""
HEAVY = '[[fault]]\nat_s = 0.0\nunit = "ballast"\nkind = "added"\nmass_kg = 8.0\n'
STUCK = '[[fault]]\nat_s = 30.0\nunit = "rudder"\nkind = "stuck"\nangle_deg = 8.0\n'
CURRENT = "[current]\nspeed_mps = 1.0\ntowards_deg = 110.0\n"
REVERSED = (
    ("Y_dr_nprad = 264.0", "Y_dr_nprad = -264.0"),
    ("N_dr_nmprad = -513.0", "N_dr_nmprad = 513.0"),
)
"""Changes of the vehicle file with which the rudder turns the vehicle to the other side."""


class BadDive(NamedTuple):
    """One dive, and texts that its verdict must hold."""

    outcome: Outcome
    headline: str
    step: str
    scenario: str = ""
    trims: bool = True
    reversed_rudder: bool = False
    leg_s: float = 45.0


DIVES = {
    "untrimmed": BadDive(
        Outcome.ATTENTION,
        "deg off in the mean on 2 of 2 legs: the rudder trim is not set",
        "set TRIM_RUD_DEG to 6.",
        trims=False,
    ),
    "wrong sign": BadDive(
        Outcome.FAILED,
        "the rudder acts in the wrong direction",
        "reverse the rudder",
        reversed_rudder=True,
    ),
    "too heavy": BadDive(
        Outcome.ATTENTION,
        "the vehicle is too heavy: level flight takes 4.",
        "take ballast out",
        scenario=HEAVY,
    ),
    "strong current": BadDive(
        Outcome.ATTENTION,
        "strong current: 1.0 m/s towards 1",
        "use waypoints",
        scenario=CURRENT,
    ),
    "short mission": BadDive(
        Outcome.UNKNOWN,
        "too short: no leg under water lasted 30 s",
        "give each leg at least 60 s",
        leg_s=12.0,
    ),
    "stuck fin": BadDive(
        Outcome.FAILED,
        "the rudder is stuck or disconnected since about",
        "check the rudder and its linkage",
        scenario=STUCK,
    ),
}


def vehicle_file(folder: Path, *, reversed_rudder: bool) -> str:
    if not reversed_rudder:
        return "caribou_truth"
    source = Path(__file__).parents[2] / "sitl/vehicle/caribou_truth.toml"
    text = source.read_text(encoding="utf-8")
    for old, new in REVERSED:
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "reversed.toml").write_text(text, encoding="utf-8")
    return str(folder / "reversed.toml")


@pytest.mark.parametrize("name", DIVES)
def test_bad_dive_is_named_with_its_remedy(tmp_path: Path, name: str) -> None:
    bad = DIVES[name]
    mission = tmp_path / "mission.toml"
    mission.write_text(LEGS.format(bad.leg_s), encoding="utf-8")
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f'title = "bad"\n{bad.scenario}', encoding="utf-8")
    vehicle = vehicle_file(tmp_path, reversed_rudder=bad.reversed_rudder)
    dive = Dive.load(str(mission), tmp_path / "log.mcap", parameters=TRIMS if bad.trims else {})
    result = flight.fly_simulated(
        dive, SimulatedVehicle(Simulation(vehicle=vehicle, scenario=str(scenario)))
    )
    found = assessment.assess_dive(result.log)
    text = verdict.format_text(found)
    assert found.outcome is bad.outcome, text
    assert bad.headline in verdict.headline(found), text
    assert bad.step in verdict.next_step(found), text
    assert text.startswith(f"{bad.outcome}: ")
