"""Faults through real processes: a scenario of every kind in one dive, and a stock client that orders its own."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from ground import flight
from ground.processes import SimulatedVehicle, Simulation
from link import dialect
from sitl.faults.catalogue import CATALOGUE
from sitl.vehicle import config
from tests.processes.fleet import Finished, autopilot, free_port, process

pytestmark = pytest.mark.process

CLIENT = Path(__file__).with_name("mavsdk_failure_client.py")
MISSION = """
name = "faults"

[[step]]
depth_m = 5.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = {duration_s}

[[step]]
surface = true
"""
SIZES = {
    "ballast added": {"mass_kg": 1.0, "y_m": 0.05},
    "ballast shifted": {"mass_kg": 1.0, "y_m": 0.05},
    "elevator stuck": {"angle_deg": 1.0},
    "elevator biased": {"angle_deg": 1.0},
    "elevator slow": {"rate_degps": 5.0},
}
LONGEST = max(len(kinds) for kinds in CATALOGUE.values())
EVERY = [f"{unit} {list(kinds)[at]}" for at in range(LONGEST) for unit, kinds in CATALOGUE.items() if at < len(kinds)]
"""In turns, so that a unit has recovered when its next fault comes."""
FIRST_S, APART_S, LASTING_S = 30.0, 3.0, 2.0
TELL_ONLY = {"FS_LEAK_ACT": 0.0, "FS_PRESS_ACT": 0.0, "FS_BATT_ACT": 0.0, "TRIM_RUD_DEG": 6.0}


def scenario_of_every_fault(file: Path) -> None:
    """One fault after the other, each over before the next begins."""
    rows = ['title = "everything"\n[start]\ndepth_m = 4.0\n']
    for number, name in enumerate(EVERY):
        unit, kind = name.split()
        at_s = FIRST_S + APART_S * number
        rows.append(f'[[fault]]\nunit = "{unit}"\nkind = "{kind}"\nat_s = {at_s}\nuntil_s = {at_s + LASTING_S}\n')
        rows += [f"{key} = {value}\n" for key, value in SIZES.get(name, {}).items()]
    file.write_text("".join(rows), encoding="utf-8")


def texts(log: Path, component: int) -> list[str]:
    """The STATUSTEXTs of a component, as the log holds them."""
    with log.open("rb") as file:
        return [
            dialect.by_name("STATUSTEXT").unpack(message.data).text
            for _, channel, message in make_reader(file).iter_messages()
            if channel.topic == f"/mavlink/1/{component}/STATUSTEXT"
        ]


def test_one_dive_through_every_fault_shows_each_in_its_log_and_in_its_truth(tmp_path: Path) -> None:
    sea, script, vehicle = tmp_path / "sea.toml", tmp_path / "faults.toml", tmp_path / "vehicle.toml"
    scenario_of_every_fault(sea)
    shipped = Path(config.__file__).with_name("field.toml").read_text(encoding="utf-8")
    vehicle.write_text(shipped + '\n[instruments]\nencoder = "as5048"\n', encoding="utf-8")
    script.write_text(MISSION.format(duration_s=FIRST_S + APART_S * len(EVERY)), encoding="utf-8")
    flown = flight.Dive.load(str(script), tmp_path / "dive.mcap", parameters=TELL_ONLY)
    truth = tmp_path / "truth.mcap"
    outcome = flight.fly_simulated(
        flown, SimulatedVehicle(Simulation(vehicle=str(vehicle), scenario=str(sea), truth=truth))
    )
    assert outcome.failsafes == ()
    told = texts(flown.log, 25)
    assert told == [text for name in EVERY for text in (f"Fault: {name}", f"Fault over: {name}")]
    found = texts(flown.log, 1)
    for text in (
        "Gyro silent",
        "Magnetometer stuck",
        "Pressure sensor implausible",
        "Accelerometer silent",
        "Leak detected",
    ):
        assert text in found
    with truth.open("rb") as file:
        seen = {
            name for _, _, message in make_reader(file).iter_messages() for name in json.loads(message.data)["faults"]
        }
    assert seen == set(EVERY)


def client(*plan: str, ground: int) -> Finished:
    with process(str(CLIENT), f"udpin://127.0.0.1:{ground}", *plan) as running:
        return running.finish()


def test_a_stock_client_breaks_and_mends_what_it_likes_and_reads_what_became_of_it() -> None:
    hil, ground = free_port(), free_port()
    with (
        autopilot(f"udpin:127.0.0.1:{hil}", f"udpout:127.0.0.1:{ground}"),
        process("-m", "sitl", "--hil", f"udpout:127.0.0.1:{hil}", "--speed", "2", "--seed", "1"),
    ):
        finished = client("simulated", ground=ground)
    assert finished.status == 0, finished.stderr
    seen: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    assert seen["while_off"] == "DENIED"
    assert set(seen["ordered"].values()) == {"SUCCESS"}
    assert seen["unsupported"] == "UNSUPPORTED"
    for name in ("gyro off", "magnetometer stuck", "rudder stuck", "propeller off", "gps off", "link off"):
        assert f"Fault: {name}" in seen["texts"]
        assert f"Fault over: {name}" in seen["texts"]
    assert "Gyro silent" in seen["texts"]
    assert "Magnetometer stuck" in seen["texts"]
    assert seen["healthy_while_broken"] == {"gyro": False, "magnetometer": False, "accelerometer": True}
    assert seen["healthy_when_mended"] == {"gyro": True, "magnetometer": True, "accelerometer": True}
    assert seen["longest_silence_s"] > 2.0
    assert seen["back"]


def test_a_vehicle_without_a_simulator_breaks_nothing() -> None:
    hil, ground = free_port(), free_port()
    with autopilot(f"udpin:127.0.0.1:{hil}", f"udpout:127.0.0.1:{ground}"):
        finished = client("real", ground=ground)
    assert finished.status == 0, finished.stderr
    seen: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    assert seen["real"] == "UNSUPPORTED"
    assert "Failure refused: no simulator answers" in seen["texts"]
