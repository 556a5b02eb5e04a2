"""Each instrument against its data sheet: wander, delay, silence, range, and what it does at its
limits."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.random import default_rng

from mavlink_io.frames import quaternion_from_euler
from mavlink_io.records import Dvl
from sitl import scenario
from sitl.core import environment, plant, timestep
from sitl.core.environment import Environment
from sitl.core.sensors import (
    altimeter,
    battery,
    datasheets,
    dvl,
    encoder,
    gps,
    inertial,
    leak,
    sample_timing,
)
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Timing
from sitl.core.truth import Truth
from sitl.environment_schema import FloorTable
from sitl.scenario import Scenario
from sitl.vehicle import config
from tests.sitl.core.test_sensors import AT_REST, FIELD, SEA

TICK_US = timestep.TICK_US
SHELF = datasheets.catalogue()


def chance(seed: int) -> NoiseStream:
    return NoiseStream(default_rng(seed))


def deep(floor_depth_m: float) -> Environment:
    return environment.build(
        Scenario(floor=FloorTable(depth_m=floor_depth_m)), 9.81, timestep.TICK_S
    )


def moving(velocity: tuple[float, float, float], depth_m: float = 5.0, **changes: Any) -> Truth:
    return AT_REST._replace(
        velocity_ned_mps=velocity, position_ned_m=(0.0, 0.0, depth_m), **changes
    )


def ticks(truth: Truth, count: int) -> Iterator[Truth]:
    for tick in range(count):
        yield truth._replace(time_us=tick * TICK_US)


def allan_deviation(series: Any, cluster: int) -> float:
    means = series[: series.size // cluster * cluster].reshape(-1, cluster).mean(axis=1)
    return float(np.sqrt(0.5 * np.mean(np.diff(means) ** 2)))


def test_the_gyros_allan_deviation_falls_by_its_density_and_peaks_at_its_stability() -> None:
    """In the noise the Allan deviation is N / sqrt(2 tau) of a one-sided density; the wander alone
    peaks at 1.89 T."""
    sheet, stream = SHELF.imu["mti-300"], chance(11)
    imu = inertial.build(sheet, TICK_US)
    memory, rates, wander = inertial.initial_state(imu, stream), [], []
    for truth in ticks(AT_REST, 50 * 600):
        memory, _ = inertial.sample(imu, truth, memory, stream)
        rates.append(memory.latest.rates_radps)
    noise = np.mean([allan_deviation(axis, 50) for axis in np.array(rates).T])
    assert noise == pytest.approx(math.radians(0.01) / math.sqrt(2.0), rel=0.1)
    for second in range(60_000):
        memory, _ = inertial.sample(
            imu, AT_REST._replace(time_us=second * 1_000_000), memory, stream
        )
        wander.append(memory.errors.gyro_bias_radps)
    peak = np.mean(
        [allan_deviation(axis, round(1.89 * sheet.wander_time_s)) for axis in np.array(wander).T]
    )
    assert math.degrees(peak) * 3600.0 == pytest.approx(10.0, rel=0.2)
    lag = round(sheet.wander_time_s)
    told = np.array(wander) - np.mean(wander, axis=0)
    correlation = np.mean(told[lag:] * told[:-lag]) / np.mean(told**2)
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.12)


@pytest.mark.parametrize("latency_ticks", [0, 1, 7])
def test_a_reading_arrives_exactly_so_many_ticks_after_it_was_taken(latency_ticks: int) -> None:
    when, queue, stream = (
        sample_timing.timing(10.0, latency_ticks * 0.02, 0.0, TICK_US),
        (),
        chance(1),
    )
    arrivals = []
    for tick in range(40):
        time_us = tick * TICK_US
        queue, heard = sample_timing.queue_reading(
            when, queue, time_us if sample_timing.is_due(when, time_us) else None, time_us, stream
        )
        if heard is not None:
            arrivals.append((heard, time_us - heard))
    assert [taken for taken, _ in arrivals] == [k * 100_000 for k in range(len(arrivals))]
    assert {late for _, late in arrivals} == {latency_ticks * TICK_US}
    assert len(arrivals) == len(range(0, 40 - latency_ticks, 5))


@pytest.mark.parametrize("dropout", [0.01, 0.3])
def test_readings_are_lost_as_often_as_the_sheet_says(dropout: float) -> None:
    when, queue, stream, count = (
        sample_timing.timing(50.0, 0.04, dropout, TICK_US),
        (),
        chance(2),
        20_000,
    )
    heard = 0
    for tick in range(count):
        queue, reading = sample_timing.queue_reading(when, queue, tick + 1, tick * TICK_US, stream)
        heard += reading is not None
    lost, spread = count - 2 - heard, math.sqrt(count * dropout * (1.0 - dropout))
    assert abs(lost - count * dropout) < 4.0 * spread


def test_a_late_or_lost_sample_of_the_imu_is_not_called_new_and_the_last_is_held() -> None:
    sheet = SHELF.imu["mti-300"]
    imu = inertial.build(sheet, TICK_US)._replace(timing=Timing(TICK_US, 2 * TICK_US, 0.5))
    stream, memory = chance(4), inertial.InertialState()
    before, seen = memory.latest, []
    for truth in ticks(AT_REST, 400):
        memory, fresh = inertial.sample(imu, truth, memory, stream)
        assert fresh == (memory.latest != before)
        before = memory.latest
        seen.append(fresh)
    assert seen[:2] == [False, False]
    assert 140 < sum(seen) < 260


class Receiver:
    """A satellite receiver whose antenna is put under and above water at will."""

    def __init__(self, name: str = "neo-m8") -> None:
        self.device = gps.build(SHELF.gps[name], TICK_US)
        self.memory, self.stream, self.time_us = gps.GpsState(), chance(3), 0

    def fixes(self, seconds: float, depth_m: float) -> list[int]:
        """The fix types heard in so many seconds at a depth."""
        heard = []
        for _ in range(round(seconds / timestep.TICK_S)):
            truth = moving((0.0, 0.0, 0.0), depth_m, time_us=self.time_us)
            self.memory, fix = gps.sample(self.device, truth, SEA, self.memory, self.stream)
            self.time_us += TICK_US
            heard += [fix.fix_type] if fix else []
        return heard


def test_a_receiver_launched_at_the_surface_has_its_fix_and_loses_it_under_water() -> None:
    receiver = Receiver()
    assert receiver.fixes(2.0, depth_m=0.2) == [gps.FIX_3D] * 10
    assert receiver.fixes(2.0, depth_m=0.6) == [gps.NO_FIX] * 10


@pytest.mark.parametrize(("dive_s", "to_fix_s"), [(60.0, 1.0), (7300.0, 26.0)])
def test_after_surfacing_the_fix_takes_a_hot_or_a_warm_start(
    dive_s: float, to_fix_s: float
) -> None:
    receiver = Receiver()
    receiver.fixes(1.0, depth_m=0.2)
    receiver.fixes(1.0, depth_m=3.0)
    receiver.time_us += round(dive_s * 1e6)
    heard = receiver.fixes(30.0, depth_m=0.2)
    searching = round(5 * to_fix_s)
    assert heard == [gps.NO_FIX] * searching + [gps.FIX_3D] * (150 - searching)


def test_fixes_scatter_as_the_receiver_says_they_do() -> None:
    receiver, stream, fixes = Receiver(), chance(8), []
    for _ in range(3000):
        _, fix = gps.sample(
            receiver.device, moving((0.3, -0.4, 0.0), 0.2), SEA, gps.GpsState(), stream
        )
        assert fix is not None
        fixes.append(fix)
    north_m = (np.array([fix.lat_deg for fix in fixes]) - SEA.latitude_deg) * 111_195
    assert north_m.std() == pytest.approx(fixes[0].eph_m, rel=0.06)
    assert np.std([fix.alt_m for fix in fixes]) == pytest.approx(fixes[0].epv_m, rel=0.06)
    assert np.mean([fix.velocity_east_mps for fix in fixes]) == pytest.approx(-0.4, abs=0.005)


def pings(
    truth: Truth, sea: Environment, count: int = 1, name: str = "a50", **changes: Any
) -> list[Dvl | None]:
    """What a log hears in so many pings, without delay or loss."""
    log = dvl.build(SHELF.dvl[name], TICK_US)
    log = log._replace(timing=Timing(TICK_US, 0, 0.0), water_period_us=TICK_US, **changes)
    memory, stream, heard = dvl.DvlState(), chance(5), []
    for _ in range(count):
        memory, velocity = dvl.sample(log, truth, sea, memory, stream)
        heard.append(velocity)
    return heard


def columns(heard: list[Dvl | None]) -> Any:
    return np.array([velocity[1:4] for velocity in heard if velocity is not None])


def test_bottom_track_is_velocity_over_ground_in_body_axes_and_as_noisy_as_said() -> None:
    attitude = quaternion_from_euler(0.0, 0.0, math.radians(90.0))
    truth = moving((0.3, 1.2, 0.1), attitude_q=attitude, water_velocity_ned_mps=(0.5, 0.5, 0.0))
    heard = pings(truth, SEA, 4000)
    assert all(velocity is not None and velocity.over_ground for velocity in heard)
    np.testing.assert_allclose(np.median(columns(heard), axis=0), (1.2, -0.3, 0.1), atol=2e-3)
    middle = np.sort(columns(heard)[:, 0])[40:-40]
    assert middle.std() == pytest.approx(SHELF.dvl["a50"].noise_mps, rel=0.1)


@pytest.mark.parametrize(
    ("floor_m", "tracks"),
    [(55.0, "bottom"), (55.2, "water"), (5.2, "bottom"), (5.04, "nothing"), (5000.0, "water")],
)
def test_the_log_turns_from_the_bottom_to_the_water_at_its_range(
    floor_m: float, tracks: str
) -> None:
    """Altitude 50 m is the limit; 4 cm is too near for an echo and leaves no room for a layer of
    water."""
    truth = moving((1.0, 0.0, 0.0), water_velocity_ned_mps=(0.4, 0.0, 0.0))
    (velocity,) = pings(truth, deep(floor_m))
    if tracks == "nothing":
        assert velocity is None
        return
    assert velocity is not None
    assert velocity.over_ground == (tracks == "bottom")
    assert velocity.velocity_x_mps == pytest.approx(1.0 if tracks == "bottom" else 0.6, abs=0.25)


def test_three_beams_still_track_the_bottom_and_say_so_and_two_do_not() -> None:
    rolled = quaternion_from_euler(math.radians(20.0), math.radians(20.0), 0.0)
    truth = moving((0.0, 0.0, 0.0), attitude_q=rolled, depth_m=5.0)
    kinds = {}
    for floor_m in (30.0, 44.0, 52.0):
        (velocity,) = pings(truth._replace(velocity_ned_mps=(1.0, 0.5, 0.0)), deep(floor_m))
        assert velocity is not None
        kinds[floor_m] = velocity.over_ground, velocity.quality_pct
    assert kinds == {30.0: (True, 100), 44.0: (True, 75), 52.0: (False, 100)}


def test_a_heeling_log_loses_the_bottom() -> None:
    steep = quaternion_from_euler(0.0, math.radians(36.0), 0.0)
    (velocity,) = pings(moving((1.0, 0.0, 0.0), attitude_q=steep), SEA)
    assert velocity is not None
    assert not velocity.over_ground


def test_an_outlier_shows_in_the_figure_of_merit() -> None:
    sheet = SHELF.dvl["a50"]
    heard = [v for v in pings(moving((1.0, 0.0, 0.0)), SEA, 20_000) if v is not None]
    astray = [v for v in heard if math.hypot(v.velocity_x_mps - 1.0, v.velocity_y_mps) > 0.2]
    expected = sheet.outlier_chance * len(heard)
    assert 0.5 * expected < len(astray) <= expected + 4.0 * math.sqrt(expected)
    assert min(v.figure_of_merit_mps for v in astray) > 0.1
    typical = [v.figure_of_merit_mps for v in heard if v not in astray]
    assert np.median(typical) < 2.0 * sheet.noise_mps


def range_of(depth_m: float, pitch_deg: float, name: str = "echo-30m") -> float | None:
    sounder = altimeter.build(SHELF.altimeter[name], TICK_US)._replace(
        timing=Timing(TICK_US, 0, 0.0)
    )
    attitude = quaternion_from_euler(0.0, math.radians(pitch_deg), 0.0)
    truth = moving((0.0, 0.0, 0.0), depth_m, attitude_q=attitude)
    _, echo = altimeter.sample(sounder, truth, SEA, (), chance(1))
    return None if echo is None else echo.range_m


@pytest.mark.parametrize(
    ("depth_m", "pitch_deg", "range_m"),
    [
        (5.0, 0.0, 15.0),
        (5.0, 2.0, 15.0),  # within the beam's 3 deg to either side the vertical returns first
        (5.0, -33.0, 15.0 / math.cos(math.radians(30.0))),
        (19.8, 0.0, None),
        (5.0, 61.0, None),
    ],
)
def test_the_altimeter_sees_the_floor_within_range_and_tilt(
    depth_m: float, pitch_deg: float, range_m: float | None
) -> None:
    assert range_of(depth_m, pitch_deg) == (
        None if range_m is None else pytest.approx(range_m, abs=0.08)
    )


def test_the_altimeters_outliers_are_shorter_than_the_way_to_the_floor() -> None:
    sounder = altimeter.build(SHELF.altimeter["va500"], TICK_US)._replace(
        timing=Timing(TICK_US, 0, 0.0)
    )
    stream, ranges = chance(6), []
    for _ in range(20_000):
        _, echo = altimeter.sample(sounder, AT_REST, SEA, (), stream)
        assert echo is not None
        ranges.append(echo.range_m)
    astray = [r for r in ranges if abs(r - 15.0) > 0.1]
    expected = 20_000 * sounder.sheet.outlier_chance
    assert abs(len(astray) - expected) < 4.0 * math.sqrt(expected)
    assert max(astray) < 15.0


PACK = battery.build(SHELF.battery["lipo-1500wh"], FIELD, full_rps=6.5, tick_us=TICK_US)


def test_operating_point_power_is_thrust_speed_over_efficiency_plus_hotel() -> None:
    at = FIELD.operating_point
    expected_w = at.thrust_n * at.speed_mps / 0.45 + 60.0
    voltage_v, current_a = battery.load(PACK, 0.5, 6.5 * at.thrust_fraction)
    assert voltage_v * current_a == pytest.approx(expected_w)
    assert voltage_v == pytest.approx(8 * 3.84 - 0.06 * current_a)
    half_w = math.prod(battery.load(PACK, 0.5, 0.5 * 6.5 * at.thrust_fraction)) - 60.0
    assert half_w == pytest.approx((expected_w - 60.0) / 8.0)


def test_a_pack_is_empty_after_its_capacity_was_drawn_and_its_voltage_falls_on_the_way() -> None:
    stream, memory, reports = chance(7), battery.initial_state(PACK, 1.0, chance(7)), []
    truth = AT_REST._replace(propeller_rps=3.77)
    for second in range(60_000):
        memory, report = battery.sample(
            PACK, truth._replace(time_us=second * 1_000_000), memory, stream
        )
        assert report is not None
        reports.append(report)
        if memory.charge == 0.0:
            break
    drawn_ah = sum(report.current_a for report in reports) / 3600.0
    assert drawn_ah == pytest.approx(51.0 * memory.gauge_scale, rel=1e-3)
    assert reports[-1].remaining == pytest.approx(max(0.0, 1.0 - memory.gauge_scale), abs=1e-3)
    assert reports[0].voltage_v > 33.0 > 27.0 > reports[-1].voltage_v


def test_a_scenario_can_begin_on_a_half_empty_battery() -> None:
    half = Scenario(start=scenario.StartTable(battery_pct=50.0))
    _, reading = plant.initial_state(plant.build(FIELD, half), plant.random_streams(1))
    assert reading.battery is not None
    assert reading.battery.remaining == pytest.approx(0.5, abs=0.03)


def test_the_leak_detector_says_what_is_in_the_bilge_once_a_second() -> None:
    detector, stream, memory, heard = leak.build(SHELF.leak["probe"], TICK_US), chance(1), (), []
    for truth in ticks(AT_REST, 150):
        memory, said = leak.sample(
            detector, truth._replace(flooding=truth.time_us > 1_500_000), memory, stream
        )
        heard += [said.wet] if said else []
    assert heard == [False, False, True]


def test_encoders_read_the_true_angle_in_steps_as_a_fraction_of_the_travel() -> None:
    encoders = encoder.build(SHELF.encoder["as5048"], 15.0, TICK_US)._replace(
        timing=Timing(TICK_US, 0, 0.0)
    )
    truth, stream = (
        AT_REST._replace(rudder_rad=math.radians(7.5), elevator_rad=math.radians(-3.0)),
        chance(1),
    )
    heard = []
    for _ in range(4000):
        _, duct = encoder.sample(encoders, truth, encoder.EncoderState(), stream)
        assert duct is not None
        heard.append((15.0 * duct.rudder, 15.0 * duct.elevator))
    told = np.array(heard)
    np.testing.assert_allclose(told.mean(axis=0), (7.5, -3.0), atol=0.005)
    assert told[:, 0].std() == pytest.approx(math.hypot(0.06, 0.0219 / math.sqrt(12.0)), rel=0.05)
    steps = told / 0.0219
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def _gps_draws(stream: Any) -> None:
    gps.sample(
        gps.build(SHELF.gps["neo-m8"], TICK_US),
        moving((0.0,) * 3, 0.2),
        SEA,
        gps.GpsState(),
        stream,
    )


def _altimeter_draws(stream: Any) -> None:
    altimeter.sample(altimeter.build(SHELF.altimeter["va500"], TICK_US), AT_REST, SEA, (), stream)


@pytest.mark.parametrize("draw", [_gps_draws, _altimeter_draws])
def test_a_tick_in_which_an_instrument_is_not_due_draws_nothing(
    draw: Callable[[Any], None],
) -> None:
    idle, busy = chance(9), chance(9)
    sounder = altimeter.build(SHELF.altimeter["va500"], TICK_US)
    altimeter.sample(sounder, AT_REST._replace(time_us=TICK_US), SEA, (), idle)
    draw(busy)
    assert idle.normal() == chance(9).normal()
    assert busy.normal() != chance(9).normal()


def test_every_sheet_can_be_carried() -> None:
    vehicle = config.load("caribou_nominal")
    for kind in (
        "imu",
        "magnetometer",
        "pressure",
        "gps",
        "dvl",
        "altimeter",
        "battery",
        "leak",
        "encoder",
    ):
        for name in getattr(SHELF, kind):
            carried = config.Instruments(**{kind: name})
            assert datasheets.find(kind, getattr(SHELF, kind), carried, vehicle.name) is not None
