"""The vehicle's devices over the wire: their messages in a dive's log, by component id."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from ground.client import flight
from ground.simulation.processes import SimulatedVehicle, Simulation
from mavlink_io import dialect
from sitl.vehicle import config

pytestmark = pytest.mark.process

MISSION = """
name = "devices"

[[step]]
depth_m = 5.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 40.0

[[step]]
surface = true
"""


def logged(path: Path) -> dict[str, list[Any]]:
    """Return all messages by topic."""
    messages: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.topic.startswith("/mavlink/"):
                read = dialect.by_name(channel.topic.rsplit("/", 1)[1]).unpack(message.data)
                messages.setdefault(channel.topic, []).append(read)
    return messages


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """Fly a dive of the field vehicle with encoders at its duct."""
    folder = tmp_path_factory.mktemp("devices")
    vehicle, script = folder / "vehicle.toml", folder / "devices.toml"
    shipped = Path(config.__file__).with_name("caribou_truth.toml").read_text(encoding="utf-8")
    vehicle.write_text(shipped + '\n[instruments]\nencoder = "as5048"\n', encoding="utf-8")
    script.write_text(MISSION, encoding="utf-8")
    flown = flight.Dive.load(str(script), folder / "dive.mcap", parameters={"TRIM_RUD_DEG": 6.0})
    outcome = flight.fly_simulated(flown, SimulatedVehicle(Simulation(vehicle=str(vehicle))))
    assert outcome.lost_frames == 0
    return logged(flown.log)


def test_log_contains_dvl_velocity_over_ground(dive: dict[str, list[Any]]) -> None:
    messages = dive["/mavlink/1/197/ODOMETRY"]
    times_us = np.array([m.time_usec for m in messages])
    assert np.median(np.diff(times_us)) == 200_000
    cruise = [m.vx for m in messages[len(messages) // 2 : -20]]
    assert np.median(cruise) == pytest.approx(1.3, abs=0.15)
    assert {m.frame_id for m in messages} == {dialect.constant("MAV_FRAME_LOCAL_FRD")}
    assert all(np.isnan([m.x, m.y, m.z]).all() for m in messages)


def test_log_contains_discharging_battery(dive: dict[str, list[Any]]) -> None:
    messages = dive["/mavlink/1/1/BATTERY_STATUS"]
    assert "/mavlink/1/180/BATTERY_STATUS" not in dive
    consumed_mah = [m.current_consumed for m in messages]
    assert consumed_mah == sorted(consumed_mah)
    assert consumed_mah[-1] > 20
    assert 28_000 < messages[-1].voltages[0] < 33_600
    status = dive["/mavlink/1/1/SYS_STATUS"][-1]
    assert abs(status.voltage_battery - messages[-1].voltages[0]) < 500
    assert status.onboard_control_sensors_health_extended == dialect.constant(
        "MAV_SYS_STATUS_SENSOR_LEAK"
    )


def test_log_contains_measured_duct_deflection(dive: dict[str, list[Any]]) -> None:
    """The field vehicle's rudder is 6 deg off its command, of 15 deg of travel."""
    commanded = np.median(
        [m.actuator[0] for m in dive["/mavlink/1/1/ACTUATOR_OUTPUT_STATUS"][20:-20]]
    )
    measured = np.median(
        [m.actuator[0] for m in dive["/mavlink/1/140/ACTUATOR_OUTPUT_STATUS"][50:-50]]
    )
    assert 15.0 * (measured - commanded) == pytest.approx(-6.0, abs=0.6)


def test_altimeter_plus_depth_is_water_depth(dive: dict[str, list[Any]]) -> None:
    """In a pitched vehicle, the echo within the beam's half-width of 3 deg is slanted."""
    depths_m = {m.time_boot_ms: m.z for m in dive["/mavlink/1/1/LOCAL_POSITION_NED"]}
    slants_rad = {
        m.time_boot_ms: max(0.0, abs(m.pitch) - np.radians(3.0))
        for m in dive["/mavlink/1/1/ATTITUDE"]
    }
    messages = [m for m in dive["/mavlink/1/1/DISTANCE_SENSOR"] if m.signal_quality == 100]
    messages = [m for m in messages if m.time_boot_ms in depths_m and m.time_boot_ms in slants_rad]
    assert {(m.min_distance, m.max_distance) for m in messages} == {(30, 3000)}
    floors_m = [
        1e-2 * m.current_distance * np.cos(slants_rad[m.time_boot_ms]) + depths_m[m.time_boot_ms]
        for m in messages
    ]
    assert len(floors_m) > 100
    assert np.median(floors_m) == pytest.approx(20.0, abs=0.05)
