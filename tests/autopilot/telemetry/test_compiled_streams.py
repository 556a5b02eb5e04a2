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
    return SteadyReport(Results(values, jit.native(flat)), CONFIG, None, Home(), None)


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
    assert encoder.encode(stream_group([stream]), report, compiled) == _encoded(
        [stream], report, plain
    )
    assert compiled.sequence == plain.sequence


def test_group_is_encoded_in_the_order_of_the_table(encoder: Any) -> None:
    plain, compiled = Endpoint(Inbox(), 1, 1), Endpoint(Inbox(), 1, 1)
    streams = [stream for stream in next(iter(IDENTITIES.values())).streams if stream.is_numeric]
    report = _report(1)
    frames = encoder.encode(stream_group(streams), report, compiled)
    assert frames == _encoded(streams, report, plain)
    assert len(frames) < 1200, "a datagram that networks do not fragment"
