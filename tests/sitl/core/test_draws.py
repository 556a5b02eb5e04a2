"""Random numbers in blocks: the same numbers as single draws."""

import numpy as np
from numpy.random import default_rng

from sitl.core import draws
from sitl.core.draws import AT_START, BLOCK, IMU, PER_TICK, RUDDER, Draws, draw


def eight_streams() -> Draws:
    return Draws([default_rng(seed) for seed in range(8)])


def test_blocks_hold_numbers_of_single_draws() -> None:
    streams, ticks = eight_streams(), 3 * BLOCK // PER_TICK
    streams.prepare(AT_START)
    normal, uniform = streams.normals(IMU, 30), []
    for _ in range(ticks):
        streams.prepare(PER_TICK)
        normal += draws.take(streams.table, IMU, 11).tolist()
        uniform.append(draw(streams.table, RUDDER))
    expected = default_rng(IMU)
    np.testing.assert_array_equal(normal, [expected.standard_normal() for _ in normal])
    np.testing.assert_array_equal(uniform, default_rng(RUDDER).random(ticks))


def test_stream_that_is_not_used_is_not_advanced_by_others() -> None:
    streams = eight_streams()
    for _ in range(2 * BLOCK // PER_TICK):
        streams.prepare(PER_TICK)
        draws.take(streams.table, IMU, PER_TICK)
    streams.prepare(PER_TICK)
    assert draw(streams.table, RUDDER) == default_rng(RUDDER).random()
