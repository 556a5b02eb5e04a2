"""Mode SURFACE in the water with a faulty elevator or pressure sensor, above a sea floor."""

from typing import Any, NamedTuple

import msgspec

from autopilot.control import core, modes, params, request_handler, requests
from autopilot.control.types import Event, Inputs
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import plant
from sitl.vehicle import config as vehicles

START_M, FLOOR_M = 4.0, 7.0
FAULT_S, SURFACE_S, LIMIT_S = 2.0, 6.0, 200.0
SEED = 5


class Ascent(NamedTuple):
    """Result of a dive that ends in mode SURFACE."""

    texts: list[str]
    armed: bool
    depth_m: float
    """True depth at the end."""
    deepest_m: float
    """Largest true depth."""


def surface(*faults: dict[str, Any], after_s: float = 0.0, **values: float) -> Ascent:
    """Return a dive at 4 m over a floor at 7 m with faults, then mode SURFACE until it ends.

    The vehicle is observed for ``after_s`` after that.
    """
    config, calm = params.config(values), scenario.load("calm")
    sea = plant.build(
        vehicles.load("caribou_truth"),
        msgspec.structs.replace(
            calm,
            start=msgspec.structs.replace(calm.start, depth_m=START_M, speed_mps=1.2),
            floor=msgspec.structs.replace(calm.floor, depth_m=FLOOR_M),
            fault=tuple({"at_s": FAULT_S, **fault} for fault in faults),
        ),
    )
    rng = plant.random_streams(SEED)
    body, outputs = plant.initial_state(sea, rng)
    state, texts, deepest_m = core.initial_state(), [], 0.0
    surface_tick, disarmed_ticks = round(SURFACE_S / TICK_S), 0
    for tick in range(round(LIMIT_S / TICK_S)):
        devices = outputs.dvl, outputs.battery, outputs.leak, outputs.duct
        inputs = Inputs(outputs.frame, outputs.gps, outputs.altimeter, None, None, *devices)
        state, frame, _, events = core.tick(state, inputs, config)
        texts += [event.text for event in events if isinstance(event, Event)]
        deepest_m = max(deepest_m, body.truth.position_ned_m[2])
        pending: tuple[requests.Request, ...] = ()
        if tick == 1:
            level = requests.ChangeTarget(START_M, 0.0, 0.58)
            pending = requests.SetMode(modes.DEPTH.number), requests.Arm(), level
        elif tick == surface_tick:
            pending = (requests.SetMode(modes.SURFACE.number),)
        for request in pending:
            state, answer, _ = request_handler.handle_request(state, request, config)
            assert answer.result == 0, answer.text
        disarmed_ticks += tick > surface_tick and not state.armed
        if disarmed_ticks > after_s / TICK_S:
            break
        body, outputs = plant.step(sea, body, frame, rng)
    return Ascent(texts, state.armed, body.truth.position_ned_m[2], deepest_m)


def test_surface_elevator_stuck_down_never_touches_floor() -> None:
    """Without the check of FS_DIVE_S it went to the floor at 7 m, 3 m below its depth."""
    ascent = surface({"unit": "elevator", "kind": "stuck", "angle_deg": -8.0})
    assert "Failsafe: Elevator has no effect -> SURFACE" in ascent.texts
    assert "Failsafe: sinks against the elevator -> propeller astern" in ascent.texts
    assert ascent.texts[-1] == "Surfaced: disarmed"
    assert not ascent.armed
    assert ascent.depth_m < 0.5, "SURF_DEPTH_M"
    assert ascent.deepest_m < FLOOR_M - 1.0, "the hull's radius and its bow's reach at -30 deg"


def test_surface_elevator_off_floats_up_and_disarms() -> None:
    """Under power the vehicle does not rise; 22 N raise it."""
    ascent = surface({"unit": "elevator", "kind": "off"})
    assert any(text.endswith("propeller stopped") for text in ascent.texts)
    assert ascent.texts[-1] == "Surfaced: disarmed"
    assert not ascent.armed
    assert ascent.depth_m < 0.5, "SURF_DEPTH_M"


def test_surface_nose_heavy_vehicle_does_not_dive_when_its_propeller_stops() -> None:
    """Before, it disarmed at the surface at 1.2 m/s, and was 1.3 m deep a minute later."""
    ahead = {"unit": "ballast", "kind": "shifted", "mass_kg": 4.0, "x_m": 0.8}
    ascent = surface(ahead, after_s=60.0)
    assert not ascent.armed
    assert ascent.texts == ["Surfaced: disarmed"]
    assert ascent.depth_m < 0.5, "SURF_DEPTH_M"


def test_surface_vehicle_too_heavy_ends_on_the_floor() -> None:
    """With 10 kg more it sinks, against SURF_BUOY_N (22 N carry 2 kg)."""
    heavy = {"unit": "ballast", "kind": "added", "mass_kg": 10.0}
    ascent = surface(heavy, {"unit": "propeller", "kind": "off"}, SURF_TIME_S=30.0)
    assert not ascent.armed
    assert ascent.texts[-1] == "Failsafe: surface not reached, no rise for 30 s -> disarmed"
    assert ascent.depth_m > FLOOR_M - 1.0


def test_surface_pressure_reads_deep_ends_by_satellite_fix() -> None:
    """200 hPa are 2 m: at the surface the depth reads 2 m, and SURF_DEPTH_M is 0.5 m."""
    ascent = surface({"unit": "pressure", "kind": "wrong", "offset_hpa": 200.0})
    assert not ascent.armed
    assert ascent.texts[-1].startswith("Surfaced by satellite fix, though depth reads 2.")
    assert ascent.depth_m < 0.45, (
        "the antenna is under water below 0.4 m (sitl/core/sensors/gps.py)"
    )
    assert "Failsafe: no rise for 20 s -> propeller stopped" not in ascent.texts
