"""Mode SURFACE of a vehicle that does not rise, or whose depth reading is wrong: the pure tick."""

import math
from collections.abc import Callable
from functools import partial

import pytest

from autopilot.control import ascent, modes, requests
from autopilot.control.sensor_health.types import Fault, FaultTracker
from autopilot.control.types import ACCEPTED
from mavlink_io.records import PRESSURE_FRESH, GpsFix
from tests.helpers.missions import Flight, under_way

STOPPED = "Failsafe: no rise for 20 s -> propeller stopped"
ENDED = "Failsafe: surface not reached, no rise for 60 s -> disarmed"
FIXED = "Surfaced by satellite fix, though depth reads 5.0 m: disarmed"


def surfacing(**changes: object) -> Flight:
    """Return a flight in mode SURFACE at 5 m, started from level flight."""
    flight = under_way(**changes)  # type: ignore[arg-type]
    assert flight.ask(requests.SetMode(modes.SURFACE.number)) == ACCEPTED
    return flight


Course = Callable[[float], float]
"""Depth (m) as a function of time (s)."""


def at_5_m(t_s: float) -> float:
    return 5.0


def constant(depth_m: float) -> Course:
    return lambda t_s: depth_m


def hold_down(
    flight: Flight, seconds: float, depth_m: Course = at_5_m, pitch_rad: float = 0.0
) -> float:
    """Force the vehicle to a depth and a pitch, whatever its elevator does.

    Return the seconds until it disarmed or the time was over.
    """
    for tick in range(round(seconds * 50)):
        pitch_rate = pitch_rad - flight.pitch  # within about a second
        flight.trace = flight.trace._replace(elevator_rad=2.0 * pitch_rate)
        flight.depth_m = depth_m(tick / 50)
        if not flight.step().armed:
            return tick / 50
    return seconds


def rising(start_m: float, t_s: float) -> float:
    return start_m - 0.2 * t_s


def test_surface_depth_above_the_water_is_no_surface() -> None:
    flight = surfacing(buoyancy_n=0.0)
    assert hold_down(flight, 20.0, lambda t_s: max(-4.0, 5.0 - 0.5 * t_s)) == 20.0
    assert hold_down(flight, 20.0, lambda t_s: -0.3) < 20.0


def fix(flight: Flight, east_deg: float = 0.0, late_s: float = 0.0, fix_type: int = 3) -> GpsFix:
    time_us = flight.state.time_us - round(late_s * 1e6)
    return GpsFix(time_us, fix_type, 42.35, -71.0 + east_deg, 0.0, 0.0, 0.0, 0.0, 10, 1.5, 3.0)


def receive(flight: Flight, seconds: int, report: Callable[[int], GpsFix]) -> None:
    """Hold the vehicle down while its receiver reports once a second."""
    for second in range(seconds):
        flight.more = {"gps": report(second)}
        hold_down(flight, 0.02)
        flight.more = {}
        hold_down(flight, 0.98)


def test_surface_without_rise_stops_propeller_once() -> None:
    flight = surfacing()
    hold_down(flight, 19.0)
    assert flight.trace.thrust == pytest.approx(0.58)
    hold_down(flight, 100.0)
    assert flight.trace.thrust == 0.0
    assert flight.state.armed
    assert flight.texts().count(STOPPED) == 1
    assert flight.state.failsafe == "not rising"


KEEPS_DRIVING: tuple[dict[str, float], ...] = (
    {"buoyancy_n": 0.0},
    {"buoyancy_n": -5.0},
    {"surface_rise_s": 0.0},
)


@pytest.mark.parametrize("changes", KEEPS_DRIVING, ids=str)
def test_surface_heavy_or_switched_off_keeps_propeller(changes: dict[str, float]) -> None:
    flight = surfacing(**changes)
    hold_down(flight, 60.0)
    assert flight.trace.thrust == pytest.approx(0.58)
    assert STOPPED not in flight.texts()


def test_surface_slow_rise_keeps_propeller() -> None:
    """A rise of 0.02 m/s is 0.4 m in SURF_RISE_S, twice RISE_M."""
    flight = surfacing()
    hold_down(flight, 200.0, lambda t_s: 5.0 - 0.02 * t_s)
    assert flight.trace.thrust == pytest.approx(0.58)
    assert STOPPED not in flight.texts()


def test_surface_rise_after_deep_sinking_is_not_ended() -> None:
    """The vehicle sinks 10 m under power, then rises at 0.1 m/s for longer than SURF_TIME_S."""
    flight = surfacing(surface_time_s=60.0, fs_dive_s=0.0, fs_look_s=0.0)
    hold_down(flight, 20.0, lambda t_s: 5.0 + 0.5 * t_s)
    hold_down(flight, 100.0, lambda t_s: 15.0 - 0.1 * t_s)
    assert STOPPED in flight.texts()
    assert flight.state.armed


def test_surface_not_reached_ends_at_time_limit() -> None:
    """The limit is SURF_RISE_S with propeller plus SURF_TIME_S without."""
    flight = surfacing(surface_time_s=60.0)
    assert hold_down(flight, 100.0) == pytest.approx(80.0, abs=0.2)
    assert flight.texts()[-1] == ENDED
    assert flight.state.thrust == 0.0


def test_surface_heavy_vehicle_ends_at_time_limit() -> None:
    flight = surfacing(buoyancy_n=-5.0, surface_time_s=40.0)
    assert hold_down(flight, 60.0) == pytest.approx(40.0, abs=0.2)
    assert flight.texts()[-1].startswith("Failsafe: surface not reached")


def test_surface_time_limit_zero_never_ends() -> None:
    """The run is longer than the default limits, 20 s and 300 s."""
    flight = surfacing(surface_time_s=0.0)
    hold_down(flight, 1.0)
    for second in range(1, 400):
        later = flight.state._replace(time_us=flight.state.time_us + second * 1_000_000)
        assert ascent.step_surface(later, flight.config)[0].armed


def test_surface_blind_without_fix_ends_at_time_limit() -> None:
    """Depth is not measured for longer than FS_PRESS_S while its estimate drifts up."""
    flight = surfacing()
    flight.step()
    at = flight.state.estimate._replace(depth_m=4.0)
    began_us = flight.state.time_us
    limit_us = began_us + 300_000_000
    ends = (began_us + 10_000_000, True), (limit_us, True), (limit_us + 20_000, False)
    for time_us, armed in ends:
        later = flight.state._replace(time_us=time_us, estimate=at)
        flight.state, _ = ascent.step_surface(later, flight.config)
        assert flight.state.armed == armed
        assert flight.state.setpoint.thrust == 0.0


def test_surface_entered_again_restarts_propeller() -> None:
    flight = surfacing()
    hold_down(flight, 30.0)
    assert flight.ask(requests.SetMode(modes.MANUAL.number)) == ACCEPTED
    assert flight.ask(requests.SetMode(modes.SURFACE.number)) == ACCEPTED
    hold_down(flight, 10.0)
    assert flight.trace.thrust == pytest.approx(0.58)


def test_surface_fix_that_holds_ends_it_at_any_depth_reading() -> None:
    flight = surfacing()
    hold_down(flight, 6.0)
    receive(flight, 5, lambda n: fix(flight, east_deg=1e-6 * n))
    assert flight.state.armed
    receive(flight, 2, lambda n: fix(flight, east_deg=1e-5 + 1e-6 * n))
    assert not flight.state.armed
    assert flight.texts()[-1] == FIXED


@pytest.mark.parametrize("changes", [{"surface_fix_s": 0.0}, {"surface_fix_s": 60.0}])
def test_surface_fix_too_short_continues(changes: dict[str, float]) -> None:
    flight = surfacing(**changes)
    receive(flight, 15, lambda n: fix(flight, east_deg=1e-6 * n))
    assert flight.state.armed


def test_surface_repeated_fix_is_ignored() -> None:
    flight = surfacing()
    receive(flight, 15, lambda n: fix(flight))
    assert flight.state.armed


def test_surface_late_fixes_from_before_dive_are_ignored() -> None:
    """The reports come 5 s late; their time stamps are those of the fixes."""
    flight = surfacing()
    receive(flight, 15, lambda n: fix(flight, east_deg=1e-6 * n, late_s=5.0))
    assert flight.state.armed


def test_surface_fix_lost_restarts_the_time() -> None:
    flight = surfacing()
    receive(flight, 16, lambda n: fix(flight, east_deg=1e-6 * n, fix_type=1 if n % 4 == 3 else 3))
    assert flight.state.armed


def test_surface_fix_while_rising_is_ignored() -> None:
    """A receiver with fixes at any depth, as in some simulators, does not end an ascent."""
    flight = surfacing()
    for second in range(15):
        flight.more = {"gps": fix(flight, east_deg=1e-6 * second)}
        start_m = 5.0 - 0.2 * second
        hold_down(flight, 1.0, partial(rising, start_m))
    assert flight.state.armed
    assert flight.state.estimate.depth_m == pytest.approx(2.0, abs=0.2)


def sinking(t_s: float) -> float:
    return 5.0 + 0.3 * t_s


def test_surface_sinking_nose_down_runs_astern_then_stops() -> None:
    """The elevator is hard up within a second; the dive is reported after FS_DIVE_S (3 s)."""
    flight = surfacing(fs_depth_m=100.0)
    hold_down(flight, 8.0, sinking, pitch_rad=-0.5)
    assert "Failsafe: sinks against the elevator -> propeller astern" in flight.texts()
    assert flight.trace.thrust == pytest.approx(-0.58)
    hold_down(flight, 3.0, lambda t_s: 7.4, pitch_rad=-0.5)
    assert flight.trace.thrust == 0.0
    assert flight.texts()[-1].endswith("-> propeller stopped")


def test_surface_astern_ends_at_its_time_limit() -> None:
    flight = surfacing(fs_depth_m=100.0, surface_astern_s=5.0)
    hold_down(flight, 15.0, sinking, pitch_rad=-0.5)
    assert "Failsafe: astern for 5 s -> propeller stopped" in flight.texts()


def test_surface_astern_off_stops_at_once() -> None:
    flight = surfacing(fs_depth_m=100.0, surface_astern_s=0.0)
    hold_down(flight, 8.0, sinking, pitch_rad=-0.5)
    assert "Failsafe: sinks against the elevator -> propeller stopped" in flight.texts()


def test_surface_sinking_without_power_tries_power_again() -> None:
    flight = surfacing()
    hold_down(flight, 21.0)
    assert flight.trace.thrust == 0.0
    hold_down(flight, 21.0, lambda t_s: 5.0 + 0.06 * t_s)
    assert flight.trace.thrust == pytest.approx(0.58)
    assert "Failsafe: sank 1.1 m without power -> power" in flight.texts()


def without_buoyancy(flight: Flight) -> None:
    """Stop the propeller for the third time: it does not raise the vehicle, which sinks without."""
    for attempt in range(1, 4):
        hold_down(flight, 22.0)
        assert flight.trace.thrust == 0.0, attempt
        hold_down(flight, 22.0, lambda t_s: 5.0 + 0.06 * t_s)


def test_surface_power_stays_after_the_third_attempt() -> None:
    """Without it a vehicle that its propeller holds at 0.75 m went to the floor at 30 m."""
    flight = surfacing()
    without_buoyancy(flight)
    assert flight.trace.thrust == pytest.approx(0.58)
    hold_down(flight, 60.0)
    assert flight.trace.thrust == pytest.approx(0.58)
    assert sum(text.endswith("propeller stopped") for text in flight.texts()) == 3


@pytest.mark.parametrize(("depth_m", "seconds"), [(0.75, 150.0), (5.0, 60.0)])
def test_surface_power_that_stays_just_below_the_surface_has_no_time_limit(
    depth_m: float, seconds: float
) -> None:
    flight = surfacing(surface_time_s=60.0)
    without_buoyancy(flight)
    hold_down(flight, 30.0, lambda t_s: max(depth_m, 5.0 - 0.3 * t_s))
    assert hold_down(flight, 150.0, constant(depth_m)) == pytest.approx(seconds, abs=35.0)
    assert flight.state.armed == (depth_m < 1.0)


def test_surface_without_power_keeps_nose_up() -> None:
    """A propeller that does not stop gives the elevator way to raise the vehicle."""
    flight = surfacing()
    hold_down(flight, 25.0)
    assert flight.trace.thrust == 0.0
    assert flight.trace.pitch_setpoint_rad > math.radians(10.0)
    assert flight.trace.elevator_rad > 0.0


def test_surface_astern_without_effect_ends_before_its_limit() -> None:
    flight = surfacing(fs_depth_m=100.0)
    hold_down(flight, 15.0, sinking, pitch_rad=-0.5)
    assert "Failsafe: astern for 6 s -> propeller stopped" in flight.texts()


def surfaced() -> Flight:
    """Return a flight that SURFACE has disarmed at 0.3 m."""
    flight = surfacing()
    hold_down(flight, 40.0, lambda t_s: max(0.3, 5.0 - 0.2 * t_s))
    assert flight.texts()[-1] == "Surfaced: disarmed"
    return flight


def move(flight: Flight, to_m: float) -> float:
    """Move a vehicle to a depth at 0.2 m/s; return its largest elevator command."""
    largest, start_m = 0.0, flight.depth_m
    for tick in range(1 + round(abs(to_m - start_m) / 0.004)):
        flight.depth_m = start_m + math.copysign(0.004 * tick, to_m - start_m)
        flight.step()
        assert flight.frame is not None
        assert (flight.frame.controls[2], flight.state.armed) == (0.0, False)
        largest = max(largest, flight.frame.controls[1])
    return largest


def test_disarmed_vehicle_that_sinks_raises_its_elevator() -> None:
    """As with a propeller that does not stop."""
    flight = surfaced()
    assert move(flight, 0.9) == 0.0
    for _ in range(2):
        assert move(flight, 1.5) > 0.1
        move(flight, 0.3)
        assert move(flight, 0.5) == 0.0
    assert flight.texts().count("Failsafe: sinks while disarmed -> elevator up") == 1


@pytest.mark.parametrize("request_of_ground", [requests.Disarm(), requests.TestActuator(0, 0.0, 9)])
def test_ground_ends_elevator_of_disarmed_vehicle(request_of_ground: requests.Request) -> None:
    flight = surfaced()
    assert move(flight, 1.5) > 0.1
    assert flight.ask(request_of_ground) == ACCEPTED
    assert move(flight, 2.0) == 0.0


def test_surface_releases_fitted_weight_once() -> None:
    flight = surfacing(weight_fitted=1, buoyancy_n=-5.0)
    hold_down(flight, 21.0)
    assert flight.frame is not None
    assert flight.frame.controls[2:4] == (0.0, 0.0)
    hold_down(flight, 31.0)
    assert flight.frame.controls[2:4] == (0.0, 1.0)
    texts = "".join(flight.texts())
    assert texts.count("no rise for 30 s without power -> weight released") == 1
    assert flight.ask(requests.Disarm(force=True)) == ACCEPTED
    hold_down(flight, 0.02)
    assert flight.frame.controls[3] == 1.0


def test_surface_ends_when_depth_has_stayed_at_surface() -> None:
    """A pressure sensor that reads shallow: the vehicle rises on after the depth reads 0.4 m."""
    flight = surfacing()
    assert hold_down(flight, 27.5, partial(rising, 5.0)) == 27.5
    assert flight.state.estimate.depth_m == pytest.approx(-0.5, abs=0.1)
    assert flight.trace.thrust == 0.0
    assert hold_down(flight, 10.0, lambda t_s: -0.5) < 5.0
    assert flight.texts()[-1] == "Surfaced: disarmed"


def test_dive_against_elevator_surfaces_from_any_depth_mode() -> None:
    flight = under_way()
    assert flight.ask(requests.ChangeTarget(3.0, 0.0, 0.58)) == ACCEPTED
    hold_down(flight, 6.0, sinking, pitch_rad=-0.3)
    assert "Failsafe: Elevator has no effect -> SURFACE" in flight.texts()


def test_dive_against_elevator_is_seen_by_a_slow_pressure_sensor() -> None:
    """One reading in 2.6 s: pair 1063 of the soak sank from 8 to 15 m and touched the floor."""
    flight = under_way()
    assert flight.ask(requests.ChangeTarget(3.0, 0.0, 0.58)) == ACCEPTED
    for tick in range(600):
        flight.silent = PRESSURE_FRESH if tick % 130 else 0
        hold_down(flight, 0.02, constant(sinking(tick / 50)), pitch_rad=-0.3)
    assert "Failsafe: Elevator has no effect -> SURFACE" in flight.texts()


def test_suspicion_against_elevator_needs_evidence_at_its_confirmation() -> None:
    """The pressure sensor ends while the vehicle sinks for 1 s; it has risen when it returns."""
    flight = under_way()
    assert flight.ask(requests.ChangeTarget(3.0, 0.0, 0.58)) == ACCEPTED
    hold_down(flight, 2.0, sinking, pitch_rad=-0.3)
    flight.silent = PRESSURE_FRESH
    hold_down(flight, 6.0, lambda t_s: 5.6 - 0.3 * t_s, pitch_rad=0.1)
    flight.silent = 0
    hold_down(flight, 4.0, lambda t_s: 3.8, pitch_rad=0.0)
    assert not any("Elevator" in text for text in flight.texts()), flight.texts()


def test_limit_of_depth_looks_ahead() -> None:
    """At 0.5 m/s the vehicle sinks 2 m in FS_LOOK_S: 18 m is reached from 16 m."""
    flight = under_way(fs_dive_s=0.0)
    hold_down(flight, 20.0, lambda t_s: 5.0 + 0.5 * t_s)
    assert flight.state.failsafe == ""
    hold_down(flight, 3.0, lambda t_s: 15.0 + 0.5 * t_s)
    assert flight.state.failsafe.endswith("m in 4 s")
    assert flight.state.estimate.depth_m < 17.0


def test_surface_with_faulty_pressure_sensor_waits_for_fix() -> None:
    """With one sample in 3 s the depth is integrated between them, and never settles."""
    flight = surfacing()
    hold_down(flight, 2.0)
    assert flight.trace.thrust == pytest.approx(0.58)
    health = flight.state.health
    silent = FaultTracker(
        Fault("Pressure sensor", "silent"), 0, flight.state.time_us, reported=True
    )
    flight.state = flight.state._replace(health=health._replace(faults=(silent,)))
    flight.step()
    assert flight.trace.thrust == 0.0
    receive(flight, 1, lambda n: fix(flight))
    assert flight.texts()[-1] == "Surfaced by satellite fix: disarmed"


def test_surface_still_sinking_after_two_recoveries_stops_propeller() -> None:
    """FS_LOOK_S is the time of a recovery, 4 s."""
    flight = surfacing(fs_dive_s=0.0)
    hold_down(flight, 7.5, lambda t_s: 5.0 + 0.1 * t_s)
    assert flight.trace.thrust == pytest.approx(0.58)
    hold_down(flight, 2.0, lambda t_s: 5.75 + 0.1 * t_s)
    assert "Failsafe: still sinks after 8 s -> propeller stopped" in flight.texts()


def test_surface_that_moves_up_and_down_at_surface_is_no_failsafe() -> None:
    """The nose stays 8 deg down, so that the vehicle does not disarm; waves cover it by 0.2 m."""
    flight = surfacing(fs_dive_s=0.0, surface_rise_s=10.0)
    hold_down(flight, 25.0, lambda t_s: max(0.2, 5.0 - 0.3 * t_s), math.radians(-8.0))
    flight.speed_mps = 1.0
    hold_down(flight, 15.0, lambda t_s: 0.2 + 0.2 * math.sin(t_s), math.radians(-8.0))
    assert not any(text.startswith("Failsafe") for text in flight.texts()), flight.texts()


def test_surface_brake_of_wrong_speed_ends_at_its_time_limit() -> None:
    """The estimated speed stays 1 m/s while the vehicle sinks by 0.02 m/s at the surface."""
    flight = surfacing(surface_astern_s=5.0, speed_length_m=1e6)
    hold_down(flight, 18.0, lambda t_s: max(0.2, 5.0 - 0.3 * t_s), math.radians(-8.0))
    estimate = flight.state.estimate._replace(speed_mps=1.0)
    flight.state = flight.state._replace(estimate=estimate)
    braked = [0]

    def sinking_slowly(t_s: float) -> float:
        braked[0] += flight.trace.thrust < 0.0
        return 0.2 + 0.02 * t_s

    hold_down(flight, 15.0, sinking_slowly, math.radians(-8.0))
    assert flight.state.armed
    assert flight.state.estimate.speed_mps == pytest.approx(1.0, abs=0.01)
    assert braked[0] / 50 == pytest.approx(5.0, abs=0.5)
    assert flight.trace.thrust == 0.0


def nose_up_at_cruise(**changes: object) -> Flight:
    """Return a flight in mode DEPTH at cruise speed."""
    flight = under_way(fs_depth_m=100.0, **changes)  # type: ignore[arg-type]
    assert flight.ask(requests.ChangeTarget(None, 0.0, 0.58)) == ACCEPTED
    for _ in flight.run(20.0):
        pass
    flight.depth_m = 5.0
    return flight


def test_pitch_that_the_depth_contradicts_ends_power_and_centres_elevator() -> None:
    """1.3 m/s with the nose 23 deg up is an ascent of 0.5 m/s; the vehicle sinks by 0.3 m/s."""
    flight = nose_up_at_cruise()
    hold_down(flight, 10.0, sinking, pitch_rad=0.4)
    texts = flight.texts()
    assert "Failsafe: Pitch disagrees -> SURFACE" in texts
    assert "Failsafe: pitch disagrees with the depth -> propeller stopped" in texts
    assert flight.trace.thrust == 0.0
    hold_down(flight, 3.0, lambda t_s: 7.0, pitch_rad=0.4)
    assert flight.trace.elevator_rad == pytest.approx(flight.config.elevator_trim_rad)


@pytest.mark.parametrize(("seconds", "pitch_rad"), [(2.0, 0.4), (10.0, 0.05)])
def test_climb_that_begins_late_or_small_pitch_is_no_contradiction(
    seconds: float, pitch_rad: float
) -> None:
    flight = nose_up_at_cruise(fs_dive_s=3.0)
    hold_down(flight, seconds, sinking, pitch_rad=pitch_rad)
    hold_down(flight, 5.0, lambda t_s: 5.0 + 0.3 * seconds - 0.4 * t_s, pitch_rad=pitch_rad)
    assert not [text for text in flight.texts() if "Pitch" in text]
