"""The plant as plain Python, without numba: the same bytes as from machine code."""

import os
import subprocess
import sys

import pytest
from msgspec.structs import replace

from mavlink_io.records import ActuatorFrame
from sitl import scenario
from sitl.core import plant
from sitl.scenario import Scenario
from sitl.vehicle import config

TICKS = 60
PRINT = """
import sys
import tests.sitl.core.test_plain_python as this
sys.stdout.write(this.flown("caribou_truth", this.FAULTY) + this.flown("xfin_auv", this.SWELL))
"""
SWELL = replace(scenario.load("swell"), rig=scenario.Rig(encoder="as5048"))
FAULTY = Scenario(
    start=scenario.StartTable(depth_m=3.0, speed_mps=1.0),
    disturbance=scenario.load("disturbed").disturbance,
    fault=(
        {"at_s": 0.2, "unit": "rudder", "kind": "slipping"},
        {"at_s": 0.3, "unit": "propeller", "kind": "loss"},
        {"at_s": 0.4, "unit": "gyro", "kind": "garbage"},
    ),
)


def flown(vehicle: str, sea: Scenario) -> str:
    """Return state, true motion and sensors of some ticks as text with all digits."""
    simulated, rng = plant.build(config.load(vehicle), sea), plant.random_streams(7)
    state, sensors = plant.initial_state(simulated, rng)
    lines = []
    for tick in range(TICKS):
        controls = (0.9 if tick % 20 < 10 else -0.9, 0.4, 0.58)
        state, sensors = plant.step(simulated, state, ActuatorFrame(0, 1, controls, 129), rng)
        numbers = [*state.values.tolist(), *state.truth.position_ned_m, *sensors.frame]
        lines.append(" ".join(float(number).hex() for number in numbers) + repr(sensors[1:]))
    return "\n".join(lines)


@pytest.mark.process
def test_plant_without_numba_gives_same_bytes() -> None:
    printed = [
        subprocess.run(
            [sys.executable, "-c", PRINT],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            check=True,
            capture_output=True,
        ).stdout
        for disabled in ("0", "1")
    ]
    assert len(printed[0]) > 1000 * TICKS
    assert printed[0] == printed[1]
