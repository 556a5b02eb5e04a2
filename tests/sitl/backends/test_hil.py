"""Content of the HIL link, decoded with pymavlink as an independent reference."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from mavlink_io import dialect
from mavlink_io.codec import encode
from mavlink_io.records import SENSORS_ALL, ActuatorFrame
from mavlink_io.transport import open_transport
from sitl import scenario
from sitl.backends.hil import HilClient
from sitl.core import plant, truth
from sitl.core.plant import PlantState
from sitl.core.sensors import Sensors
from sitl.vehicle import config

CONTROLS = dialect.by_name("HIL_ACTUATOR_CONTROLS")


@pytest.fixture
def afloat() -> tuple[PlantState, Sensors]:
    return plant.initial_state(
        plant.build(config.load("caribou_truth"), scenario.load("calm")), plant.random_streams(1)
    )


def decoded(datagram: bytes) -> dict[str, Any]:
    parser = mavlink.MAVLink(None)
    return {message.get_type(): message for message in parser.parse_buffer(datagram) or []}


def test_datagram_contains_due_messages_sensors_last(
    afloat: tuple[PlantState, Sensors],
) -> None:
    state, sensors = afloat
    near, far = open_transport("memory:datagram"), open_transport("memory:datagram")
    HilClient(near).send(
        HilClient(near).datagram(sensors, truth.to_frame(state.truth, 42.35, -71.0))
    )
    messages = decoded(far.receive())
    assert list(messages) == [
        "HIL_STATE_QUATERNION",
        "HIL_GPS",
        "DISTANCE_SENSOR",
        "BATTERY_STATUS",
        "SYS_STATUS",
        "HIL_SENSOR",
    ]
    sensor = messages["HIL_SENSOR"]
    gps = messages["HIL_GPS"]
    altimeter = messages["DISTANCE_SENSOR"]
    assert (sensor.time_usec, sensor.fields_updated) == (0, SENSORS_ALL)
    assert sensor.zacc == pytest.approx(-9.8, abs=0.05)
    assert sensor.abs_pressure == pytest.approx(
        1013.25 + 100.5 * state.truth.position_ned_m[2], abs=2.5
    )
    assert gps.lat * 1e-7 == pytest.approx(42.35, abs=1e-4)
    assert (gps.fix_type, gps.cog < 36000) == (3, True)
    assert altimeter.orientation == mavlink.MAV_SENSOR_ROTATION_PITCH_270
    assert altimeter.current_distance == pytest.approx(
        100 * (20.0 - state.truth.position_ned_m[2]), abs=10
    )
    near.close()
    far.close()


def test_truth_message_has_correct_units(afloat: tuple[PlantState, Sensors]) -> None:
    state, sensors = afloat
    moving = state.truth._replace(
        velocity_ned_mps=(1.2, -0.5, 0.1),
        water_velocity_ned_mps=(0.2, -0.5, 0.1),
        position_ned_m=(0.0, 0.0, 7.25),
    )
    near = open_transport("memory:truth")
    message = decoded(HilClient(near).datagram(sensors, truth.to_frame(moving, 42.35, -71.0)))[
        "HIL_STATE_QUATERNION"
    ]
    assert (message.vx, message.vy, message.vz, message.alt) == (120, -50, 10, -7250)
    assert message.true_airspeed == 100
    assert message.zacc == pytest.approx(-1000, abs=1)
    near.close()
    open_transport("memory:truth").close()


def test_answer_ignores_other_times() -> None:
    near, far = open_transport("memory:answer"), open_transport("memory:answer")
    link = HilClient(near)
    for time_us in (20_000, 60_000, 40_000):
        frame = ActuatorFrame(time_us, 1, (0.25, math.nan, 0.58, *(0.0,) * 13), 129)
        far.send(encode(CONTROLS, frame, 0, 1, 1))
    answer = link.answer(40_000, 1.0)
    assert answer is not None
    assert (answer.time_us, answer.controls[0], answer.armed) == (40_000, 0.25, True)
    assert link.answer(20_000, 0.0) is None
    near.close()
    far.close()
