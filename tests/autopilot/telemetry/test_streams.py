"""Telemetry: schedule in vehicle time, equal for equal flights, correct signs and units."""

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.stream_rates import Schedule
from autopilot.control import modes
from autopilot.control.fence import Fence, Place, Zone
from autopilot.control.params import Config
from autopilot.control.sensor_health.types import Fault, FaultTracker, Health
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import (
    Ascent,
    AscentStage,
    AutopilotState,
    Home,
    Inputs,
    NavCovariance,
    Navigation,
    Trace,
    VehicleEstimate,
)
from autopilot.reports import Snapshot
from autopilot.telemetry.encoding import int16
from autopilot.telemetry.streams import STREAMS
from mavlink_io import dialect
from mavlink_io.codec import encode
from mavlink_io.records import (
    LOCKSTEP_FLAG,
    ActuatorFrame,
    Altimeter,
    Battery,
    GpsFix,
    Leak,
    SensorFrame,
)
from tests.helpers.fake_hil import TICK_US, Harness, Station, only, sensors

ATTITUDE, HOME = (dialect.by_name(n).message_id for n in ("ATTITUDE", "HOME_POSITION"))
SECOND_TICKS = 50


def message(name: str, snapshot: Snapshot) -> Any:
    """Return a stream's message as pymavlink decodes it."""
    (stream,) = (stream for stream in STREAMS if stream.message is dialect.by_name(name))
    frame = encode(stream.message, stream.build(snapshot), 0, 1, 1)
    (decoded,) = mavlink.MAVLink(None).parse_buffer(frame)
    return decoded


def snapshot(**estimate: Any) -> Snapshot:
    state = AutopilotState(
        time_us=12_340_000,
        armed=True,
        estimate=VehicleEstimate(initialised=True, **estimate),
        setpoint=Setpoint(depth_m=4.0, heading_rad=-1.0, thrust=0.58),
        home=Home(41.5, -70.7, True),
    )
    trace = Trace(depth_error_m=1.5, pitch_setpoint_rad=-0.1, thrust=0.58, rudder_rad=0.1)
    actuators = ActuatorFrame(12_340_000, LOCKSTEP_FLAG, (0.5, -0.25, 0.58, *(0.0,) * 13), 129)
    return Snapshot(state, trace, actuators, sensors(12_340_000), None, Config(), state.mode)


def test_battery_leak_altimeter_telemetry_equals_input() -> None:
    s = snapshot(altitude_m=12.5)._replace(
        altimeter=Altimeter(0, 12.4, 0.3, 30.0),
        battery=Battery(29.6, 4.25, 1.5, 0.42),
        leak=Leak(False),
    )
    status = message("SYS_STATUS", s)
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (
        29_600,
        425,
        42,
    )
    assert status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    for bits in ("present", "enabled", "health"):
        extended = getattr(status, f"onboard_control_sensors_{bits}_extended")
        assert extended == mavlink.MAV_SYS_STATUS_SENSOR_LEAK, bits
        assert (
            getattr(status, f"onboard_control_sensors_{bits}")
            & mavlink.MAV_SYS_STATUS_EXTENSION_USED
        )
    wet = message("SYS_STATUS", s._replace(leak=Leak(True)))
    assert (
        wet.onboard_control_sensors_enabled_extended,
        wet.onboard_control_sensors_health_extended,
    ) == (2, 0)
    gauge = message("BATTERY_STATUS", s)
    assert (gauge.voltages[0], gauge.current_battery, gauge.current_consumed) == (29_600, 425, 1500)
    assert gauge.battery_remaining == 42
    floor = message("DISTANCE_SENSOR", s)
    assert (floor.min_distance, floor.current_distance, floor.max_distance) == (30, 1250, 3000)


@pytest.mark.parametrize(("remaining", "state"), [(0.5, 1), (0.14, 2), (0.07, 3), (0.03, 4)])
def test_battery_charge_state_follows_remaining_charge(remaining: float, state: int) -> None:
    """States OK, LOW, CRITICAL, EMERGENCY: below FS_BATT_PCT, half of it, a quarter of it."""
    s = snapshot()._replace(battery=Battery(25.0, 4.0, 1.0, remaining))
    if state > 1:
        low = FaultTracker(Fault("Battery", "low"), 0, 12_000_000, reported=True)
        s = s._replace(state=s.state._replace(health=Health(faults=(low,))))
    assert message("BATTERY_STATUS", s).charge_state == state


@pytest.mark.parametrize(
    ("value", "number"),
    [(math.nan, -32_768), (math.inf, 32_767), (-math.inf, -32_768), (1.6, 2), (-40_000.0, -32_768)],
)
def test_numbers_are_limited_to_their_field(value: float, number: int) -> None:
    assert int16(value) == number


def test_missing_devices_are_unknown() -> None:
    status, gauge = message("SYS_STATUS", snapshot()), message("BATTERY_STATUS", snapshot())
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (
        65_535,
        -1,
        -1,
    )
    assert status.onboard_control_sensors_present_extended == 0
    assert not status.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    assert (set(gauge.voltages), gauge.current_battery, gauge.battery_remaining) == (
        {65_535},
        -1,
        -1,
    )


def test_depth_sign_per_message_is_correct() -> None:
    s = snapshot(depth_m=2.5, depth_rate_mps=0.3, speed_mps=1.3, altitude_m=17.5)
    assert message("GLOBAL_POSITION_INT", s).relative_alt == -2500
    assert message("GLOBAL_POSITION_INT", s).alt == -2500
    assert message("GLOBAL_POSITION_INT", s).vz == 30
    assert message("LOCAL_POSITION_NED", s).z == 2.5
    hud = message("VFR_HUD", s)
    assert (hud.alt, hud.climb, hud.throttle) == pytest.approx((-2.5, -0.3, 58))
    assert message("ALTITUDE", s).altitude_relative == -2.5
    assert message("ALTITUDE", s).bottom_clearance == 17.5
    assert message("DISTANCE_SENSOR", s).current_distance == 1750
    assert message("NAV_CONTROLLER_OUTPUT", s).alt_error == -1.5
    assert message("POSITION_TARGET_LOCAL_NED", s).z == 4.0
    assert message("HOME_POSITION", s).altitude == 0


def test_position_is_relative_to_home() -> None:
    reported = message("GLOBAL_POSITION_INT", snapshot(north_m=111.19, east_m=0.0))
    assert (reported.lat, reported.lon) == (pytest.approx(415_010_000, abs=20), -707_000_000)


@pytest.mark.parametrize(
    ("heading_rad", "centidegrees"), [(0.0, 0), (-0.5 * math.pi, 27_000), (-1e-6, 0), (3.0, 17_189)]
)
def test_heading_is_within_its_range(heading_rad: float, centidegrees: int) -> None:
    reported = message("GLOBAL_POSITION_INT", snapshot(heading_rad=heading_rad))
    assert reported.hdg == centidegrees
    assert 0 <= message("VFR_HUD", snapshot(heading_rad=heading_rad)).heading < 360


def test_actuators_are_in_their_channels() -> None:
    s = snapshot()
    outputs = message("ACTUATOR_OUTPUT_STATUS", s)
    assert outputs.active == 0b111
    assert list(outputs.actuator[:4]) == pytest.approx([0.5, -0.25, 0.58, 0.0])
    pulses = message("SERVO_OUTPUT_RAW", s)
    assert (pulses.servo1_raw, pulses.servo2_raw, pulses.servo3_raw, pulses.servo4_raw) == (
        1700,
        1400,
        1732,
        0,
    )


def test_position_target_masks_unused_fields() -> None:
    target = message("POSITION_TARGET_LOCAL_NED", snapshot())
    ignored = target.type_mask
    assert not ignored & mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    assert not ignored & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert ignored & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    assert ignored & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    attitude = message("ATTITUDE_TARGET", snapshot())
    w, x, y, z = attitude.q
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(-0.1, abs=1e-6)
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(-1.0, abs=1e-6)


def test_health_bits_match_client_requirements() -> None:
    status = message("SYS_STATUS", snapshot())
    for name in ("3D_GYRO", "3D_ACCEL", "3D_MAG", "GPS"):
        bit = getattr(mavlink, f"MAV_SYS_STATUS_SENSOR_{name}")
        assert status.onboard_control_sensors_present & status.onboard_control_sensors_health & bit
    assert status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_GEOFENCE


@pytest.mark.parametrize("stage", AscentStage)
def test_sys_status_has_the_stage_of_surface(stage: AscentStage) -> None:
    """After the first stage the depth is not controlled any more."""
    at = snapshot()
    rising = at.state._replace(mode=modes.SURFACE.number, ascent=Ascent(4.0, 0, stage=stage))
    depth_bit = mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    status = message("SYS_STATUS", at._replace(state=rising))
    assert status.errors_count1 == stage
    healthy = status.onboard_control_sensors_health & depth_bit
    assert bool(healthy) == (stage == AscentStage.POWERED)
    other_mode = message("SYS_STATUS", at._replace(state=rising._replace(mode=modes.HOLD.number)))
    assert other_mode.errors_count1 == 0
    assert other_mode.onboard_control_sensors_health & depth_bit


@pytest.mark.parametrize(("north_m", "outside"), [(0.0, 0), (150.0, 1)])
def test_fence_status_has_present_state_and_history(north_m: float, outside: int) -> None:
    at = snapshot(north_m=north_m)
    zone = Zone(True, (Place(at.state.home.lat_deg, at.state.home.lon_deg),), 100.0)
    breached = at.state._replace(
        fence=Fence(zones=(zone,)), fence_breaches=2, fence_breach_us=12_000_000
    )
    status = message("FENCE_STATUS", at._replace(state=breached))
    assert (status.breach_status, status.breach_count, status.breach_time) == (outside, 2, 12_000)
    assert status.breach_type == mavlink.FENCE_BREACH_BOUNDARY
    never = message("FENCE_STATUS", at)
    assert (never.breach_status, never.breach_count, never.breach_type) == (0, 0, 0)


ESTIMATES = st.builds(
    VehicleEstimate,
    *(st.just(VehicleEstimate().attitude), *[st.floats(-3.2, 3.2)] * 6, st.just((0.0, 0.0, 0.0))),
    depth_m=st.floats(-1e7, 1e7),
    depth_rate_mps=st.floats(-1e4, 1e4),
    accel_bias_mps2=st.just(0.0),
    speed_mps=st.floats(-10, 10),
    north_m=st.floats(-1e5, 1e5),
    east_m=st.floats(-1e5, 1e5),
    north_rate_mps=st.floats(-1e4, 1e4),
    east_rate_mps=st.floats(-1e4, 1e4),
    position_sd_m=st.floats(0, 1e4),
    altitude_m=st.one_of(st.just(math.nan), st.floats(0, 1e6)),
    altitude_time_us=st.just(0),
    initialised=st.booleans(),
    navigation=st.builds(
        Navigation,
        current_mps=st.complex_numbers(max_magnitude=1e4, allow_nan=False),
        speed_error=st.just(0j),
        dvl_error=st.just(0j),
        slip=st.just(0j),
        slip_sd_mps=st.floats(0, 1e4),
        covariance=st.builds(
            NavCovariance,
            *(st.floats(0, 1e8) for _ in range(4)),
            *(st.just(0j) for _ in range(6)),
        ),
        span_s=st.just(0.0),
        distance_m=st.just(0j),
        fix_us=st.just(-1),
        ping_us=st.integers(-1, 20_000_000),
        over_ground=st.booleans(),
        fixes_rejected=st.integers(0, 99),
        pings_rejected=st.just(0),
    ),
)


@given(ESTIMATES)
def test_extreme_estimates_fit_every_field(estimate: VehicleEstimate) -> None:
    """Packing raises struct.error for a number outside the range of its field."""
    plain = snapshot()
    s = plain._replace(state=plain.state._replace(estimate=estimate))
    for stream in STREAMS:
        stream.message.pack(stream.build(s))


@pytest.mark.parametrize("nonsense", [math.nan, 1e12, -1e12])
def test_invalid_state_does_not_block_messages(nonsense: float) -> None:
    plain = snapshot()
    estimate = VehicleEstimate._make(
        nonsense if isinstance(value, float) else value for value in plain.state.estimate
    )
    state = plain.state._replace(
        estimate=estimate,
        setpoint=Setpoint(nonsense, nonsense, nonsense),
    )
    s = plain._replace(
        state=state,
        trace=Trace(*[nonsense] * len(Trace._fields)),
        actuators=plain.actuators._replace(controls=(nonsense,) * 16),
        altimeter=Altimeter(0, nonsense, nonsense, nonsense),
        battery=Battery(1e5, 1e5, math.nan, math.nan),
        fix=GpsFix(
            0, 3, 41.5, -70.7, nonsense, nonsense, nonsense, nonsense, 9, nonsense, nonsense
        ),
    )
    for stream in STREAMS:
        for build in stream.builders:
            stream.message.pack(build(s))


def test_every_message_can_be_built_before_first_tick() -> None:
    harness = Harness()
    for stream in STREAMS:
        reported = [
            m
            for m in harness.command(512, stream.message.message_id)
            if m.get_type() == stream.message.name
        ]
        assert len(reported) == len(stream.builders)


def counts(harness: Harness, ticks: int) -> dict[str, int]:
    harness.station.pop_received()
    harness.tick(ticks)
    received = [m.get_type() for m in harness.station.pop_received()]
    return {name: received.count(name) for name in received}


def test_every_stream_has_default_rate() -> None:
    harness = Harness()
    harness.tick()
    seen = counts(harness, 10 * SECOND_TICKS)
    for stream in STREAMS:
        assert seen.get(stream.message.name, 0) == round(10 * stream.rate_hz), stream.message.name


def test_client_can_set_rates() -> None:
    harness = Harness()
    harness.tick()
    harness.command(511, ATTITUDE, 20_000)
    harness.command(511, HOME, -1)
    assert only(harness.command(510, ATTITUDE), "MESSAGE_INTERVAL").interval_us == 20_000
    assert only(harness.command(510, HOME), "MESSAGE_INTERVAL").interval_us == -1
    seen = counts(harness, 10 * SECOND_TICKS)
    assert (seen["ATTITUDE"], "HOME_POSITION" in seen) == (500, False)
    harness.command(511, ATTITUDE, 0)
    assert counts(harness, 10 * SECOND_TICKS)["ATTITUDE"] == 100
    refused = only(harness.command(511, 99_999, 20_000), "COMMAND_ACK")
    assert refused.result == mavlink.MAV_RESULT_UNSUPPORTED


def test_links_have_own_rates_and_sequences() -> None:
    harness = Harness(Station(255, 190), Station(250, 190))
    harness.tick()
    harness.command(511, ATTITUDE, 20_000)
    for station in harness.stations:
        station.pop_received()
    harness.tick(10 * SECOND_TICKS)
    first, second = (station.pop_received() for station in harness.stations)
    assert [sum(m.get_type() == "ATTITUDE" for m in received) for received in (first, second)] == [
        500,
        100,
    ]
    for received in (first, second):
        numbers = [m.get_seq() for m in received]
        assert numbers == [(numbers[0] + n) % 256 for n in range(len(numbers))]


def test_report_of_tick_gives_the_messages_of_the_state() -> None:
    harness = Harness()
    harness.tick(60)
    report, state = harness.vehicle.report(), harness.vehicle.snapshot()
    of_tick = [stream for stream in STREAMS if stream.of_tick]
    assert {s.rate_hz for s in STREAMS if s.rate_hz > 2} <= {s.rate_hz for s in of_tick}
    for stream in of_tick:
        assert repr(stream.build(report)) == repr(stream.build(state)), stream.message.name


def due_ids(schedule: Schedule, time_us: int) -> list[int]:
    return [
        stream.message.message_id for group in schedule.due(time_us) for stream in group.streams
    ]


@given(st.integers(0, 10_000), st.integers(1, 200).map(lambda n: n * 10_000), st.integers(1, 400))
def test_stream_phase_is_independent_of_request_time(
    start: int, interval_us: int, ticks: int
) -> None:
    schedule = Schedule()
    schedule.due(start * TICK_US)
    schedule.set_interval(ATTITUDE, interval_us)
    times = [(start + n) * TICK_US for n in range(1, ticks)]
    due = [t for t in times if ATTITUDE in due_ids(schedule, t)]
    assert due == [t for t in times if t // interval_us > (t - TICK_US) // interval_us]


def telemetry_of_a_flight(chatter: bool) -> list[bytes]:
    harness = Harness()
    harness.tick()
    harness.command(511, ATTITUDE, 20_000)
    if chatter:
        harness.command(512, 148)
        harness.serve()
    harness.command(400, 1)
    harness.command(176, 1, 2)
    harness.station.pop_received()
    harness.tick(5 * SECOND_TICKS, depth_m=1.0)
    return [bytes(m.get_payload()) for m in harness.station.pop_received()]


def test_equal_flights_give_equal_bytes() -> None:
    assert telemetry_of_a_flight(chatter=False) == telemetry_of_a_flight(chatter=True)


def test_telemetry_precedes_texts_of_same_tick() -> None:
    harness = Harness()
    harness.tick()
    harness.command(511, ATTITUDE, 20_000)
    harness.station.pop_received()
    harness.vehicle.send_statustext("in this tick")
    harness.tick()
    kinds = [m.get_type() for m in harness.station.pop_received()]
    assert kinds.index("ATTITUDE") < kinds.index("STATUSTEXT")


def test_time_restart_sets_new_phase() -> None:
    schedule = Schedule()
    schedule.due(0)
    assert schedule.due(10_000_000)
    assert schedule.due(0) == []
    assert due_ids(schedule, 100_000)[:1] == [ATTITUDE]


def test_out_of_range_numbers_are_sent_as_nearest_value() -> None:
    """Limits of int32 and uint16, and the largest finite float32 (IEEE 754)."""
    harness = Harness()
    (link,) = harness.server.links
    message = dialect.by_name("COMMAND_ACK")
    link.write(message, (1 << 20, 300, -1, 1 << 40, 0, 0))
    link.write(dialect.by_name("GPS_GLOBAL_ORIGIN"), (1 << 63, -(1 << 63), 0, -5))
    link.write(dialect.by_name("ATTITUDE"), (1 << 33, 1e300, -1e300, math.nan, math.inf, 0.0, 0.0))
    harness.server.flush()
    ack, origin, attitude = harness.station.pop_received()
    assert (ack.command, ack.result, ack.progress, ack.result_param2) == (
        0xFFFF,
        255,
        0,
        (1 << 31) - 1,
    )
    assert (origin.latitude, origin.longitude, origin.time_usec) == ((1 << 31) - 1, -(1 << 31), 0)
    largest = 3.4028234663852886e38
    assert (attitude.time_boot_ms, attitude.roll, attitude.pitch) == (
        0xFFFF_FFFF,
        largest,
        -largest,
    )
    assert math.isnan(attitude.yaw)
    assert attitude.rollspeed == math.inf
    assert (
        attitude.get_seq() == (origin.get_seq() + 1) & 0xFF == (ack.get_seq() + 2) & 0xFF
    )  # no gap


def test_values_of_wrong_shape_raise() -> None:
    (link,) = Harness().server.links
    with pytest.raises(struct.error):
        link.write(dialect.by_name("SYSTEM_TIME"), (0.5, 0))


@given(
    st.lists(
        st.sampled_from([math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 0.0]),
        min_size=13,
        max_size=13,
    )
)
def test_any_sensor_value_allows_tick_and_telemetry(values: list[float]) -> None:
    harness = Harness()
    harness.tick(3)
    state = harness.vehicle.state
    harness.time_us += TICK_US
    time_us, rest = harness.time_us, sensors(harness.time_us)[14:]
    reading = SensorFrame._make((time_us, *values, *rest))
    for _ in range(3):
        reading = reading._replace(time_us=harness.time_us)
        frame = harness.vehicle.tick(Inputs(reading, None, None, None))
        assert all(map(math.isfinite, frame.controls))
        for stream in STREAMS:
            for build in stream.builders:
                stream.message.pack(build(harness.vehicle.snapshot()))
        harness.time_us += TICK_US
    assert state.estimate.initialised
