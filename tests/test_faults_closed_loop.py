"""Every fault that can be, in a dive under way: what she finds out, what she does, and that she
lives through it."""

import math
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

from autopilot.control import core, modes, params, request_handler, requests
from autopilot.control.sensor_health import monitor
from autopilot.control.types import Event, Inputs, ItemReached
from mavlink_io.frames import euler_from_quaternion, rotate_back
from sitl import scenario
from sitl.core import plant, timestep
from sitl.faults.catalogue import CATALOGUE
from sitl.vehicle import config as vehicles

FROM_S, END_S, SAMPLE_TICKS = 12.0, 42.0, 5
SIZES: dict[str, dict[str, float]] = {
    "rudder stuck": {"angle_deg": 15.0},
    "elevator stuck": {"angle_deg": 15.0},
    "rudder slow": {"rate_degps": 0.5},
    "elevator slow": {"rate_degps": 0.2},
    "rudder slipping": {"share": 0.8},
    "elevator slipping": {"share": 0.8},
    "gps slow": {"period_s": 5.0},
    "dvl slow": {"period_s": 5.0},
    "altimeter slow": {"period_s": 5.0},
    "encoder slow": {"period_s": 5.0},
    "encoder wrong": {"offset_pct": 90.0},
    "ballast added": {"mass_kg": 5.0, "x_m": 0.5, "y_m": 0.1},
    "ballast shifted": {"mass_kg": 5.0, "y_m": 0.2},
}
TOLD = {
    **{
        f"{unit} {kind}": f"{name} {what}"
        for unit, name in (
            ("gyro", "Gyro"),
            ("accelerometer", "Accelerometer"),
            ("magnetometer", "Magnetometer"),
            ("pressure", "Pressure sensor"),
        )
        for kind, what in (
            ("off", "silent"),
            ("stuck", "stuck"),
            ("garbage", "implausible"),
            ("slow", "silent"),
            ("delayed", "silent"),
            ("intermittent", "silent"),
        )
    },
    **{
        f"{unit} {kind}": f"{name} {what}"
        for unit, name in (("dvl", "DVL"), ("altimeter", "Altimeter"))
        for kind, what in (
            ("off", "silent"),
            ("stuck", "stuck"),
            ("garbage", "implausible"),
            ("slow", "silent"),
        )
    },
    "gps off": "GPS silent",
    "gps slow": "GPS silent",
    "battery off": "Battery silent",
    "battery garbage": "Battery implausible",
    "encoder off": "Duct silent",
    "encoder slow": "Duct silent",
    "encoder wrong": "Duct does not follow",
    "encoder garbage": "Duct does not follow",
    "rudder stuck": "Duct does not follow",
    "elevator stuck": "Duct does not follow",
    "leak wet": "Leak detected",
}
"""What she finds out by herself; a consistent lie, and what stays within the noise, nobody can tell
on board."""
PERHAPS = {
    "gps intermittent": "GPS silent",
    "dvl intermittent": "DVL silent",
    "altimeter intermittent": "Altimeter silent",
    "encoder intermittent": "Duct silent",
    "rudder off": "Duct does not follow",
    "elevator off": "Duct does not follow",
}
"""What she may find out, by how long an outage lasts or how much duct was asked for."""
SUBJECT = {
    "gyro": "Gyro",
    "accelerometer": "Accelerometer",
    "magnetometer": "Magnetometer",
    "pressure": "Pressure sensor",
    "gps": "GPS",
    "dvl": "DVL",
    "altimeter": "Altimeter",
    "battery": "Battery",
    "leak": "Leak",
    "encoder": "Duct",
    "rudder": "Duct",
    "elevator": "Duct",
}
EVERY = [f"{unit} {kind}" for unit, kinds in CATALOGUE.items() for kind in kinds]
DEVICES = ("gps", "dvl", "altimeter", "battery", "leak", "encoder")
"""No loop leans on these: their faults share one voyage, each kind on all of them at once."""
LASTING_S = {**dict.fromkeys(CATALOGUE, 8.0), **dict.fromkeys(DEVICES, 15.0)}
LONG = {
    "gyro off",
    "magnetometer off",
    "accelerometer off",
    "gyro garbage",
    *(f"{u} intermittent" for u in CATALOGUE),
}
LONG_S, REST_S, TAIL_REST_S = 15.0, 8.0, 16.0
"""A tail that was astray swings for a while after it is mended."""
MISLEADING = ("wrong", "drifting")
"""Last of all: they leave the estimate where it takes minutes to come back from."""


class Window(NamedTuple):
    """When a fault of a voyage lasts, and until when nothing else happens after it."""

    from_s: float
    until_s: float
    rested_s: float


def timetable(units: tuple[str, ...]) -> dict[str, Window]:
    """One kind of fault after the other, each on all of the units that know it."""
    windows: dict[str, Window] = {}
    from_s, rest_s = FROM_S, TAIL_REST_S if units[0] in ("rudder", "elevator") else REST_S
    kinds = dict.fromkeys(kind for unit in units for kind in CATALOGUE[unit])
    for kind in sorted(kinds, key=MISLEADING.__contains__):
        names = [f"{unit} {kind}" for unit in units if kind in CATALOGUE[unit]]
        until_s = from_s + max(
            LONG_S if name in LONG else LASTING_S[name.split()[0]] for name in names
        )
        windows |= dict.fromkeys(names, Window(from_s, until_s, until_s + rest_s))
        from_s = until_s + rest_s
    return windows


TIMETABLES = {unit: timetable(DEVICES if unit in DEVICES else (unit,)) for unit in CATALOGUE}


TELL_ONLY = {"FS_LEAK_ACT": 0.0, "FS_PRESS_ACT": 0.0, "FS_BATT_ACT": 0.0}


class Voyage(NamedTuple):
    columns: dict[str, Any]
    events: list[tuple[float, Event | ItemReached]]
    state: Any

    def between(self, name: str, from_s: float, until_s: float) -> Any:
        t_s = self.columns["t_s"]
        return self.columns[name][(t_s >= from_s) & (t_s < until_s)]

    def texts(self, from_s: float = 0.0, until_s: float = math.inf) -> list[str]:
        """What she complained of and took back, and what she did."""
        texts = [
            event.text
            for t_s, event in self.events
            if from_s <= t_s < until_s and isinstance(event, Event)
        ]
        return [text for text in texts if not text.startswith(("Armed", "Mode"))]


def sail(
    *rows: dict[str, Any],
    values: dict[str, float] | None = None,
    end_s: float = END_S,
    depth_m: float | None = 5.0,
) -> Voyage:
    """Hold depth 6 m and heading 10 deg under way, from 5 m and north; or lie at the surface,
    disarmed."""
    config = params.config(TELL_ONLY if values is None else values)
    vehicle = vehicles.load("caribou_truth")
    vehicle = msgspec.structs.replace(
        vehicle, instruments=msgspec.structs.replace(vehicle.instruments, encoder="as5048")
    )
    calm = scenario.load("calm")
    start = msgspec.structs.replace(calm.start, depth_m=depth_m, speed_mps=1.2 if depth_m else 0.0)
    sea = plant.build(vehicle, msgspec.structs.replace(calm, start=start, fault=rows))
    rng = plant.random_streams(5)
    body, said = plant.initial_state(sea, rng)
    state, events, told = core.initial_state(), [], []
    for tick in range(round(end_s * 50)):
        inputs = Inputs(
            said.frame,
            said.gps,
            said.altimeter,
            None,
            None,
            said.dvl,
            said.battery,
            said.leak,
            said.duct,
        )
        state, frame, trace, heard = core.tick(state, inputs, config)
        events += [(tick * timestep.TICK_S, event) for event in heard]
        if tick == 5 and depth_m:
            for wish in (
                requests.SetMode(modes.DEPTH.number),
                requests.Arm(),
                requests.ChangeTarget(6.0, math.radians(10.0), 0.58),
            ):
                state, answer, _ = request_handler.handle_request(state, wish, config)
                assert answer.result == 0, answer.text
        if tick % SAMPLE_TICKS == 0:
            told.append(_told(tick, body, said, state, trace))
        body, said = plant.step(sea, body, frame, rng)
    names = told[0].keys()
    return Voyage({name: np.array([row[name] for row in told]) for name in names}, events, state)


def _told(tick: int, body: Any, said: Any, state: Any, trace: Any) -> dict[str, Any]:
    truth, at = body.truth, state.estimate
    roll, pitch, heading = euler_from_quaternion(*truth.attitude_q)
    return {
        "t_s": tick * timestep.TICK_S,
        "roll": roll,
        "pitch": pitch,
        "heading": heading,
        "depth_m": truth.position_ned_m[2],
        "seen_depth_m": at.depth_m,
        "seen_heading": at.heading_rad,
        "rudder": truth.rudder_rad,
        "elevator": truth.elevator_rad,
        "asked_rudder": trace.rudder_rad,
        "asked_elevator": trace.elevator_rad,
        "rps": truth.propeller_rps,
        "rates": truth.rates_radps,
        "surge_mps": rotate_back(truth.attitude_q, truth.velocity_ned_mps)[0],
        "faults": "; ".join(truth.faults),
        "fresh": said.frame.fields_updated,
        "finite": all(
            map(
                math.isfinite,
                (*at.attitude, at.depth_m, at.depth_rate_mps, at.p_radps, trace.rudder_rad),
            )
        ),
        "wrong": "; ".join(monitor.active_faults(state.health)),
    }


def fault(name: str, from_s: float = FROM_S, until_s: float = FROM_S + 15.0) -> dict[str, Any]:
    unit, kind = name.split()
    return {"unit": unit, "kind": kind, "at_s": from_s, "until_s": until_s, **SIZES.get(name, {})}


@pytest.fixture(scope="module")
def sound() -> Voyage:
    return sail()


@pytest.fixture(scope="module")
def voyages() -> dict[str, Voyage]:
    """The voyage of every unit's faults, sailed when first asked for; the devices share one."""

    class Sailed(dict[str, Voyage]):
        def __missing__(self, unit: str) -> Voyage:
            windows = TIMETABLES[unit]
            rows = [fault(name, window.from_s, window.until_s) for name, window in windows.items()]
            voyage = sail(*rows, end_s=max(window.rested_s for window in windows.values()))
            self.update(dict.fromkeys(DEVICES if unit in DEVICES else (unit,), voyage))
            return voyage

    return Sailed()


def test_a_sound_vehicle_complains_of_nothing(sound: Voyage) -> None:
    assert sound.texts() == []
    assert abs(sound.columns["depth_m"][-1] - 6.0) < 0.3


@pytest.mark.parametrize("name", EVERY)
def test_the_truth_tells_the_fault_and_the_vehicle_lives_through_it(
    name: str, voyages: dict[str, Voyage]
) -> None:
    unit = name.split()[0]
    voyage, windows = voyages[unit], TIMETABLES[unit]
    window = windows[name]
    together = "; ".join(other for other, its in windows.items() if its == window)
    assert set(voyage.between("faults", window.from_s, window.until_s)) == {together}
    assert set(voyage.between("faults", window.until_s, window.rested_s)) == {""}
    assert voyage.columns["finite"].all()
    assert voyage.state.armed
    assert abs(voyage.columns["pitch"]).max() < math.radians(75.0)


@pytest.mark.parametrize("name", EVERY)
def test_what_can_be_found_out_is_told_once_and_taken_back_once(
    name: str, voyages: dict[str, Voyage]
) -> None:
    unit = name.split()[0]
    voyage, windows = voyages[unit], TIMETABLES[unit]
    window = windows[name]
    subject = SUBJECT.get(unit, "nothing")
    neighbours = tuple(
        SUBJECT[other.split()[0]]
        for other, its in windows.items()
        if its == window and other != name
    )
    told = [
        text
        for text in voyage.texts(window.from_s, window.rested_s)
        if not text.startswith(neighbours)
    ]
    wanted = TOLD.get(name) or PERHAPS.get(name)
    if wanted is None or (name in PERHAPS and not told):
        assert told == []
        return
    assert told == [wanted, f"{subject} recovered"]
    assert any(subject in wrong for wrong in voyage.between("wrong", window.from_s, window.until_s))
    assert subject not in voyage.between("wrong", window.from_s, window.rested_s)[-1]


def test_a_leak_brings_her_up() -> None:
    voyage = sail(fault("leak wet"), values={"FS_LEAK_ACT": 1.0}, end_s=70.0)
    assert "Failsafe: Leak detected -> SURFACE" in voyage.texts()
    assert "Surfaced: disarmed" in voyage.texts()
    severities = {
        event.text: event.severity for _, event in voyage.events if isinstance(event, Event)
    }
    assert severities["Leak detected"] == 0
    assert voyage.texts().count("Leak detected") == 1
    assert voyage.columns["depth_m"][-1] < 1.0


def test_without_a_pressure_sensor_she_stops_and_rises_till_a_satellite_is_seen() -> None:
    voyage = sail(fault("pressure off", until_s=500.0), values={}, end_s=240.0)
    assert "Failsafe: depth unknown -> SURFACE" in voyage.texts()
    assert voyage.texts()[-1] == "Surfaced by satellite fix: disarmed"
    t_s, rps = voyage.columns["t_s"], voyage.columns["rps"]
    assert (rps[t_s > FROM_S + 6.0] == 0.0).all()
    assert voyage.columns["depth_m"][-1] < 0.5


def test_short_gaps_of_the_pressure_sensor_do_not_end_a_dive() -> None:
    voyage = sail(fault("pressure intermittent"), values={})
    assert voyage.state.armed
    assert not voyage.state.failsafe
    assert np.abs(voyage.columns["depth_m"][-50:] - 6.0).max() < 0.5


def test_a_dive_survives_every_sensor_coming_and_going_at_once(sound: Voyage) -> None:
    units = (
        "gyro",
        "accelerometer",
        "magnetometer",
        "pressure",
        "gps",
        "dvl",
        "altimeter",
        "battery",
        "encoder",
    )
    voyage = sail(*(fault(f"{unit} intermittent") | {"share": 0.3} for unit in units), values={})
    assert voyage.state.armed
    assert not voyage.state.failsafe
    assert np.abs(voyage.columns["depth_m"] - sound.columns["depth_m"]).max() < 0.5
    assert np.degrees(np.abs(voyage.columns["heading"] - sound.columns["heading"])).max() < 6.0


def test_a_sensor_that_was_silent_is_not_believed_when_it_returns_with_nonsense() -> None:
    voyage = sail(
        fault("pressure off", 12.0, 14.0),
        fault("pressure garbage", 15.0, 20.0),
        values={"FS_PRESS_S": 20.0},
    )
    assert not voyage.state.failsafe
    assert np.abs(voyage.columns["seen_depth_m"] - voyage.columns["depth_m"]).max() < 2.0


@pytest.mark.parametrize(
    "name", ["gyro off", "magnetometer off", "accelerometer off", "gyro garbage"]
)
def test_she_steers_on_with_what_is_left_of_her_attitude_sensors(
    name: str, voyages: dict[str, Voyage], sound: Voyage
) -> None:
    voyage, (from_s, until_s, _) = voyages[name.split()[0]], TIMETABLES[name.split()[0]][name]
    steady_rad = sound.columns["heading"][-1]
    assert np.degrees(np.abs(voyage.between("heading", from_s, until_s) - steady_rad)).max() < 4.0
    assert np.abs(voyage.between("depth_m", until_s - 5.0, until_s) - 6.0).max() < 0.6


def test_a_faulty_vehicle_refuses_to_be_armed_and_says_why() -> None:
    voyage = sail(fault("magnetometer stuck", 0.0, 100.0), depth_m=None, end_s=5.0)
    _, answer, _ = request_handler.handle_request(voyage.state, requests.Arm(), params.config({}))
    assert answer.text == "Not armed: Magnetometer stuck"


@pytest.mark.parametrize(
    ("kind", "told"),
    [("stuck", "GPS stuck"), ("garbage", "GPS implausible"), ("off", "GPS silent")],
)
def test_satellite_fixes_are_judged_at_the_surface(kind: str, told: str) -> None:
    voyage = sail(
        {"unit": "gps", "kind": kind, "at_s": 5.0, "until_s": 18.0}, depth_m=None, end_s=25.0
    )
    assert voyage.texts() == [told, "GPS recovered"]


def test_the_same_seed_breaks_the_same_way_and_other_streams_are_left_alone(sound: Voyage) -> None:
    first, second = (sail(fault("dvl intermittent"), end_s=20.0) for _ in range(2))
    for name in ("roll", "depth_m", "heading"):
        assert (first.columns[name] == second.columns[name]).all()
        assert (first.columns[name] == sound.columns[name][: len(first.columns[name])]).all()
