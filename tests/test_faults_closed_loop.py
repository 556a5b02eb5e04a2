"""Every fault of the catalogue during a dive: detection, messages, reaction and recovery."""

import math
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

from autopilot.control import core, modes, params, request_handler, requests
from autopilot.control.sensor_health import monitor
from autopilot.control.types import Event, Inputs, ItemReached
from mavlink_io.frames import euler_from_quaternion, rotate_back
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import plant
from sitl.faults.catalogue import CATALOGUE
from sitl.vehicle import config as vehicles

pytestmark = pytest.mark.slow
FAULT_START_S, END_S, SAMPLE_TICKS = 12.0, 42.0, 5
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
DETECTED = {
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
    "gyro wrong": "Gyro disagrees",
    "accelerometer wrong": "Accelerometer disagrees",
    "magnetometer wrong": "Magnetometer disagrees",
    "pressure wrong": "Pressure sensor implausible",
}
"""STATUSTEXT of each fault that is always detected.

A consistent error, or one within the noise, cannot be detected on the vehicle."""
MAYBE_DETECTED = {
    "gps intermittent": "GPS silent",
    "dvl intermittent": "DVL silent",
    "altimeter intermittent": "Altimeter silent",
    "encoder intermittent": "Duct silent",
    "rudder off": "Duct does not follow",
    "elevator off": "Duct does not follow",
}
"""STATUSTEXT of each fault whose detection depends on the outage time or the duct command."""
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
"""Name of each unit in STATUSTEXTs."""
ALL_FAULTS = [f"{unit} {kind}" for unit, kinds in CATALOGUE.items() for kind in kinds]
DEVICES = ("gps", "dvl", "altimeter", "battery", "leak", "encoder")
"""Units that no control loop needs: one dive tests each kind of fault on all of them at once."""
DURATION_S = {**dict.fromkeys(CATALOGUE, 8.0), **dict.fromkeys(DEVICES, 15.0)}
LONG_FAULTS = {
    "gyro off",
    "magnetometer off",
    "accelerometer off",
    "gyro garbage",
    *(f"{u} intermittent" for u in CATALOGUE),
}
LONG_S, REST_S, TAIL_REST_S = 15.0, 8.0, 16.0
"""Durations: of long faults, and without faults after one (longer after faults of SLOW_UNITS)."""
SLOW_UNITS = ("rudder", "elevator", "gyro")
"""Units after whose faults motion or attitude settle slowly."""
MISLEADING = ("wrong", "drifting")
"""Kinds tested last: the estimate needs minutes to recover from them."""


class Window(NamedTuple):
    """Start and end of a fault, and end of the time without faults after it."""

    from_s: float
    until_s: float
    recovered_s: float


def timetable(units: tuple[str, ...]) -> dict[str, Window]:
    """Return the time of each fault: one kind after the other, on all units that have it."""
    windows: dict[str, Window] = {}
    from_s, rest_s = FAULT_START_S, TAIL_REST_S if units[0] in SLOW_UNITS else REST_S
    kinds = dict.fromkeys(kind for unit in units for kind in CATALOGUE[unit])
    for kind in sorted(kinds, key=MISLEADING.__contains__):
        names = [f"{unit} {kind}" for unit in units if kind in CATALOGUE[unit]]
        until_s = from_s + max(
            LONG_S if name in LONG_FAULTS else DURATION_S[name.split()[0]] for name in names
        )
        windows |= dict.fromkeys(names, Window(from_s, until_s, until_s + rest_s))
        from_s = until_s + rest_s
    return windows


TIMETABLES = {unit: timetable(DEVICES if unit in DEVICES else (unit,)) for unit in CATALOGUE}


REPORT_ONLY = {"FS_LEAK_ACT": 0.0, "FS_PRESS_ACT": 0.0, "FS_BATT_ACT": 0.0, "FS_DIVE_S": 0.0}
"""Parameters with which the failsafes send a STATUSTEXT and take no action."""


class Voyage(NamedTuple):
    """History of a dive: columns by name at 10 Hz, events with time (s), final state."""

    columns: dict[str, Any]
    events: list[tuple[float, Event | ItemReached]]
    state: Any

    def between(self, name: str, from_s: float, until_s: float) -> Any:
        t_s = self.columns["t_s"]
        return self.columns[name][(t_s >= from_s) & (t_s < until_s)]

    def texts(self, from_s: float = 0.0, until_s: float = math.inf) -> list[str]:
        """Return the STATUSTEXTs of an interval except those on arming and modes."""
        texts = [
            event.text
            for t_s, event in self.events
            if from_s <= t_s < until_s and isinstance(event, Event)
        ]
        return [text for text in texts if not text.startswith(("Armed", "Mode"))]


def simulate(
    *faults: dict[str, Any],
    values: dict[str, float] | None = None,
    end_s: float = END_S,
    depth_m: float | None = 5.0,
) -> Voyage:
    """Return a dive with faults: depth 6 m, heading 10 deg, from 5 m heading north.

    With `depth_m` None the vehicle lies disarmed at the surface.
    """
    config = params.config(REPORT_ONLY if values is None else values)
    vehicle = vehicles.load("caribou_truth")
    vehicle = msgspec.structs.replace(
        vehicle, instruments=msgspec.structs.replace(vehicle.instruments, encoder="as5048")
    )
    calm = scenario.load("calm")
    start = msgspec.structs.replace(calm.start, depth_m=depth_m, speed_mps=1.2 if depth_m else 0.0)
    sea = plant.build(vehicle, msgspec.structs.replace(calm, start=start, fault=faults))
    rng = plant.random_streams(5)
    body, outputs = plant.initial_state(sea, rng)
    state, events, rows = core.initial_state(), [], []
    for tick in range(round(end_s * 50)):
        inputs = Inputs(
            outputs.frame,
            outputs.gps,
            outputs.altimeter,
            None,
            None,
            outputs.dvl,
            outputs.battery,
            outputs.leak,
            outputs.duct,
        )
        state, frame, trace, new_events = core.tick(state, inputs, config)
        events += [(tick * TICK_S, event) for event in new_events]
        if tick == 5 and depth_m:
            for request in (
                requests.SetMode(modes.DEPTH.number),
                requests.Arm(),
                requests.ChangeTarget(6.0, math.radians(10.0), 0.58),
            ):
                state, answer, _ = request_handler.handle_request(state, request, config)
                assert answer.result == 0, answer.text
        if tick % SAMPLE_TICKS == 0:
            rows.append(_row(tick, body, outputs, state, trace))
        body, outputs = plant.step(sea, body, frame, rng)
    names = rows[0].keys()
    return Voyage({name: np.array([row[name] for row in rows]) for name in names}, events, state)


def _row(tick: int, body: Any, outputs: Any, state: Any, trace: Any) -> dict[str, Any]:
    """Return one row of the history: truth, estimate, commands and faults."""
    truth, estimate = body.truth, state.estimate
    roll, pitch, heading = euler_from_quaternion(*truth.attitude_q)
    return {
        "t_s": tick * TICK_S,
        "roll": roll,
        "pitch": pitch,
        "heading": heading,
        "depth_m": truth.position_ned_m[2],
        "estimated_depth_m": estimate.depth_m,
        "estimated_heading": estimate.heading_rad,
        "rudder": truth.rudder_rad,
        "elevator": truth.elevator_rad,
        "rudder_command": trace.rudder_rad,
        "elevator_command": trace.elevator_rad,
        "rps": truth.propeller_rps,
        "rates": truth.rates_radps,
        "surge_mps": rotate_back(truth.attitude_q, truth.velocity_ned_mps)[0],
        "faults": "; ".join(truth.faults),
        "fresh": outputs.frame.fields_updated,
        "finite": all(
            map(
                math.isfinite,
                (
                    *estimate.attitude,
                    estimate.depth_m,
                    estimate.depth_rate_mps,
                    estimate.p_radps,
                    trace.rudder_rad,
                ),
            )
        ),
        "active_faults": "; ".join(monitor.active_faults(state.health)),
    }


def fault(
    name: str, from_s: float = FAULT_START_S, until_s: float = FAULT_START_S + 15.0
) -> dict[str, Any]:
    """Return a fault of the catalogue as a row of a scenario."""
    unit, kind = name.split()
    return {"unit": unit, "kind": kind, "at_s": from_s, "until_s": until_s, **SIZES.get(name, {})}


@pytest.fixture(scope="module")
def faultless() -> Voyage:
    """Dive without faults."""
    return simulate()


@pytest.fixture(scope="module")
def voyages() -> dict[str, Voyage]:
    """Dive with the faults of a unit, simulated at first use; DEVICES share one dive."""

    class Simulated(dict[str, Voyage]):
        def __missing__(self, unit: str) -> Voyage:
            windows = TIMETABLES[unit]
            rows = [fault(name, window.from_s, window.until_s) for name, window in windows.items()]
            voyage = simulate(*rows, end_s=max(window.recovered_s for window in windows.values()))
            self.update(dict.fromkeys(DEVICES if unit in DEVICES else (unit,), voyage))
            return voyage

    return Simulated()


def test_no_fault_sends_no_message(faultless: Voyage) -> None:
    assert faultless.texts() == []
    assert abs(faultless.columns["depth_m"][-1] - 6.0) < 0.3


@pytest.mark.parametrize("name", ALL_FAULTS)
def test_fault_is_in_ground_truth_and_vehicle_stays_armed(
    name: str, voyages: dict[str, Voyage]
) -> None:
    unit = name.split()[0]
    voyage, windows = voyages[unit], TIMETABLES[unit]
    window = windows[name]
    together = "; ".join(other for other, its in windows.items() if its == window)
    assert set(voyage.between("faults", window.from_s, window.until_s)) == {together}
    assert set(voyage.between("faults", window.until_s, window.recovered_s)) == {""}
    assert voyage.columns["finite"].all()
    assert voyage.state.armed
    assert abs(voyage.columns["pitch"]).max() < math.radians(75.0)


@pytest.mark.parametrize("name", ALL_FAULTS)
def test_detectable_fault_is_reported_once_and_cleared_once(
    name: str, voyages: dict[str, Voyage]
) -> None:
    unit = name.split()[0]
    voyage, windows = voyages[unit], TIMETABLES[unit]
    window = windows[name]
    subject = SUBJECT.get(unit, "nothing")
    simultaneous = tuple(
        SUBJECT[other.split()[0]]
        for other, its in windows.items()
        if its == window and other != name
    )
    reported = [
        text
        for text in voyage.texts(window.from_s, window.recovered_s)
        if not text.startswith(simultaneous)
    ]
    expected = DETECTED.get(name) or MAYBE_DETECTED.get(name)
    if expected is None or (name in MAYBE_DETECTED and not reported):
        assert reported == []
        return
    assert reported == [expected, f"{subject} recovered"]
    assert any(
        subject in active
        for active in voyage.between("active_faults", window.from_s, window.until_s)
    )
    assert subject not in voyage.between("active_faults", window.from_s, window.recovered_s)[-1]


def test_leak_with_failsafe_surfaces_and_disarms() -> None:
    voyage = simulate(fault("leak wet"), values={"FS_LEAK_ACT": 1.0}, end_s=100.0)
    assert "Failsafe: Leak detected -> SURFACE" in voyage.texts()
    assert "Surfaced: disarmed" in voyage.texts()
    severities = {
        event.text: event.severity for _, event in voyage.events if isinstance(event, Event)
    }
    assert severities["Leak detected"] == 0
    assert voyage.texts().count("Leak detected") == 1
    assert voyage.columns["depth_m"][-1] < 1.0


def test_pressure_lost_rises_unpowered_until_satellite_fix() -> None:
    voyage = simulate(fault("pressure off", until_s=500.0), values={}, end_s=240.0)
    assert "Failsafe: depth unknown -> SURFACE" in voyage.texts()
    assert voyage.texts()[-1] == "Surfaced by satellite fix: disarmed"
    t_s, rps = voyage.columns["t_s"], voyage.columns["rps"]
    assert (rps[t_s > FAULT_START_S + 6.0] == 0.0).all()
    assert voyage.columns["depth_m"][-1] < 0.5


def test_pressure_intermittent_does_not_end_the_dive() -> None:
    voyage = simulate(fault("pressure intermittent"), values={})
    assert voyage.state.armed
    assert not voyage.state.failsafe
    assert np.abs(voyage.columns["depth_m"][-50:] - 6.0).max() < 0.5


def test_all_sensors_intermittent_holds_depth_and_heading(faultless: Voyage) -> None:
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
    voyage = simulate(
        *(fault(f"{unit} intermittent") | {"share": 0.3} for unit in units), values={}
    )
    assert voyage.state.armed
    assert not voyage.state.failsafe
    assert np.abs(voyage.columns["depth_m"] - faultless.columns["depth_m"]).max() < 0.5
    assert np.degrees(np.abs(voyage.columns["heading"] - faultless.columns["heading"])).max() < 6.0


def test_pressure_garbage_after_silence_is_rejected() -> None:
    voyage = simulate(
        fault("pressure off", 12.0, 14.0),
        fault("pressure garbage", 15.0, 20.0),
        values={"FS_PRESS_S": 20.0},
    )
    assert not voyage.state.failsafe
    assert np.abs(voyage.columns["estimated_depth_m"] - voyage.columns["depth_m"]).max() < 2.0


@pytest.mark.parametrize(
    "name", ["gyro off", "magnetometer off", "accelerometer off", "gyro garbage"]
)
def test_attitude_sensor_lost_holds_heading_and_depth(
    name: str, voyages: dict[str, Voyage], faultless: Voyage
) -> None:
    voyage, (from_s, until_s, _) = voyages[name.split()[0]], TIMETABLES[name.split()[0]][name]
    steady_rad = faultless.columns["heading"][-1]
    assert np.degrees(np.abs(voyage.between("heading", from_s, until_s) - steady_rad)).max() < 4.0
    assert np.abs(voyage.between("depth_m", until_s - 5.0, until_s) - 6.0).max() < 0.6


def test_arm_with_faulty_sensor_is_refused_with_reason() -> None:
    voyage = simulate(fault("magnetometer stuck", 0.0, 100.0), depth_m=None, end_s=5.0)
    _, answer, _ = request_handler.handle_request(voyage.state, requests.Arm(), params.config({}))
    assert answer.text == "Not armed: Magnetometer stuck"


@pytest.mark.parametrize(
    ("kind", "message"),
    [("stuck", "GPS stuck"), ("garbage", "GPS implausible"), ("off", "GPS silent")],
)
def test_gps_fault_at_the_surface_is_reported_and_cleared(kind: str, message: str) -> None:
    voyage = simulate(
        {"unit": "gps", "kind": kind, "at_s": 5.0, "until_s": 18.0}, depth_m=None, end_s=25.0
    )
    assert voyage.texts() == [message, "GPS recovered"]


def test_fault_same_seed_is_repeatable_without_side_effects(faultless: Voyage) -> None:
    first, second = (simulate(fault("dvl intermittent"), end_s=20.0) for _ in range(2))
    for name in ("roll", "depth_m", "heading"):
        assert (first.columns[name] == second.columns[name]).all()
        assert (first.columns[name] == faultless.columns[name][: len(first.columns[name])]).all()
