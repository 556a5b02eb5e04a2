"""Round trips of the devices' records, and their messages as pymavlink decodes them."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_io import device_messages
from mavlink_io.codec import Framer, encode
from mavlink_io.dialect import Message, MessageType, Values
from mavlink_io.records import Battery, DuctFeedback, Dvl, Leak

SPEED = st.floats(-5.0, 5.0, width=32)


def across(message: MessageType, values: Values) -> Message:
    (frame,) = Framer().feed(encode(message, values, 0, 1, 1))
    return frame.decode()


def decoded(message: MessageType, values: Values) -> Any:
    (read,) = mavlink.MAVLink(None).parse_buffer(encode(message, values, 0, 1, 1))
    return read


@given(
    st.builds(
        Dvl,
        st.integers(0, 10**13),
        SPEED,
        SPEED,
        SPEED,
        st.booleans(),
        st.floats(0.001, 3.0),
        st.integers(1, 100),
    )
)
def test_dvl_round_trip_is_equal(dvl: Dvl) -> None:
    decoded = device_messages.dvl_record(
        across(device_messages.ODOMETRY, device_messages.dvl_values(dvl))
    )
    assert decoded._replace(figure_of_merit_mps=0.0) == dvl._replace(figure_of_merit_mps=0.0)
    assert decoded.figure_of_merit_mps == pytest.approx(dvl.figure_of_merit_mps, rel=1e-5)


@pytest.mark.parametrize(
    ("over_ground", "frame"),
    [(True, mavlink.MAV_FRAME_LOCAL_FRD), (False, mavlink.MAV_FRAME_BODY_FRD)],
)
def test_dvl_frame_id_gives_reference_of_velocity(over_ground: bool, frame: int) -> None:
    m = decoded(
        device_messages.ODOMETRY,
        device_messages.dvl_values(Dvl(7, 1.25, -0.5, 0.0, over_ground, 0.25, 75)),
    )
    assert (m.frame_id, m.child_frame_id) == (frame, mavlink.MAV_FRAME_BODY_FRD)
    assert all(
        math.isnan(value) for value in (m.x, m.y, m.z, m.rollspeed, m.pose_covariance[0], *m.q)
    )
    assert [m.velocity_covariance[i] for i in (0, 6, 11)] == pytest.approx([0.0625] * 3)
    assert (m.vx, m.vy, m.quality) == (1.25, -0.5, 75)


def test_dvl_odometry_without_body_velocity_is_no_record() -> None:
    values = device_messages.ODOMETRY.record._make(
        device_messages.dvl_values(Dvl(7, 1.0, 0.0, 0.0, True, 0.1, 100))
    )
    in_the_world = values._replace(child_frame_id=mavlink.MAV_FRAME_LOCAL_NED)
    assert device_messages.has_velocity(across(device_messages.ODOMETRY, values))
    assert not device_messages.has_velocity(across(device_messages.ODOMETRY, in_the_world))


@given(
    st.builds(
        Battery,
        st.floats(0.0, 500.0),
        st.floats(0.0, 300.0),
        st.floats(0.0, 1000.0),
        st.floats(0.0, 1.0),
    ),
)
def test_battery_round_trip_is_within_resolution(battery: Battery) -> None:
    decoded = device_messages.battery_record(
        across(device_messages.BATTERY_STATUS, device_messages.battery_values(battery))
    )
    for value, original, step in zip(decoded, battery, (1e-3, 1e-2, 1e-3, 1e-2), strict=True):
        assert value == pytest.approx(original, abs=0.51 * step)


def test_battery_without_a_cell_voltage_is_no_record() -> None:
    values = device_messages.battery_values(Battery(24.0, 1.0, 0.0, 1.0))
    known = device_messages.BATTERY_STATUS.record._make(values)
    unknown = known._replace(voltages=(device_messages.UNKNOWN_U16,) * 10)
    assert device_messages.has_voltage(across(device_messages.BATTERY_STATUS, known))
    assert not device_messages.has_voltage(across(device_messages.BATTERY_STATUS, unknown))


def test_battery_unknown_values_stay_unknown() -> None:
    unknown = Battery(24.0, math.nan, math.nan, math.nan)
    decoded = device_messages.battery_record(
        across(device_messages.BATTERY_STATUS, device_messages.battery_values(unknown))
    )
    assert decoded.voltage_v == 24.0
    assert all(math.isnan(value) for value in decoded[1:])


@pytest.mark.parametrize("wet", [True, False])
def test_leak_detector_is_healthy_while_dry(wet: bool) -> None:
    m = decoded(device_messages.SYS_STATUS, device_messages.leak_values(Leak(wet)))
    assert m.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_EXTENSION_USED
    assert m.onboard_control_sensors_present_extended == mavlink.MAV_SYS_STATUS_SENSOR_LEAK
    assert (
        bool(m.onboard_control_sensors_health_extended & mavlink.MAV_SYS_STATUS_SENSOR_LEAK)
        is not wet
    )
    assert device_messages.leak_record(
        across(device_messages.SYS_STATUS, device_messages.leak_values(Leak(wet)))
    ) == Leak(wet)


def test_leak_status_without_detector_is_no_record() -> None:
    other = device_messages.SYS_STATUS.record._make(device_messages.leak_values(Leak(False)))
    silent = other._replace(onboard_control_sensors_present_extended=0)
    assert device_messages.has_leak_detector(across(device_messages.SYS_STATUS, other))
    assert not device_messages.has_leak_detector(across(device_messages.SYS_STATUS, silent))


def test_duct_angles_are_in_command_channels() -> None:
    duct = DuctFeedback(40_000, 0.5, -0.25)
    m = decoded(device_messages.ACTUATOR_OUTPUTS, device_messages.duct_values(duct))
    assert (m.active, m.actuator[0], m.actuator[1]) == (0b11, 0.5, -0.25)
    assert (
        device_messages.duct_record(
            across(device_messages.ACTUATOR_OUTPUTS, device_messages.duct_values(duct))
        )
        == duct
    )
    one_axis = device_messages.ACTUATOR_OUTPUTS.record._make(
        device_messages.duct_values(duct)
    )._replace(active=0b01)
    assert device_messages.has_deflections(m)
    assert not device_messages.has_deflections(across(device_messages.ACTUATOR_OUTPUTS, one_axis))
