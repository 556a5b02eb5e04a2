"""Sensors that disagree with others: named, not used, and used again when they agree."""

import math

import pytest

from autopilot.control import core, modes, requests
from autopilot.control.sensor_health import monitor
from autopilot.control.types import Event, Inputs
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
    Dvl,
    GpsFix,
    SensorFrame,
)
from tests.helpers.missions import TICK_US, Flight, sensors, under_way

Change = dict[str, float]


def dive() -> Flight:
    """Return an armed vehicle in mode MANUAL, which keeps its attitude and depth."""
    return under_way(modes.MANUAL)


def cruising() -> Flight:
    """Return an armed vehicle at cruise speed, on a heading and a depth."""
    flight = under_way()
    assert flight.ask(requests.ChangeTarget(None, 0.0, 0.58)) == 0
    for _ in flight.run(20.0):
        pass
    flight.events.clear()
    return flight


def feed(flight: Flight, seconds: float, offsets: Change, **devices: object) -> list[str]:
    """Run ticks with constant errors of the readings, at rest at 5 m; return the texts."""
    texts = []
    for _ in range(round(seconds * 50)):
        frame = sensors(flight.state.time_us + TICK_US)
        wrong = {name: getattr(frame, name) + error for name, error in offsets.items()}
        inputs = Inputs(frame._replace(**wrong), None, None, None)._replace(**devices)  # type: ignore[arg-type]
        flight.state, flight.frame, flight.trace, events = core.tick(
            flight.state, inputs, flight.config
        )
        texts += [event.text for event in events if isinstance(event, Event)]
    return texts


def fresh(flight: Flight) -> int:
    frame: SensorFrame = flight.state.ahrs.frame
    return frame.fields_updated


@pytest.mark.parametrize(
    ("offsets", "name"),
    [
        ({f"accel_{axis}_mps2": 1.0 for axis in "xyz"}, "Accelerometer"),
        ({f"mag_{axis}_gauss": 0.1 for axis in "xyz"}, "Magnetometer"),
        ({f"gyro_{axis}_radps": math.radians(5.0) for axis in "xyz"}, "Gyro"),
        ({"gyro_y_radps": math.radians(4.0)}, "Gyro"),
    ],
)
def test_sensor_disagrees_is_named_excluded_and_recovers(offsets: Change, name: str) -> None:
    """The sizes are the defaults of the simulator's faults."""
    flight = dive()
    assert feed(flight, 3.0, {}) == []
    assert feed(flight, 15.0, offsets) == [f"{name} disagrees"]
    bits = {"Gyro": GYRO_FRESH, "Magnetometer": MAGNETOMETER_FRESH}
    assert not fresh(flight) & bits.get(name, 7)
    assert monitor.active_faults(flight.state.health) == {name: "disagrees"}
    estimate = flight.state.estimate
    assert abs(estimate.pitch_rad) < math.radians(14.0)
    assert f"{name} recovered" in feed(flight, 30.0, {})


def test_gyro_disagrees_with_an_accelerometer_silent_at_times_is_named() -> None:
    """The accelerometer reports for 0.2 s of each 1.1 s; its silence does not explain the roll."""
    flight = dive()
    feed(flight, 3.0, {})
    texts = []
    for period in range(20):
        drift = {"gyro_x_radps": math.radians(1.5 + 0.4 * period)}
        texts += feed(flight, 0.2, drift)
        for _ in range(45):
            frame = sensors(flight.state.time_us + TICK_US)
            frame = frame._replace(
                gyro_x_radps=frame.gyro_x_radps + drift["gyro_x_radps"],
                fields_updated=frame.fields_updated & ~ACCELEROMETER_FRESH,
            )
            flight.state, *_, events = core.tick(
                flight.state, Inputs(frame, None, None, None), flight.config
            )
            texts += [event.text for event in events if isinstance(event, Event)]
    assert texts == ["Accelerometer silent", "Gyro disagrees"]
    assert abs(flight.state.estimate.roll_rad) < math.radians(15.0)


def test_accelerometer_that_the_depth_contradicts_is_named_and_not_used() -> None:
    """0.55 m/s2 along the vertical: the limit of the deviation from gravity is 0.6."""
    flight = dive()
    assert feed(flight, 3.0, {}) == []
    assert feed(flight, 10.0, {"accel_z_mps2": 0.55}) == ["Accelerometer disagrees"]
    assert not fresh(flight) & ACCELEROMETER_FRESH
    assert "Accelerometer recovered" in feed(flight, 30.0, {})


def glide_down(shown_mps: float, doppler_mps: float, seconds: float) -> Flight:
    """Return a flight with the nose 14 deg down at 1.3 m/s, which sinks by 0.31 m/s.

    ``shown_mps`` is the rate of descent by the pressure sensor, ``doppler_mps`` by the Doppler log.
    """
    flight, pitch_rad = cruising(), math.radians(-14.0)
    flight.pitch, flight.depth_m = pitch_rad, 5.0
    for _ in flight.run(3.0):  # the depth estimate follows before the fault begins
        flight.pitch = pitch_rad
    flight.events.clear()
    depth_m = flight.depth_m
    for tick in range(round(seconds * 50)):
        flight.pitch, flight.depth_m = pitch_rad, depth_m + shown_mps * 0.02 * tick
        z_mps = (doppler_mps + 1.3 * math.sin(pitch_rad)) / math.cos(pitch_rad)
        flight.more = {
            "dvl": ping(flight, 1.3, 0.0, over_ground=True)._replace(velocity_z_mps=z_mps)
        }
        flight.step()
    return flight


@pytest.mark.parametrize(
    ("shown_mps", "doppler_mps", "named"),
    [(0.05, 0.31, True), (0.05, 0.05, False), (0.31, 0.31, False), (0.31, 0.61, False)],
    ids=["pressure drifts", "no thrust", "all agree", "Doppler log is wrong"],
)
def test_pressure_that_hides_a_descent_is_named(
    shown_mps: float, doppler_mps: float, named: bool
) -> None:
    flight = glide_down(shown_mps, doppler_mps, 12.0)
    assert ("Pressure sensor does not show a descent" in flight.texts()) == named
    assert bool(fresh(flight) & PRESSURE_FRESH) != named


def test_pressure_step_is_never_used_while_it_lasts() -> None:
    """200 hPa are 2 m in a tick: the depth estimate stays, and the failsafe of no depth acts."""
    flight = dive()
    feed(flight, 3.0, {})
    texts = feed(flight, 5.0, {"pressure_hpa": 200.0})
    assert texts == ["Pressure sensor implausible"]
    assert flight.state.estimate.depth_m == pytest.approx(5.0, abs=0.1)
    assert "Failsafe: depth unknown -> SURFACE" in feed(flight, 0.5, {"pressure_hpa": 200.0})


def test_pressure_above_water_is_named() -> None:
    flight = dive()
    feed(flight, 3.0, {})
    for step in range(30):
        feed(flight, 0.1, {"pressure_hpa": -20.0 * step})
    texts = feed(flight, 5.0, {"pressure_hpa": -580.0})
    assert "Pressure sensor disagrees" in texts
    assert not fresh(flight) & PRESSURE_FRESH


def test_gyro_step_is_not_used_at_once() -> None:
    """30 deg/s would command full rudder by HDG_D; the jump is implausible in the first tick."""
    flight = under_way()
    feed(flight, 3.0, {})
    feed(flight, 2.0, {"gyro_z_radps": math.radians(30.0)})
    assert abs(flight.trace.rudder_rad) < 0.1 * flight.config.travel_rad


def test_course_differs_from_heading_is_named() -> None:
    flight = under_way()
    assert flight.ask(requests.ChangeTarget(None, 0.0, 0.58)) == 0
    for _ in range(20):
        flight.more = {"gps": None}
        for _ in flight.run(0.98):
            pass
        time_us = flight.state.time_us + TICK_US
        fix = GpsFix(time_us, 3, 42.35, -71.0, 0.0, -1.3, 0.0, 0.0, 10, 1.5, 3.0)
        flight.more = {"gps": fix}
        flight.step()
    assert "Heading disagrees" in flight.texts()


def ping(flight: Flight, x: float, y: float, over_ground: bool) -> Dvl:
    """Return a record of the Doppler log; the dither of a sensor that is not stuck is added."""
    time_us = flight.state.time_us + TICK_US
    dither = 1e-4 if time_us // TICK_US % 2 else -1e-4
    return Dvl(time_us, x + dither, y, 0.0, over_ground, 0.02, 100)


def swim(flight: Flight, seconds: float, x: float, y: float = 0.0, ground: bool = False) -> None:
    """Fly at cruise speed with a Doppler log that adds an error to the predicted speed."""
    for _ in range(round(seconds * 50)):
        speed_mps = flight.state.estimate.speed_mps
        flight.more = {"dvl": ping(flight, speed_mps + x, y, ground)}
        flight.step()


@pytest.mark.parametrize(
    ("x", "y", "ground"),
    [(1.0, 0.0, False), (0.0, -0.9, False), (-2.2, 0.0, False), (1.7, 0.0, True)],
)
def test_doppler_log_beyond_any_motion_is_named_not_used_and_recovers(
    x: float, y: float, ground: bool
) -> None:
    flight = cruising()
    swim(flight, 6.0, x, y, ground)
    assert flight.texts() == ["DVL disagrees"]
    before = flight.state.estimate.navigation
    swim(flight, 2.0, x, y, ground)
    assert flight.state.estimate.navigation.ping_us == before.ping_us
    swim(flight, 12.0, 0.0)
    assert flight.texts()[-1] == "DVL recovered"


@pytest.mark.parametrize(
    ("x", "y", "ground"), [(0.3, 0.3, False), (-0.4, 0.0, False), (0.8, -0.9, True)]
)
def test_slip_and_current_are_no_fault_of_the_doppler_log(x: float, y: float, ground: bool) -> None:
    flight = cruising()
    swim(flight, 8.0, x, y, ground)
    assert flight.texts() == []


def test_speed_below_the_predicted_one_is_reported_and_log_is_used() -> None:
    """A propeller that turns without thrust looks like this; the log is the better evidence."""
    flight = cruising()
    swim(flight, 6.0, -0.95)
    assert flight.texts() == ["Speed disagrees"]
    assert flight.state.estimate.navigation.ping_us == flight.state.time_us


def test_pressure_of_under_water_with_a_fix_prevents_the_launch() -> None:
    flight = Flight()
    for depth_m, expected in ((0.3, True), (2.0, False), (0.3, True)):
        for _ in range(500):
            frame = sensors(flight.state.time_us + TICK_US, depth_m=depth_m)
            fix = GpsFix(
                frame.time_us,
                3,
                42.35 + 1e-9 * (frame.time_us % 7),
                -71.0,
                *(0.0,) * 4,
                10,
                1.5,
                3.0,
            )
            flight.state, *_ = core.tick(
                flight.state, Inputs(frame, fix, None, None), flight.config
            )
        assert ("Pressure sensor" not in monitor.prearm_failure(flight.state.health)) == expected


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_command_that_is_no_number_is_neutral_or_limited(value: float) -> None:
    flight = dive()
    rudder, elevator, thrust = core.limit(value, value, value, flight.config)
    travel = flight.config.travel_rad
    if math.isnan(value):
        assert (rudder, elevator, thrust) == (0.0, 0.0, 0.0)
    else:
        sign = math.copysign(1.0, value)
        assert (rudder, elevator, thrust) == (sign * travel, sign * travel, sign)


def test_pressure_above_water_is_not_used_again_while_it_stays() -> None:
    """Before, it was used again after 5 s, and a dive ended "Surfaced" 12 m deep."""
    flight = dive()
    offset_hpa = -7.5 * 100.5  # from 5 m deep to 2.5 m above the water, in 15 s
    assert feed(flight, 3.0, {}) == []
    texts = []
    for share in (k / 150 for k in range(1, 151)):
        texts += feed(flight, 0.1, {"pressure_hpa": share * offset_hpa})
    texts += feed(flight, 40.0, {"pressure_hpa": offset_hpa})
    assert "Pressure sensor disagrees" in texts
    assert "Pressure sensor recovered" not in texts
    assert not fresh(flight) & PRESSURE_FRESH
    assert flight.state.armed
