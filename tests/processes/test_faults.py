"""Faults in real processes: a scenario with every kind in one dive, and injection by a client."""

import json
import signal
import socket
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.reader import make_reader

from ground.client import flight
from mavlink_io import dialect
from sitl.faults.catalogue import CATALOGUE
from sitl.vehicle import config
from tests.helpers.subprocesses import (
    Finished,
    autopilot,
    free_port,
    on_one_core,
    process,
)

pytestmark = pytest.mark.process

CLIENT = Path(__file__).parents[1] / "clients" / "mavsdk_failures.py"
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
EVERY = [
    *(
        f"{unit} {list(kinds)[at]}"
        for at in range(LONGEST)
        for unit, kinds in CATALOGUE.items()
        if at < len(kinds) and unit != "link"
    ),
    "link off",
]
"""Faults in turns, so that a unit recovers before its next fault.

Texts during the link's silence are lost.
"""
FIRST_S, APART_S, LASTING_S = 5.0, 0.9, 1.6
TELL_ONLY = {
    "FS_LEAK_ACT": 0.0,
    "FS_PRESS_ACT": 0.0,
    "FS_BATT_ACT": 0.0,
    "FS_DIVE_S": 0.0,
    "FS_LOOK_S": 0.0,
    "TRIM_RUD_DEG": 6.0,
}


def scenario_of_every_fault(file: Path) -> None:
    """One fault after the other, at most two at a time."""
    rows = ['title = "everything"\n[start]\ndepth_m = 4.0\n']
    for number, name in enumerate(EVERY):
        unit, kind = name.split()
        at_s = FIRST_S + APART_S * number + (LASTING_S if name == "link off" else 0.0)
        rows.append(
            f'[[fault]]\nunit = "{unit}"\nkind = "{kind}"\nat_s = {at_s}\nuntil_s ='
            f" {at_s + LASTING_S}\n"
        )
        rows += [f"{key} = {value}\n" for key, value in SIZES.get(name, {}).items()]
    file.write_text("".join(rows), encoding="utf-8")


def texts(log: Path, component: int) -> list[str]:
    """Return the STATUSTEXTs of a component in the log."""
    with log.open("rb") as file:
        return [
            dialect.by_name("STATUSTEXT").unpack(message.data).text
            for _, channel, message in make_reader(file).iter_messages()
            if channel.topic == f"/mavlink/1/{component}/STATUSTEXT"
        ]


class Dive(NamedTuple):
    flown: flight.FlightResult
    truth: Path
    received_texts: list[str]
    """Texts that the stock client received, beside the program that flew the vehicle."""


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> Dive:
    """Fly one dive with every fault at full speed, recorded by ground and by a MAVSDK program."""
    folder = tmp_path_factory.mktemp("dive")
    sea, script, vehicle, truth = (
        folder / name for name in ("sea.toml", "faults.toml", "vehicle.toml", "truth.mcap")
    )
    scenario_of_every_fault(sea)
    shipped = Path(config.__file__).with_name("caribou_truth.toml").read_text(encoding="utf-8")
    vehicle.write_text(shipped + '\n[instruments]\nencoder = "as5048"\n', encoding="utf-8")
    script.write_text(
        MISSION.format(duration_s=FIRST_S + APART_S * len(EVERY) + 2.0 * LASTING_S),
        encoding="utf-8",
    )
    hil, ground, beside = free_port(), free_port(socket.SOCK_STREAM), free_port(socket.SOCK_STREAM)
    simulator = (
        "--hil",
        f"udpout:127.0.0.1:{hil}",
        "--speed",
        "max",
        "--wait-for-arm",
        "--truth",
        str(truth),
    )
    with (
        autopilot(
            f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{ground}", f"tcpin:127.0.0.1:{beside}"
        ) as steering,
        process(
            "-m", "sitl", *simulator, "--vehicle", str(vehicle), "--scenario", str(sea)
        ) as simulated,
        on_one_core(steering, simulated),
        process(str(CLIENT), f"tcpout://127.0.0.1:{beside}", "listen") as listener,
    ):
        listener.read_until("listening")
        event_texts = flight.Dive.load(str(script), folder / "dive.mcap", parameters=TELL_ONLY)
        flown = flight.fly(event_texts, f"tcp:127.0.0.1:{ground}")
        finished = listener.finish()
        simulated.signal(signal.SIGTERM)
        simulated.finish()
    assert finished.status == 0, finished.stderr
    return Dive(flown, truth, json.loads(finished.stdout.splitlines()[-1])["texts"])


def every_fault(texts: list[str], prefix: str) -> list[str]:
    """Return the faults in the texts, in order."""
    return [text.removeprefix(prefix) for text in texts if text.startswith(prefix)]


def test_client_receives_start_and_end_of_each_fault(dive: Dive) -> None:
    assert every_fault(dive.received_texts, "Fault: ") == EVERY
    assert every_fault(dive.received_texts, "Fault over: ") == EVERY
    assert {
        "Gyro silent",
        "Magnetometer stuck",
        "Pressure sensor implausible",
        "Leak detected",
    } <= set(dive.received_texts)
    assert dive.received_texts[-1] == "Surfaced: disarmed"


def test_log_contains_faults_and_detections(dive: Dive) -> None:
    event_texts = texts(dive.flown.log, 25)
    assert every_fault(event_texts, "Fault: ") == every_fault(event_texts, "Fault over: ") == EVERY
    assert {"Gyro recovered", "Accelerometer silent", "Leak recovered"} <= set(
        texts(dive.flown.log, 1)
    )
    assert dive.flown.failsafes == ()


def test_truth_log_contains_every_fault(dive: Dive) -> None:
    with dive.truth.open("rb") as file:
        seen = {
            name
            for _, _, message in make_reader(file).iter_messages()
            for name in json.loads(message.data)["faults"]
        }
    assert seen == set(EVERY)


def client(*plan: str, ground: int) -> Finished:
    with process(str(CLIENT), f"udpin://127.0.0.1:{ground}", *plan) as running:
        return running.finish()


def test_client_injects_and_clears_faults() -> None:
    hil, ground = free_port(), free_port()
    with (
        autopilot(f"udpin:127.0.0.1:{hil}", f"udpout:127.0.0.1:{ground}") as steering,
        process(
            "-m", "sitl", "--hil", f"udpout:127.0.0.1:{hil}", "--speed", "4", "--seed", "1"
        ) as simulated,
        on_one_core(steering, simulated),
    ):
        finished = client("simulated", ground=ground)
    assert finished.status == 0, finished.stderr
    seen: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    assert seen["while_off"] == "DENIED"
    assert set(seen["ordered"].values()) == {"SUCCESS"}
    assert seen["unsupported"] == "UNSUPPORTED"
    for name in (
        "gyro off",
        "magnetometer stuck",
        "rudder stuck",
        "propeller off",
        "gps off",
        "link off",
    ):
        assert f"Fault: {name}" in seen["texts"]
        assert f"Fault over: {name}" in seen["texts"]
    assert "Gyro silent" in seen["texts"]
    assert "Magnetometer stuck" in seen["texts"]
    assert seen["healthy_while_broken"] == {
        "gyro": False,
        "magnetometer": False,
        "accelerometer": True,
    }
    assert seen["healthy_when_mended"] == {
        "gyro": True,
        "magnetometer": True,
        "accelerometer": True,
    }
    assert seen["longest_silence_s"] > 2.0
    assert seen["back"]


def test_injection_without_simulator_is_refused() -> None:
    hil, ground = free_port(), free_port()
    with autopilot(f"udpin:127.0.0.1:{hil}", f"udpout:127.0.0.1:{ground}"):
        finished = client("real", ground=ground)
    assert finished.status == 0, finished.stderr
    seen: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    assert seen["real"] == "UNSUPPORTED"
    assert "Failure refused: no simulator answers" in seen["texts"]
