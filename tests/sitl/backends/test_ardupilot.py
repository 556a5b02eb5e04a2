"""ArduPilot's servo frames, and answers to frames that arrive late or repeated."""

import struct
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_io.transport import Transport
from sitl import scenario
from sitl.backends.ardupilot import (
    ArduPilot,
    Servos,
    controls_from_pulses,
    is_restart,
    parse_servos,
    timestep_for_rate,
)
from sitl.backends.servo_outputs import parse
from sitl.core import plant
from sitl.vehicle import config


def frame(number: int, rudder_us: int = 1500) -> bytes:
    return struct.pack("<HHI16H", 18458, 400, number, rudder_us, *(1500,) * 15)


def test_repeated_frames_get_one_answer(ends: tuple[Transport, Transport]) -> None:
    """An answer to each would keep ArduPilot behind: it takes the first answer for the newest."""
    near, far = ends
    backend = ArduPilot(near, lambda: False, outputs=parse("1,2,3"))
    far.send(frame(0))
    steps = backend.wait_for_autopilot()
    assert steps is not None
    sea = plant.build(config.load("caribou_truth"), scenario.load("calm"), steps)
    rng = plant.random_streams(1)
    state, sensors = plant.initial_state(sea, rng)
    actuators = backend.exchange(sea, state, sensors)
    assert actuators is not None
    for _ in range(5):
        far.send(frame(0))
    far.send(frame(1, rudder_us=1700))
    state, sensors = plant.step(sea, state, actuators, rng)
    actuators = backend.exchange(sea, state, sensors)
    assert actuators is not None
    assert actuators.controls == (0.5, 0.0, 0.0)
    assert far.receive().count(b"timestamp") == 1
    assert far.receive() == b""


def test_wait_for_servos_ends_on_stop(ends: tuple[Transport, Transport]) -> None:
    calls = count()
    backend = ArduPilot(ends[0], lambda: next(calls) > 2, outputs=parse("1,2,3"))
    assert backend.wait_for_autopilot() is None


@given(st.binary(max_size=100))
def test_parse_servos_any_bytes_gives_frame_or_none(datagram: bytes) -> None:
    received = parse_servos(datagram)
    assert received is None or (len(datagram) in (40, 72) and received.frame_rate_hz > 0)


@given(
    st.integers(1, 65_535),
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(0, 65_535), min_size=16, max_size=16),
)
def test_parse_servos_returns_packed_values(
    rate_hz: int, number: int, pulses_us: list[int]
) -> None:
    assert parse_servos(struct.pack("<HHI16H", 18458, rate_hz, number, *pulses_us)) == (
        rate_hz,
        number,
        tuple(pulses_us),
    )
    assert all(-1.0 <= demand <= 1.0 for demand in controls_from_pulses(pulses_us))
    steps = timestep_for_rate(rate_hz)
    assert 100 <= steps.tick_us <= 20_000
    assert steps.tick_us / steps.substeps <= 5000


def test_controls_from_pulses_cover_full_travel() -> None:
    assert controls_from_pulses([1100, 1300, 1500, 1700, 1900, 0, 800, 2200]) == [
        -1.0,
        -0.5,
        0.0,
        0.5,
        1.0,
        0.0,
        -1.0,
        1.0,
    ]


@pytest.mark.parametrize(
    ("before", "received", "restarted"),
    [(500, 0, True), (500, 501, False), (500, 499, False), (500, 3, True), (0, 0, False)],
)
def test_is_restart_distinguishes_restart_from_late_frame(
    before: int, received: int, restarted: bool
) -> None:
    assert is_restart(Servos(400, received, ()), Servos(400, before, ())) is restarted
