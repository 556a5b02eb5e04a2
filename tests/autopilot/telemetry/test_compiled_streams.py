"""Telemetry that compiled code encodes: the same frames as those of Python."""

import math
from collections.abc import Sequence
from importlib import import_module
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.control import params
from autopilot.control.types import Home, Motion
from autopilot.identities import IDENTITIES
from autopilot.reports import SteadyReport
from autopilot.steady_ticks import Results
from autopilot.telemetry.encoding import pack_payload
from autopilot.telemetry.streams import TelemetryStream, stream_group
from mavlink_io import jit
from mavlink_io.endpoint import Endpoint
from mavlink_io.records import Altimeter
from tests.mavlink_io.test_endpoint import Inbox

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="there is no encoder without numba")
STREAMS = list(
    dict.fromkeys(
        stream
        for identity in IDENTITIES.values()
        for stream in identity.streams
        if stream.is_numeric
    )
)
CONFIG = params.config({})
MOST = 16_384
"""Bytes of a batch."""


@pytest.fixture(scope="module")
def encoder() -> Any:
    return import_module("autopilot.telemetry.compiled_streams").FrameEncoder()


def _report(seed: int) -> SteadyReport:
    """Return a tick with random numbers of every size that a dive may have."""
    kernel = import_module("autopilot.control.steady_kernel")
    random = Random(seed)
    values = jit.numbers(kernel.SIZE)
    scale = 10.0 ** random.randint(-3, 6)
    for index in range(kernel.SIZE):
        values[index] = random.choice((0.0, random.uniform(-scale, scale)))
    values[0] = float(random.randrange(2**52))
    values[14], values[15] = float(random.randrange(2**32)), 0.0
    if random.random() < 0.5:
        values[kernel.RESULTS + Motion._fields.index("altitude_m")] = math.nan
    flat: Any = params.flat(CONFIG)
    results = Results(values, 0, len(values), int(values[0]), jit.native(flat))
    home = random.choice((Home(), Home(42.35, -71.0, known=True)))
    limits_m = random.uniform(0.0, 1.0), random.uniform(1.0, 1000.0)
    altimeter = random.choice((None, Altimeter(0, 1.0, *limits_m)))
    return SteadyReport(results, CONFIG, None, home, altimeter)


def _encoded(streams: Sequence[TelemetryStream], report: SteadyReport, sender: Endpoint) -> bytes:
    """Return the frames of Python."""
    return b"".join(
        sender.encode_payload(stream.message, pack_payload(stream.message, stream.build(report)))
        for stream in streams
    )


def test_most_messages_of_a_tick_are_compiled() -> None:
    names = {stream.message.name for stream in STREAMS}
    assert {"ATTITUDE", "ACTUATOR_OUTPUT_STATUS", "HIGHRES_IMU", "ODOMETRY"} <= names


@pytest.mark.parametrize("stream", STREAMS, ids=lambda stream: stream.message.name)
@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_frames_equal_those_of_python(encoder: Any, stream: TelemetryStream, seed: int) -> None:
    report, plain, compiled = _report(seed), Endpoint(Inbox(), 7, 1), Endpoint(Inbox(), 7, 1)
    assert encoder.add(stream_group([stream]), report, MOST)
    assert encoder.take(compiled) == _encoded([stream], report, plain)
    assert compiled.sequence == plain.sequence


def test_group_is_encoded_in_the_order_of_the_table(encoder: Any) -> None:
    plain, compiled = Endpoint(Inbox(), 1, 1), Endpoint(Inbox(), 1, 1)
    streams = [stream for stream in next(iter(IDENTITIES.values())).streams if stream.is_numeric]
    report = _report(1)
    assert encoder.add(stream_group(streams), report, MOST)
    frames = encoder.take(compiled)
    assert frames == _encoded(streams, report, plain)
    assert len(frames) < 1200, "a datagram that networks do not fragment"
    assert encoder.take(compiled) == b""


def test_ticks_of_an_exchange_are_one_batch(encoder: Any) -> None:
    """Rows of several ticks with more numbers behind each, as an exchange has them."""
    first, second = _report(1), _report(2)
    size, gap = len(first.results.rows), 2
    rows = jit.numbers(2 * (size + gap))
    reports = []
    for index, report in enumerate((first, second)):
        start = index * (size + gap)
        for i, value in enumerate(report.results.rows.tolist()):
            rows[start + i] = value
        results = Results(rows, start, start + size, report.time_us, first.results.config)
        reports.append(SteadyReport(results, CONFIG, None, first.home, first.altimeter))
    plain, compiled = Endpoint(Inbox(), 1, 1), Endpoint(Inbox(), 1, 1)
    groups = STREAMS[:3], STREAMS[2:5]
    expected = b""
    for streams, report in zip(groups, reports, strict=True):
        assert encoder.add(stream_group(streams), report, MOST)
        expected += _encoded(streams, report, plain)
    assert encoder.take(compiled) == expected
    assert compiled.sequence == plain.sequence


def test_batch_ends_with_rows_home_limits_and_size(encoder: Any) -> None:
    group, first = stream_group(STREAMS[:1]), _report(1)
    results = first.results
    others = (
        _report(2),
        SteadyReport(results, CONFIG, None, Home(1.0, 2.0, known=True), first.altimeter),
        SteadyReport(results, CONFIG, None, first.home, Altimeter(0, 1.0, 0.123, 4.56)),
    )
    assert encoder.add(group, first, MOST)
    assert not any(encoder.add(group, other, MOST) for other in others)
    assert not encoder.add(group, first, 2 * group.max_bytes - 1)
    assert encoder.add(group, first, 2 * group.max_bytes)
    assert len(encoder.take(Endpoint(Inbox(), 1, 1))) <= 2 * group.max_bytes
