"""What the simulator's real codec sends, as the autopilot takes it in; and what of it the ground
hears."""

from collections.abc import Iterator
from typing import NamedTuple

import pytest

from autopilot.comms import hil
from autopilot.comms.hil import HilSample
from mavlink_io import device_messages, dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.records import (
    ARMED_FLAG,
    LOCKSTEP_FLAG,
    SENSORS_ALL,
    ActuatorFrame,
    Battery,
    DuctFeedback,
    Dvl,
    GpsFix,
    Leak,
)
from mavlink_io.records import Altimeter as Range
from mavlink_io.transport import Transport, open_transport
from sitl.backends.hil import HilClient
from sitl.core.sensors import Sensors
from tests.helpers.fake_hil import Deck, Station, only, sensors

FULL = Sensors(
    sensors(20_000),
    GpsFix(20_000, 3, 42.35, -71.0, 0.5, 0.1, -0.2, 0.0, 10, 1.5, 3.0),
    Range(20_000, 12.25, 0.3, 30.0),
    Dvl(20_000, 1.25, -0.5, 0.25, True, 0.5, 100),
    Battery(33.5, 1.75, 0.25, 0.5),
    Leak(True),
    DuctFeedback(20_000, 0.5, -0.25),
)


class Line(NamedTuple):
    sitl: HilClient
    autopilot: hil.HilLink
    near: Transport


@pytest.fixture
def line() -> Iterator[Line]:
    near, far = open_transport("memory:hil"), open_transport("memory:hil")
    yield Line(HilClient(near), hil.HilLink(far, 1), near)
    near.close()
    far.close()


def heard(line: Line, said: Sensors) -> HilSample:
    line.near.send(line.sitl.datagram(said, None))
    (sample,) = line.autopilot.receive()
    return sample


def test_every_record_arrives_with_the_sample_of_its_tick(line: Line) -> None:
    sample = heard(line, FULL)
    assert sample.sensors.fields_updated == SENSORS_ALL
    for name in ("gps", "altimeter", "dvl", "battery"):
        told = getattr(sample, name)
        assert told == pytest.approx(getattr(FULL, name), abs=1e-6), name
    assert (sample.leak, sample.duct) == (FULL.leak, FULL.duct)


def test_what_came_once_is_told_once(line: Line) -> None:
    heard(line, FULL)
    sample = heard(line, Sensors(sensors(40_000), None, None))
    assert sample._replace(frames=()) == HilSample(sensors=_again(40_000))
    assert [frame.name for frame in sample.frames] == ["HIL_SENSOR"]


def _again(time_us: int) -> object:
    near, far = open_transport("memory:alone"), open_transport("memory:alone")
    near.send(HilClient(near).datagram(Sensors(sensors(time_us), None, None), None))
    (sample,) = hil.HilLink(far, 1).receive()
    near.close()
    far.close()
    return sample.sensors


def test_devices_speak_under_ids_and_sequences_of_their_own(line: Line) -> None:
    frames = Framer().feed(line.sitl.datagram(FULL, None) + line.sitl.datagram(FULL, None))
    told = [
        (frame.name, frame.component, frame.sequence) for frame in frames if frame.component != 25
    ]
    assert told == [
        ("ODOMETRY", 197, 1),
        ("BATTERY_STATUS", 180, 1),
        ("SYS_STATUS", 158, 1),
        ("ACTUATOR_OUTPUT_STATUS", 140, 1),
        ("ODOMETRY", 197, 2),
        ("BATTERY_STATUS", 180, 2),
        ("SYS_STATUS", 158, 2),
        ("ACTUATOR_OUTPUT_STATUS", 140, 2),
    ]


def test_the_ground_hears_the_log_and_the_encoders_on_every_link_but_no_second_battery(
    line: Line,
) -> None:
    deck = Deck(Station(), Station(254))
    deck.server.relay(heard(line, FULL).relayed)
    deck.server.flush()
    for station in deck.stations:
        told = [(m.get_type(), m.get_srcSystem(), m.get_srcComponent()) for m in station.heard()]
        assert told == [
            ("ODOMETRY", 1, device_messages.DVL_COMPONENT),
            ("ACTUATOR_OUTPUT_STATUS", 1, device_messages.DUCT_COMPONENT),
        ]


def test_the_ground_hears_the_air_in_the_hull_where_a_device_measures_it(line: Line) -> None:
    hull, component = dialect.by_name("SCALED_PRESSURE"), 158
    pressure = encode(hull, (40, 985.5, 0.0, 2150, 0), 0, 1, component)
    line.near.send(pressure + line.sitl.datagram(Sensors(sensors(40_000), None, None), None))
    (sample,) = line.autopilot.receive()
    deck = Deck()
    deck.server.relay(sample.relayed)
    deck.server.flush()
    told = only(deck.station.heard(), "SCALED_PRESSURE")
    assert (told.get_srcComponent(), told.press_abs, told.temperature) == (component, 985.5, 2150)


def test_devices_that_outlive_the_ahrs_fill_no_memory(line: Line) -> None:
    hull = dialect.by_name("SCALED_PRESSURE")
    for number in range(3 * hil.MAX_QUEUED_FRAMES):
        line.near.send(encode(hull, (number, 985.5, 0.0, 2150, 0), number & 0xFF, 1, 158))
        assert line.autopilot.receive() == []
    line.near.send(line.sitl.datagram(Sensors(sensors(40_000), None, None), None))
    (sample,) = line.autopilot.receive()
    assert [frame.decode().time_boot_ms for frame in sample.relayed] == list(
        range(2 * hil.MAX_QUEUED_FRAMES, 3 * hil.MAX_QUEUED_FRAMES)
    )


def test_answers_go_back(line: Line) -> None:
    frame = ActuatorFrame(20_000, LOCKSTEP_FLAG, (0.25, 0.0, 0.5, *(0.0,) * 13), ARMED_FLAG)
    line.autopilot.answer(frame)
    assert line.sitl.answer(20_000, 1.0) == frame
