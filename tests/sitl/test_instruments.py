"""Each sensor against its data sheet: wander, latency, dropout, range and limits."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.random import default_rng

from mavlink_io import jit
from mavlink_io.frames import quaternion_from_euler
from mavlink_io.records import Dvl, SensorFrame
from mavlink_io.tick import TICK_S, TICK_US
from sitl import scenario
from sitl.core import environment, plant
from sitl.core.draws import AT_START, PER_TICK
from sitl.core.environment import Environment
from sitl.core.sensors import (
    Sensors,
    altimeter,
    battery,
    datasheets,
    devices,
    dvl,
    encoder,
    gps,
    inertial,
    leak,
    noise,
    sample_timing,
)
from sitl.core.sensors.devices import DeviceStreams, SimulatedDevices
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.core.truth import Truth
from sitl.environment_schema import FloorTable
from sitl.scenario import Scenario
from sitl.vehicle import config
from tests.sitl.core.test_sensors import AT_REST, SEA, TRUE_VEHICLE

TICK_US = TICK_US
CATALOGUE = datasheets.catalogue()


EVERY_TICK = Timing(TICK_US, 0, 0.0)
NO_FRAME = SensorFrame(0, *(0.0,) * 13, 0, 0)


def noise_stream(seed: int) -> NoiseStream:
    return noise.noise_stream(default_rng(seed))


class Fitted:
    """Slower sensors by name, with their states and readings in transit."""

    def __init__(
        self, *, sea: Environment = SEA, seed: int = 1, charge: float = 1.0, **sensors: Any
    ) -> None:
        fitted = SimulatedDevices(**sensors)
        layout = devices.device_slots(fitted)
        self.values = np.zeros(devices.size(layout))
        self.parts = devices.parts(self.values)
        self.parts.battery[battery.CHARGE] = charge
        generators = [default_rng((seed, k)) for k in range(len(DeviceStreams._fields))]
        streams = devices.streams(generators)
        devices.begin(fitted, streams, self.values)
        around = sea.surroundings
        compiled = jit.machine_code(
            devices.sample, fitted, layout, observed(AT_REST), around, streams, self.values
        )

        def sample(motion: TrueMotion) -> int:
            return compiled(fitted, layout, motion, around, streams, self.values)

        self._sample = sample

    def sample(self, truth: Truth) -> Sensors:
        """Return the new readings of a tick."""
        new = self._sample(observed(truth))
        numbers = devices.latest(self.values).tolist()
        return Sensors(NO_FRAME, *devices.records(new, numbers))


def observed(truth: Truth) -> TrueMotion:
    """Return what the slower sensors observe of a true motion."""
    return TrueMotion._make(getattr(truth, name) for name in TrueMotion._fields)


def deep(floor_depth_m: float) -> Environment:
    return environment.build(Scenario(floor=FloorTable(depth_m=floor_depth_m)), 9.81, TICK_S)


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


class ImuAtRest:
    """An IMU at rest, with its errors and readings in transit."""

    def __init__(self, imu: inertial.Imu, seed: int) -> None:
        self.imu, self.draws = imu, plant.random_streams(seed).draws
        self.draws.prepare(AT_START)
        self.errors, bias = inertial.initial_errors(imu, self.draws)
        self.bias, self.latest = np.array(bias), np.zeros(inertial.READING)
        self.transit = np.zeros((sample_timing.slots(imu.timing), inertial.READING))

    def sample(self, time_us: int) -> bool:
        """Sample at a vehicle time; return whether the latest reading is new."""
        self.draws.prepare(PER_TICK)
        return inertial.sample(
            self.imu,
            self.errors,
            AT_REST.specific_force_mps2,
            AT_REST.rates_radps,
            time_us,
            self.bias,
            self.transit,
            self.latest,
            self.draws.table,
        )


def test_gyro_allan_deviation_matches_data_sheet() -> None:
    """White noise gives N / sqrt(2 tau) for the one-sided density N; the wander peaks at 1.89 T."""
    sheet = CATALOGUE.imu["mti-300"]
    resting, rates, wander = ImuAtRest(inertial.build(sheet, TICK_US), 11), [], []
    for tick in range(50 * 600):
        resting.sample(tick * TICK_US)
        rates.append(resting.latest[3:].copy())
    noise = np.mean([allan_deviation(axis, 50) for axis in np.array(rates).T])
    assert noise == pytest.approx(math.radians(0.01) / math.sqrt(2.0), rel=0.1)
    for second in range(60_000):
        resting.sample(second * 1_000_000)
        wander.append(resting.bias[:3].copy())
    peak = np.mean(
        [allan_deviation(axis, round(1.89 * sheet.wander_time_s)) for axis in np.array(wander).T]
    )
    assert math.degrees(peak) * 3600.0 == pytest.approx(10.0, rel=0.2)
    lag = round(sheet.wander_time_s)
    values = np.array(wander) - np.mean(wander, axis=0)
    correlation = np.mean(values[lag:] * values[:-lag]) / np.mean(values**2)
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.12)


def arrivals(when: Timing, count: int, stream: NoiseStream) -> list[tuple[int, int]]:
    """Return times of measurement and arrival of the readings of a number of ticks."""
    transit, latest, received = np.zeros((sample_timing.slots(when), 1)), np.zeros(1), []
    for time_us in range(0, count * TICK_US, TICK_US):
        if sample_timing.is_due(when, time_us):
            reading = sample_timing.row(when, transit, time_us)
            reading[0] = time_us
            sample_timing.lose(when, reading, stream)
        if sample_timing.deliver(when, transit, time_us, latest):
            received.append((int(latest[0]), time_us))
    return received


@pytest.mark.parametrize("latency_ticks", [0, 1, 7])
def test_reading_arrives_after_latency(latency_ticks: int) -> None:
    when = sample_timing.timing(10.0, latency_ticks * 0.02, 0.0, TICK_US)
    received = arrivals(when, 40, noise_stream(1))
    assert [measured for measured, _ in received] == [k * 100_000 for k in range(len(received))]
    assert {arrived - measured for measured, arrived in received} == {latency_ticks * TICK_US}
    assert len(received) == len(range(0, 40 - latency_ticks, 5))


@pytest.mark.parametrize("dropout", [0.01, 0.3])
def test_dropout_rate_matches_data_sheet(dropout: float) -> None:
    when, count = sample_timing.timing(50.0, 0.04, dropout, TICK_US), 20_000
    lost = count - 2 - len(arrivals(when, count, noise_stream(2)))
    spread = math.sqrt(count * dropout * (1.0 - dropout))
    assert abs(lost - count * dropout) < 4.0 * spread


def test_missing_imu_sample_keeps_latest_and_is_not_new() -> None:
    imu = inertial.build(CATALOGUE.imu["mti-300"], TICK_US)
    resting = ImuAtRest(imu._replace(timing=Timing(TICK_US, 2 * TICK_US, 0.5)), 4)
    before, seen = resting.latest.copy(), []
    for tick in range(400):
        fresh = resting.sample(tick * TICK_US)
        assert fresh == (resting.latest != before).any()
        before = resting.latest.copy()
        seen.append(fresh)
    assert seen[:2] == [False, False]
    assert 140 < sum(seen) < 260


@pytest.mark.parametrize("latency_ticks", [0, 1, 7])
def test_imu_reading_arrives_after_latency(latency_ticks: int) -> None:
    """Reference: an IMU with the same errors whose readings arrive at once."""
    imu = inertial.build(CATALOGUE.imu["mti-300"], TICK_US)
    at_once = ImuAtRest(imu._replace(timing=Timing(3 * TICK_US, 0, 0.0)), 5)
    late = ImuAtRest(imu._replace(timing=Timing(3 * TICK_US, latency_ticks * TICK_US, 0.0)), 5)
    expected: dict[int, tuple[float, ...]] = {}
    arrived: dict[int, tuple[float, ...]] = {}
    for tick in range(40):
        for resting, readings, delay in ((at_once, expected, latency_ticks), (late, arrived, 0)):
            if resting.sample(tick * TICK_US):
                readings[tick + delay] = tuple(resting.latest.tolist())
    assert len(arrived) > 9
    assert arrived == {tick: reading for tick, reading in expected.items() if tick < 40}


GPS = gps.build(CATALOGUE.gps["neo-m8"], TICK_US)


class Receiver:
    """A satellite receiver with adjustable depth of the antenna."""

    def __init__(self) -> None:
        self.fitted, self.time_us = Fitted(gps=GPS), 0

    def fixes(self, seconds: float, depth_m: float) -> list[int]:
        """Return the fix types received in a number of seconds at a depth."""
        received = []
        for _ in range(round(seconds / TICK_S)):
            truth = moving((0.0, 0.0, 0.0), depth_m, time_us=self.time_us)
            fix = self.fitted.sample(truth).gps
            self.time_us += TICK_US
            received += [fix.fix_type] if fix else []
        return received


def test_gps_fix_at_surface_and_no_fix_submerged() -> None:
    receiver = Receiver()
    assert receiver.fixes(2.0, depth_m=0.2) == [gps.FIX_3D] * 10
    assert receiver.fixes(2.0, depth_m=0.6) == [gps.NO_FIX] * 10


@pytest.mark.parametrize(("dive_s", "to_fix_s"), [(60.0, 1.0), (7300.0, 26.0)])
def test_gps_fix_after_surfacing_takes_start_time(dive_s: float, to_fix_s: float) -> None:
    receiver = Receiver()
    receiver.fixes(1.0, depth_m=0.2)
    receiver.fixes(1.0, depth_m=3.0)
    receiver.time_us += round(dive_s * 1e6)
    received = receiver.fixes(30.0, depth_m=0.2)
    searching = round(5 * to_fix_s)
    assert received == [gps.NO_FIX] * searching + [gps.FIX_3D] * (150 - searching)


def test_gps_errors_match_reported_accuracy() -> None:
    fitted, fixes = Fitted(gps=GPS, seed=8), []
    for _ in range(3000):
        fix = fitted.sample(moving((0.3, -0.4, 0.0), 0.2)).gps
        assert fix is not None
        fixes.append(fix)
    north_m = (np.array([fix.lat_deg for fix in fixes]) - SEA.latitude_deg) * 111_195
    assert north_m.std() == pytest.approx(fixes[0].eph_m, rel=0.06)
    assert np.std([fix.alt_m for fix in fixes]) == pytest.approx(fixes[0].epv_m, rel=0.06)
    assert np.mean([fix.velocity_east_mps for fix in fixes]) == pytest.approx(-0.4, abs=0.005)


def pings(
    truth: Truth, sea: Environment, count: int = 1, name: str = "a50", **changes: Any
) -> list[Dvl | None]:
    """Return the readings of a number of pings, without latency and dropout."""
    log = dvl.build(CATALOGUE.dvl[name], TICK_US)
    log = log._replace(timing=EVERY_TICK, water_period_us=TICK_US, **changes)
    fitted = Fitted(sea=sea, seed=5, dvl=log)
    fitted.parts.dvl[:] = 1.0, 0.0  # neither scale error nor misalignment
    return [fitted.sample(truth).dvl for _ in range(count)]


def columns(received: list[Dvl | None]) -> Any:
    return np.array([velocity[1:4] for velocity in received if velocity is not None])


def test_bottom_track_velocity_and_noise() -> None:
    attitude = quaternion_from_euler(0.0, 0.0, math.radians(90.0))
    truth = moving((0.3, 1.2, 0.1), attitude_q=attitude, water_velocity_ned_mps=(0.5, 0.5, 0.0))
    received = pings(truth, SEA, 4000)
    assert all(velocity is not None and velocity.over_ground for velocity in received)
    np.testing.assert_allclose(np.median(columns(received), axis=0), (1.2, -0.3, 0.1), atol=2e-3)
    middle = np.sort(columns(received)[:, 0])[40:-40]
    assert middle.std() == pytest.approx(CATALOGUE.dvl["a50"].noise_mps, rel=0.1)


@pytest.mark.parametrize(
    ("floor_m", "tracks"),
    [(55.0, "bottom"), (55.2, "water"), (5.2, "bottom"), (5.04, "nothing"), (5000.0, "water")],
)
def test_dvl_changes_to_water_track_at_range_limit(floor_m: float, tracks: str) -> None:
    """The altitude limit is 50 m; 4 cm are too short for an echo and for a layer of water."""
    truth = moving((1.0, 0.0, 0.0), water_velocity_ned_mps=(0.4, 0.0, 0.0))
    (velocity,) = pings(truth, deep(floor_m))
    if tracks == "nothing":
        assert velocity is None
        return
    assert velocity is not None
    assert velocity.over_ground == (tracks == "bottom")
    assert velocity.velocity_x_mps == pytest.approx(1.0 if tracks == "bottom" else 0.6, abs=0.25)


def test_bottom_track_needs_three_beams() -> None:
    rolled = quaternion_from_euler(math.radians(20.0), math.radians(20.0), 0.0)
    truth = moving((0.0, 0.0, 0.0), attitude_q=rolled, depth_m=5.0)
    kinds = {}
    for floor_m in (30.0, 44.0, 52.0):
        (velocity,) = pings(truth._replace(velocity_ned_mps=(1.0, 0.5, 0.0)), deep(floor_m))
        assert velocity is not None
        kinds[floor_m] = velocity.over_ground, velocity.quality_pct
    assert kinds == {30.0: (True, 100), 44.0: (True, 75), 52.0: (False, 100)}


def test_bottom_track_is_lost_at_large_tilt() -> None:
    steep = quaternion_from_euler(0.0, math.radians(36.0), 0.0)
    (velocity,) = pings(moving((1.0, 0.0, 0.0), attitude_q=steep), SEA)
    assert velocity is not None
    assert not velocity.over_ground


def test_outlier_increases_figure_of_merit() -> None:
    sheet = CATALOGUE.dvl["a50"]
    received = [v for v in pings(moving((1.0, 0.0, 0.0)), SEA, 20_000) if v is not None]
    astray = [v for v in received if math.hypot(v.velocity_x_mps - 1.0, v.velocity_y_mps) > 0.2]
    expected = sheet.outlier_chance * len(received)
    assert 0.5 * expected < len(astray) <= expected + 4.0 * math.sqrt(expected)
    assert min(v.figure_of_merit_mps for v in astray) > 0.1
    typical = [v.figure_of_merit_mps for v in received if v not in astray]
    assert np.median(typical) < 2.0 * sheet.noise_mps


def range_of(depth_m: float, pitch_deg: float, name: str = "echo-30m") -> float | None:
    sounder = altimeter.build(CATALOGUE.altimeter[name], TICK_US)._replace(timing=EVERY_TICK)
    attitude = quaternion_from_euler(0.0, math.radians(pitch_deg), 0.0)
    truth = moving((0.0, 0.0, 0.0), depth_m, attitude_q=attitude)
    echo = Fitted(altimeter=sounder).sample(truth).altimeter
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
def test_altimeter_range_within_limits(
    depth_m: float, pitch_deg: float, range_m: float | None
) -> None:
    assert range_of(depth_m, pitch_deg) == (
        None if range_m is None else pytest.approx(range_m, abs=0.08)
    )


def test_altimeter_outliers_are_short() -> None:
    sounder = altimeter.build(CATALOGUE.altimeter["va500"], TICK_US)._replace(timing=EVERY_TICK)
    fitted, ranges = Fitted(altimeter=sounder, seed=6), []
    for _ in range(20_000):
        echo = fitted.sample(AT_REST).altimeter
        assert echo is not None
        ranges.append(echo.range_m)
    astray = [r for r in ranges if abs(r - 15.0) > 0.1]
    expected = 20_000 * sounder.outlier_chance
    assert abs(len(astray) - expected) < 4.0 * math.sqrt(expected)
    assert max(astray) < 15.0


def test_altimeter_near_the_floor_with_outliers_has_no_echo() -> None:
    """Nearer than the shortest range, there is no room for an object before the floor."""
    sounder = altimeter.build(CATALOGUE.altimeter["va500"], TICK_US)
    certain = sounder._replace(timing=EVERY_TICK, outlier_chance=1.0, noise_m=0.0)
    echo = Fitted(altimeter=certain).sample(moving((0.0, 0.0, 0.0), depth_m=19.95)).altimeter
    assert echo is not None
    assert echo.range_m == sounder.min_range_m


PACK = battery.build(CATALOGUE.battery["lipo-1500wh"], TRUE_VEHICLE, full_rps=6.5, tick_us=TICK_US)


def test_battery_load_at_operating_point() -> None:
    at = TRUE_VEHICLE.operating_point
    expected_w = at.thrust_n * at.speed_mps / 0.45 + 60.0
    voltage_v, current_a = battery.load(PACK, 0.5, 6.5 * at.thrust_fraction)
    assert voltage_v * current_a == pytest.approx(expected_w)
    assert voltage_v == pytest.approx(8 * 3.84 - 0.06 * current_a)
    half_w = math.prod(battery.load(PACK, 0.5, 0.5 * 6.5 * at.thrust_fraction)) - 60.0
    assert half_w == pytest.approx((expected_w - 60.0) / 8.0)


def test_battery_is_empty_after_its_capacity() -> None:
    fitted, reports = Fitted(battery=PACK, seed=7), []
    truth = AT_REST._replace(propeller_rps=3.77)
    for second in range(60_000):
        report = fitted.sample(truth._replace(time_us=second * 1_000_000)).battery
        assert report is not None
        reports.append(report)
        if fitted.parts.battery[battery.CHARGE] == 0.0:
            break
    drawn_ah = sum(report.current_a for report in reports) / 3600.0
    gauge_scale = fitted.parts.battery[battery.GAUGE_SCALE]
    assert drawn_ah == pytest.approx(51.0 * gauge_scale, rel=1e-3)
    assert reports[-1].remaining == pytest.approx(max(0.0, 1.0 - gauge_scale), abs=1e-3)
    assert reports[0].voltage_v > 33.0 > 27.0 > reports[-1].voltage_v


def test_open_circuit_voltage_is_linear_between_points() -> None:
    """Reference: numpy.interp."""
    charges = [*np.linspace(-0.1, 1.1, 500), *PACK.charge_points]
    unloaded = PACK._replace(hotel_w=0.0)
    voltages = [battery.load(unloaded, charge, 0.0)[0] for charge in charges]
    expected = 8.0 * np.interp(charges, PACK.charge_points, PACK.open_circuit_cell_v)
    np.testing.assert_allclose(voltages, expected, rtol=1e-15)


def test_scenario_sets_initial_charge() -> None:
    half = Scenario(start=scenario.StartTable(battery_pct=50.0))
    _, reading = plant.initial_state(plant.build(TRUE_VEHICLE, half), plant.random_streams(1))
    assert reading.battery is not None
    assert reading.battery.remaining == pytest.approx(0.5, abs=0.03)


def test_leak_detector_reports_once_per_second() -> None:
    fitted, received = Fitted(leak=leak.build(CATALOGUE.leak["probe"], TICK_US)), []
    for truth in ticks(AT_REST, 150):
        report = fitted.sample(truth._replace(flooding=truth.time_us > 1_500_000)).leak
        received += [report.wet] if report else []
    assert received == [False, False, True]


def test_encoder_reads_quantised_true_angle() -> None:
    encoders = encoder.build(CATALOGUE.encoder["as5048"], 15.0, TICK_US)
    fitted = Fitted(encoder=encoders._replace(timing=EVERY_TICK, offset_rad=0.0))
    truth = AT_REST._replace(rudder_rad=math.radians(7.5), elevator_rad=math.radians(-3.0))
    received = []
    for _ in range(4000):
        duct = fitted.sample(truth).duct
        assert duct is not None
        received.append((15.0 * duct.rudder, 15.0 * duct.elevator))
    values = np.array(received)
    np.testing.assert_allclose(values.mean(axis=0), (7.5, -3.0), atol=0.005)
    assert values[:, 0].std() == pytest.approx(math.hypot(0.06, 0.0219 / math.sqrt(12.0)), rel=0.05)
    steps = values / 0.0219
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_sensor_not_due_draws_no_random_numbers() -> None:
    sounder = altimeter.build(CATALOGUE.altimeter["va500"], TICK_US)
    sounder = sounder._replace(timing=Timing(5 * TICK_US, 0, 0.0))
    fresh, idle, busy = (Fitted(altimeter=sounder) for _ in range(3))
    for tick in range(1, 5):
        assert idle.sample(AT_REST._replace(time_us=tick * TICK_US)).altimeter is None
    busy.sample(AT_REST)
    due = AT_REST._replace(time_us=5 * TICK_US)
    expected = fresh.sample(due).altimeter
    assert expected is not None
    assert idle.sample(due).altimeter == expected
    assert busy.sample(due).altimeter != expected


def test_every_data_sheet_can_be_fitted() -> None:
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
        for name in getattr(CATALOGUE, kind):
            fitted = config.Instruments(**{kind: name})
            assert datasheets.find(kind, getattr(CATALOGUE, kind), fitted, vehicle.name) is not None
