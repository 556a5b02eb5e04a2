"""HIL link with the simulator's real codec: received records, and messages relayed to ground."""

from collections.abc import Iterator
from typing import NamedTuple

import pytest

from autopilot.comms import hil
from autopilot.comms.hil import HilSample
from autopilot.telemetry.identity import COMPONENT
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
    SensorFrame,
)
from mavlink_io.records import Altimeter as Range
from mavlink_io.transport import Transport, open_transport
from sitl.backends.hil import HilClient
from sitl.core.sensors import Sensors
from tests.helpers.fake_hil import Harness, Station, only, sensors

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


def only_sample(link: hil.HilLink) -> HilSample:
    samples = link.receive()
    assert samples is not None
    (sample,) = samples
    return sample


def received(line: Line, sent: Sensors) -> HilSample:
    line.near.send(line.sitl.datagram(sent, None))
    return only_sample(line.autopilot)


def test_sample_contains_all_device_records(line: Line) -> None:
    sample = received(line, FULL)
    assert sample.sensors.fields_updated == SENSORS_ALL
    for name in ("gps", "altimeter", "dvl", "battery"):
        reported = getattr(sample, name)
        assert reported == pytest.approx(getattr(FULL, name), abs=1e-6), name
    assert (sample.leak, sample.duct) == (FULL.leak, FULL.duct)


def test_device_records_are_in_one_sample_only(line: Line) -> None:
    received(line, FULL)
    sample = received(line, Sensors(sensors(40_000), None, None))
    assert sample._replace(frames=()) == HilSample(sensors=_again(40_000))
    assert [frame.name for frame in sample.frames] == ["HIL_SENSOR"]


def _again(time_us: int) -> SensorFrame:
    near, far = open_transport("memory:alone"), open_transport("memory:alone")
    near.send(HilClient(near).datagram(Sensors(sensors(time_us), None, None), None))
    sample = only_sample(hil.HilLink(far, 1))
    near.close()
    far.close()
    return sample.sensors


def test_relayed_devices_have_own_ids_and_sequences(line: Line) -> None:
    frames = Framer().feed(line.sitl.datagram(FULL, None) + line.sitl.datagram(FULL, None))
    reported = [
        (frame.name, frame.component, frame.sequence) for frame in frames if frame.component != 25
    ]
    assert reported == [
        ("ODOMETRY", 197, 1),
        ("BATTERY_STATUS", 180, 1),
        ("SYS_STATUS", 158, 1),
        ("ACTUATOR_OUTPUT_STATUS", 140, 1),
        ("ODOMETRY", 197, 2),
        ("BATTERY_STATUS", 180, 2),
        ("SYS_STATUS", 158, 2),
        ("ACTUATOR_OUTPUT_STATUS", 140, 2),
    ]


def test_relay_sends_dvl_and_encoders_but_not_battery(
    line: Line,
) -> None:
    harness = Harness(Station(), Station(254))
    harness.server.relay(received(line, FULL).relayed)
    harness.server.flush()
    for station in harness.stations:
        reported = [
            (m.get_type(), m.get_srcSystem(), m.get_srcComponent()) for m in station.pop_received()
        ]
        assert reported == [
            ("ODOMETRY", 1, device_messages.DVL_COMPONENT),
            ("ACTUATOR_OUTPUT_STATUS", 1, device_messages.DUCT_COMPONENT),
        ]


def sample_with_hull_pressure(line: Line, component: int) -> HilSample:
    """Return a sample received with the pressure in the hull from a device."""
    hull = dialect.by_name("SCALED_PRESSURE")
    pressure = encode(hull, (40, 985.5, 0.0, 2150, 0), 0, 1, component)
    line.near.send(pressure + line.sitl.datagram(Sensors(sensors(40_000), None, None), None))
    return only_sample(line.autopilot)


def test_relay_sends_hull_pressure(line: Line) -> None:
    component = 158
    harness = Harness()
    harness.server.relay(sample_with_hull_pressure(line, component).relayed)
    harness.server.flush()
    reported = only(harness.station.pop_received(), "SCALED_PRESSURE")
    assert (reported.get_srcComponent(), reported.press_abs, reported.temperature) == (
        component,
        985.5,
        2150,
    )


def test_device_with_the_autopilots_id_has_its_sequence(line: Line) -> None:
    """Interface computers without an id of their own send as component 1."""
    sample, harness = sample_with_hull_pressure(line, COMPONENT), Harness()
    for _ in range(3):
        harness.server.relay(sample.relayed)
        harness.tick()
        harness.server.flush()
    sequences = [
        m.get_seq() for m in harness.station.pop_received() if m.get_srcComponent() == COMPONENT
    ]
    assert len(sequences) > 3
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))


def test_device_frames_without_samples_are_limited(line: Line) -> None:
    hull = dialect.by_name("SCALED_PRESSURE")
    for number in range(3 * hil.MAX_QUEUED_FRAMES):
        line.near.send(encode(hull, (number, 985.5, 0.0, 2150, 0), number & 0xFF, 1, 158))
        assert line.autopilot.receive() == []
    line.near.send(line.sitl.datagram(Sensors(sensors(40_000), None, None), None))
    sample = only_sample(line.autopilot)
    assert [frame.decode().time_boot_ms for frame in sample.relayed] == list(
        range(2 * hil.MAX_QUEUED_FRAMES, 3 * hil.MAX_QUEUED_FRAMES)
    )


def test_answer_is_received_by_simulator(line: Line) -> None:
    frame = ActuatorFrame(20_000, LOCKSTEP_FLAG, (0.25, 0.0, 0.5, *(0.0,) * 13), ARMED_FLAG)
    line.autopilot.answer(frame)
    assert line.sitl.answer(20_000, 1.0) == frame
