"""Trims from the log of a straight mission: the limit is the travel of the log's vehicle."""

from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as mavlink

from ground.campaign import refit
from mavlink_io.errors import OperationError
from mavlink_io.vehicle_modes import VehicleMode
from tests.sysid import recording
from tests.sysid.data.test_dataset import actuators, attitude, position

SURFACED_S = 10.0


def mission(path: Path, travel_deg: float, rudder: float, since_s: float = 0.0) -> Path:
    """Write a mission with a constant rudder (fraction of the travel) that ends by surfacing."""
    entries = []
    for k in range(600):
        t = k / 50
        entries += [attitude(t, 0.0, 0.0), position(t, 5.0)]
        if t >= since_s:
            entries.append(actuators(t, rudder, 0.1))
    for t, mode in ((0.0, VehicleMode.MISSION), (SURFACED_S, VehicleMode.SURFACE)):
        entries.append((t, mavlink.MAVLink_heartbeat_message(12, 0, 129, mode, 4, 3)))
    entries.sort(key=lambda entry: entry[0])
    return recording.write(path, entries, {"ACT_TRAVEL_DEG": travel_deg})


def test_trim_within_a_large_travel_is_accepted(tmp_path: Path) -> None:
    trims = refit.measure_trims(mission(tmp_path / "trim.mcap", 25.0, 0.7), 5.0)
    assert trims == {"TRIM_RUD_DEG": 17.5, "TRIM_ELE_DEG": 2.5}


def test_trim_at_the_travel_is_refused(tmp_path: Path) -> None:
    path = mission(tmp_path / "trim.mcap", 9.0, 1.0)
    with pytest.raises(
        OperationError, match=r"TRIM_RUD_DEG would be 9\.0 deg, at or beyond .* travel of 9 deg"
    ):
        refit.measure_trims(path, 5.0)


@pytest.mark.filterwarnings("error")
def test_trim_without_commands_is_refused(tmp_path: Path) -> None:
    path = mission(tmp_path / "trim.mcap", 9.0, 0.1, since_s=SURFACED_S + 0.5)
    with pytest.raises(OperationError, match="has no commands in the last 5 s before"):
        refit.measure_trims(path, 5.0)
