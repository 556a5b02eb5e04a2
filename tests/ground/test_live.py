"""The live estimate, fed by frames: whole tests, gaps, clocks that go back, and streams that are
too slow.
"""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from ground.client.vehicle import StatusText
from ground.live import estimate_view
from ground.live.estimate import EstimateStatus, LiveEstimate
from mavlink_io import dialect
from mavlink_io.codec import Frame
from sitl.vehicle import config
from sysid.estimation.recursive import prior
from tests.sysid import sea

TRAVEL_RAD = math.radians(15.0)
START = StatusText(6, "SystemID Starting: axis=12 wave=doublet magnitude=5.00")
FINISHED = StatusText(6, "SystemID Finished")


@pytest.fixture(scope="module")
def run() -> object:
    return sea.fly(
        config.load("caribou_truth"), "yaw", sea.doublet(5.0, 6.0), seed=1, trim_rad=(0.1, 0.0)
    )


@pytest.fixture(scope="module")
def known() -> object:
    return prior.knowledge("caribou_nominal")


def frame(name: str, **fields: object) -> Frame:
    kind = dialect.by_name(name)
    blank = kind.unpack(b"")._asdict()
    return Frame(1, 1, kind.message_id, 0, kind.pack(tuple({**blank, **fields}.values())), b"")


def frames(
    run, first_s: float, last_s: float, shift_s: float = 100.0, every: int = 1
) -> Iterator[Frame]:
    """Return the frames of the vehicle between two times of the run, at 50 Hz or less."""
    inside = np.flatnonzero((run.time_s >= first_s) & (run.time_s < last_s))
    for k in inside[::every]:
        ms = round((run.time_s[k] + shift_s) * 1000)
        outputs = [run.rudder_rad[k] / TRAVEL_RAD, run.elevator_rad[k] / TRAVEL_RAD, run.thrust[k]]
        yield frame(
            "ACTUATOR_OUTPUT_STATUS", time_usec=ms * 1000, active=7, actuator=outputs + [0.0] * 29
        )
        yield frame("LOCAL_POSITION_NED", time_boot_ms=ms, z=run.depth_m[k])
        yield frame(
            "ATTITUDE",
            time_boot_ms=ms,
            roll=run.roll_rad[k],
            pitch=run.pitch_rad[k],
            yaw=run.heading_rad[k],
            rollspeed=run.p_radps[k],
            pitchspeed=run.q_radps[k],
            yawspeed=run.r_radps[k],
        )


def heard(estimate: LiveEstimate, told: Iterator[Frame]) -> None:
    for each in told:
        estimate.on_frame(each)


def after_the_test(known, run, *, look_every_s: float = 100.0) -> EstimateStatus:
    estimate = LiveEstimate(known, {})
    heard(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    for first in np.arange(0.0, 12.0, look_every_s):
        heard(estimate, frames(run, first, first + look_every_s))
        estimate.poll()
    estimate.on_text(FINISHED)
    heard(estimate, frames(run, 12.0, 13.0, 100.02))
    return estimate.poll()


def test_a_test_makes_b1_sure(known, run) -> None:
    standing = after_the_test(known, run)
    b1 = standing.readings["yaw"].numbers["b1_per_s2"]
    assert b1.sd < 0.4 * b1.before
    assert "b1" in estimate_view.line(standing.readings["yaw"])
    assert standing.testing == ()


def test_often_looking_changes_nothing_in_the_end(known, run) -> None:
    seldom, often = (
        after_the_test(known, run, look_every_s=s).readings["yaw"].numbers for s in (12.0, 1.7)
    )
    for name in seldom:
        assert often[name].value == pytest.approx(seldom[name].value, abs=0.1 * seldom[name].sd), (
            name
        )
        assert often[name].sd == pytest.approx(seldom[name].sd, rel=0.02), name


def test_behind_a_gap_the_test_goes_on_and_is_told_less_of(known, run) -> None:
    estimate = LiveEstimate(known, {})
    heard(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    heard(estimate, frames(run, 0.0, 5.0))
    heard(estimate, frames(run, 7.0, 12.0))
    standing = estimate.poll()
    assert "without" in standing.trouble
    estimate.on_text(FINISHED)
    heard(estimate, frames(run, 12.0, 13.0, 100.02))
    standing = estimate.poll()
    whole = after_the_test(known, run).readings["yaw"].numbers["b1_per_s2"]
    b1 = standing.readings["yaw"].numbers["b1_per_s2"]
    assert whole.sd < b1.sd < 0.6 * b1.before
    assert abs(b1.value - whole.value) < 3.0 * b1.sd


def test_a_clock_that_goes_back_ends_the_test_and_the_next_one_is_told_of(known, run) -> None:
    estimate = LiveEstimate(known, {})
    heard(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    heard(estimate, frames(run, 0.0, 6.0))
    estimate.poll()
    heard(estimate, frames(run, -15.0, 0.0, shift_s=20.0))
    standing = estimate.poll()
    assert standing.testing == ()
    once = standing.readings["yaw"].numbers["b1_per_s2"].sd
    estimate.on_text(START)
    heard(estimate, frames(run, 0.0, 8.0, shift_s=20.0))
    standing = estimate.poll()
    assert standing.testing == ("yaw",)
    assert standing.readings["yaw"].numbers["b1_per_s2"].sd < once


def test_commands_too_seldom_for_an_estimate_are_named(known, run) -> None:
    estimate = LiveEstimate(known, {})
    heard(estimate, frames(run, -15.0, 0.0, every=12))
    estimate.on_text(START)
    heard(estimate, frames(run, 0.0, 10.0, every=12))
    standing = estimate.poll()
    assert not standing.readings
    assert "ACTUATOR_OUTPUT_STATUS, at most 0.12" in standing.trouble
