"""Dives and bench tests end the same way when every STATUSTEXT is lost."""

import math
from pathlib import Path

import numpy as np
import pytest

from ground.bench_tests import bench, incline
from ground.campaign import refit
from ground.client import connection_diagnosis, flight
from ground.client.connection_diagnosis import Arrived
from ground.client.flight import Dive, FlightResult
from ground.simulation.processes import SimulatedVehicle, Simulation
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from sysid.data import readers
from sysid.data.segments import intervals_of_tests

pytestmark = pytest.mark.process

MISSION = """
name = "short"

[[step]]
depth_m = 3.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 40.0

[[step]]
surface = true
"""


@pytest.fixture(autouse=True)
def lost_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drop every STATUSTEXT that arrives."""
    receive_all = connection_diagnosis.receive_all

    def without_texts(endpoint: Endpoint) -> Arrived:
        arrived = receive_all(endpoint)
        return arrived._replace(frames=[f for f in arrived.frames if f.name != "STATUSTEXT"])

    monkeypatch.setattr(connection_diagnosis, "receive_all", without_texts)


def flown(folder: Path, scenario: str = "calm", **parameters: float) -> FlightResult:
    mission = folder / "mission.toml"
    mission.write_text(MISSION)
    dive = Dive.load(str(mission), folder / "dive.mcap", parameters=parameters)
    return flight.fly_simulated(dive, SimulatedVehicle(Simulation(scenario=scenario)))


def test_bench_test_without_texts_identifies_the_tailcone(tmp_path: Path) -> None:
    """Tolerances: those of the bench test with texts, in tests/ground/bench_tests."""
    session = bench.Session(
        tmp_path, axes=("elevator",), amplitudes_deg=(10.0, 30.0), frequencies_hz=(0.2, 0.5)
    )
    vehicle = SimulatedVehicle(Simulation(scenario="bench"))
    model = bench.measure(session, vehicle, lambda progress: None)["elevator"].model
    assert list(intervals_of_tests(readers.read(tmp_path / "bench.mcap"))) == []
    assert model.natural_frequency_radps.value == pytest.approx(3.0, rel=0.03)
    assert model.delay_s.value == pytest.approx(0.3, rel=0.03)
    assert math.degrees(model.rate_radps.value) == pytest.approx(15.0, rel=0.03)


def test_inclining_test_without_texts_finds_the_centre_of_mass(tmp_path: Path) -> None:
    vehicle = SimulatedVehicle(Simulation(scenario="inclining"))
    quiet = lambda shown: None  # noqa: E731
    session = incline.IncliningSession(
        plan=incline.load(None), log=tmp_path / "a.mcap", prior="caribou_nominal"
    )
    found = incline.measure(session, vehicle, quiet, quiet)
    assert found.z_cm_m.value == pytest.approx(-0.015, abs=0.0005)


def test_dive_without_texts_ends_and_gives_trims(tmp_path: Path) -> None:
    result = flown(tmp_path)
    assert (result.texts, result.failsafes) == ((), ())
    assert set(refit.measure_trims(result.log, 5.0)) == {"TRIM_RUD_DEG", "TRIM_ELE_DEG"}


def test_failsafe_without_text_is_reported(tmp_path: Path) -> None:
    result = flown(tmp_path, FS_TIME_S=20.0)
    assert result.failsafes == ("mission left for mode SURFACE in a critical state",)


def test_dive_with_a_faulty_altimeter_has_no_failsafe(tmp_path: Path) -> None:
    """The fault is reported only: MAV_STATE_CRITICAL, also in the SURFACE that ends the mission."""
    scenario = tmp_path / "faulty.toml"
    scenario.write_text('[[fault]]\nat_s = 10.0\nunit = "altimeter"\nkind = "garbage"\n')
    result = flown(tmp_path, str(scenario))
    tables = readers.load(result.log).tables
    status = tables["/mavlink/1/1/HEARTBEAT"].columns["system_status"]
    assert np.any(status == constant("MAV_STATE_CRITICAL"))
    assert result.failsafes == ()
