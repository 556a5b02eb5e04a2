"""The whole vehicle over the wire: signs as ground receives them, speed by the truth log."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from ground.client import flight
from ground.simulation.processes import SimulatedVehicle, Simulation
from sysid.data import readers, segments
from sysid.data.dataset import Log
from sysid.data.events import TestStarted
from sysid.planes import PLANE_OF_SURFACE

pytestmark = pytest.mark.process

MISSION = """
name = "signs"

[[step]]
depth_m = 5.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 60.0

[[step]]
test = {{ signal = "step", axis = "{axis}", magnitude_deg = 5.0, duration_s = 6 }}

[[step]]
surface = true
"""

LEVEL = """
name = "level"

[[step]]
depth_m = 4.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 120.0

[[step]]
surface = true
"""


def flown(axis: str, folder: Path) -> Log:
    script = folder / f"{axis}.toml"
    script.write_text(MISSION.format(axis=axis))
    dive = flight.Dive.load(str(script), folder / f"{axis}.mcap", parameters={"TRIM_RUD_DEG": 6.0})
    outcome = flight.fly_simulated(dive, SimulatedVehicle(Simulation()))
    assert outcome.lost_frames == 0
    return readers.read(dive.log)


@pytest.mark.parametrize(("axis", "angle"), [("rudder", "heading"), ("elevator", "pitch")])
def test_five_degrees_turn_to_starboard_and_pitch_up(axis: str, angle: str, tmp_path: Path) -> None:
    read = flown(axis, tmp_path)
    (run,) = segments.cut_runs(read)
    attitude = read.attitude
    start_s = next(event.time_s for event in read.events if isinstance(event.value, TestStarted))
    before, after = (np.argmin(np.abs(attitude.time_s - t)) for t in (start_s, start_s + 5.5))
    values = attitude.yaw_rad if angle == "heading" else attitude.pitch_rad
    assert run.plane == PLANE_OF_SURFACE[axis]
    assert 5.0 < np.degrees(values[after] - values[before]) < 60.0
    surface = read.actuators.rudder_rad if axis == "rudder" else read.actuators.elevator_rad
    commanded = np.degrees(surface[np.argmin(np.abs(read.actuators.time_s - (start_s + 3.0)))])
    assert commanded == pytest.approx(11.0 if axis == "rudder" else 5.0, abs=0.01)


@pytest.mark.parametrize("vehicle", ["caribou_nominal", "caribou_truth"])
def test_58_percent_thrust_gives_1_30_mps_in_steady_level_flight(
    vehicle: str, tmp_path: Path
) -> None:
    """Compare the speed of the truth log within 1 %; the vehicle's own speed is an estimate."""
    script = tmp_path / "level.toml"
    script.write_text(LEVEL)
    truth = tmp_path / "truth.mcap"
    trim = {"TRIM_RUD_DEG": 6.0 if vehicle == "caribou_truth" else 0.0}
    dive = flight.Dive.load(str(script), tmp_path / "level.mcap", parameters=trim)
    flight.fly_simulated(dive, SimulatedVehicle(Simulation(vehicle=vehicle, truth=truth)))
    with truth.open("rb") as file:
        states = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages()]
    speeds = [np.linalg.norm(s["velocity_ned_mps"]) for s in states if 80e6 < s["time_us"] < 120e6]
    assert len(speeds) == 1999
    assert np.mean(speeds) == pytest.approx(1.30, rel=0.01)
