"""Live estimate from frames: complete tests, gaps, clock steps and slow streams."""

import json
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
from sysid.data.runs import Run
from sysid.estimation.recursive import prior
from sysid.estimation.recursive.estimator import Knowledge
from sysid.planes import Plane
from tests.sysid import sea

TRAVEL_RAD = math.radians(15.0)
START = StatusText(6, "SystemID Starting: axis=12 wave=doublet magnitude=5.00")
START_BOTH = StatusText(6, "SystemID Starting: axis=23 wave=doublet magnitude=5.00")
FINISHED = StatusText(6, "SystemID Finished")


@pytest.fixture(scope="module")
def run() -> Run:
    return sea.fly(
        config.load("caribou_truth"), Plane.YAW, sea.doublet(5.0, 6.0), seed=1, trim_rad=(0.1, 0.0)
    )


@pytest.fixture(scope="module")
def known() -> Knowledge:
    return prior.knowledge("caribou_nominal")


def frame(name: str, **fields: object) -> Frame:
    kind = dialect.by_name(name)
    blank = kind.unpack(b"")._asdict()
    return Frame(1, 1, kind.message_id, 0, kind.pack(tuple({**blank, **fields}.values())), b"")


def frames(
    run: Run, first_s: float, last_s: float, shift_s: float = 100.0, every: int = 1
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


def feed(estimate: LiveEstimate, received: Iterator[Frame]) -> None:
    for message in received:
        estimate.on_frame(message)


def after_the_test(known: Knowledge, run: Run, *, poll_interval_s: float = 100.0) -> EstimateStatus:
    estimate = LiveEstimate(known, {})
    feed(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    for first in np.arange(0.0, 12.0, poll_interval_s):
        feed(estimate, frames(run, first, first + poll_interval_s))
        estimate.poll()
    estimate.on_text(FINISHED)
    feed(estimate, frames(run, 12.0, 13.0, 100.02))
    return estimate.poll()


def test_one_test_reduces_sd_of_b1(known: Knowledge, run: Run) -> None:
    status = after_the_test(known, run)
    b1 = status.readings[Plane.YAW].numbers["b1_per_s2"]
    assert b1.sd < 0.4 * b1.prior_sd
    assert "b1" in estimate_view.line(status.readings[Plane.YAW])
    assert status.testing == ()


def test_static_gain_has_no_bounds_until_a_test_shows_its_pole(known: Knowledge, run: Run) -> None:
    """The static gain is over the slow pole, which may be zero by the vehicle file of remus100."""
    estimate = LiveEstimate(prior.knowledge("remus100"), {})
    feed(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    unknown = estimate.poll()
    assert math.isinf(unknown.readings[Plane.YAW].numbers["static_gain_per_s"].sd)
    assert estimate_view.as_json(unknown)["yaw"]["static_gain_per_s"]["sd"] is None
    assert "not bounded" in str(estimate_view.as_panel(unknown))
    json.dumps(estimate_view.as_json(unknown), allow_nan=False)
    shown = after_the_test(known, run).readings[Plane.YAW].numbers["static_gain_per_s"]
    assert shown.sd < 0.5 * shown.value


def test_poll_interval_does_not_change_final_estimate(known: Knowledge, run: Run) -> None:
    seldom, often = (
        after_the_test(known, run, poll_interval_s=s).readings[Plane.YAW].numbers
        for s in (12.0, 1.7)
    )
    for name in seldom:
        assert often[name].value == pytest.approx(seldom[name].value, abs=0.1 * seldom[name].sd), (
            name
        )
        assert often[name].sd == pytest.approx(seldom[name].sd, rel=0.02), name


def test_gap_in_frames_increases_sd_and_is_reported(known: Knowledge, run: Run) -> None:
    estimate = LiveEstimate(known, {})
    feed(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    feed(estimate, frames(run, 0.0, 5.0))
    feed(estimate, frames(run, 7.0, 12.0))
    status = estimate.poll()
    assert "without" in status.trouble
    estimate.on_text(FINISHED)
    feed(estimate, frames(run, 12.0, 13.0, 100.02))
    status = estimate.poll()
    whole = after_the_test(known, run).readings[Plane.YAW].numbers["b1_per_s2"]
    b1 = status.readings[Plane.YAW].numbers["b1_per_s2"]
    assert whole.sd < b1.sd < 0.6 * b1.prior_sd
    assert abs(b1.value - whole.value) < 3.0 * b1.sd


def test_clock_step_back_ends_test_and_keeps_estimate(known: Knowledge, run: Run) -> None:
    estimate = LiveEstimate(known, {})
    feed(estimate, frames(run, -15.0, 0.0))
    estimate.on_text(START)
    feed(estimate, frames(run, 0.0, 6.0))
    estimate.poll()
    feed(estimate, frames(run, -15.0, 0.0, shift_s=20.0))
    status = estimate.poll()
    assert status.testing == ()
    once = status.readings[Plane.YAW].numbers["b1_per_s2"].sd
    estimate.on_text(START)
    feed(estimate, frames(run, 0.0, 8.0, shift_s=20.0))
    status = estimate.poll()
    assert status.testing == ("yaw",)
    assert status.readings[Plane.YAW].numbers["b1_per_s2"].sd < once


def test_slow_actuator_stream_is_named_and_not_estimated(known: Knowledge, run: Run) -> None:
    estimate = LiveEstimate(known, {})
    feed(estimate, frames(run, -15.0, 0.0, every=12))
    estimate.on_text(START)
    feed(estimate, frames(run, 0.0, 10.0, every=12))
    status = estimate.poll()
    assert not status.readings
    assert "ACTUATOR_OUTPUT_STATUS, at most 0.12" in status.trouble


def test_test_of_both_surfaces_counts_for_both_planes(known: Knowledge, run: Run) -> None:
    """The test of one plane ends before that of the other; both stay known in the next test."""
    estimate = LiveEstimate(known, {})
    sds = []
    for start, shift_s in ((START_BOTH, 100.0), (START, 150.0)):
        feed(estimate, frames(run, -15.0, 0.0, shift_s))
        estimate.on_text(start)
        feed(estimate, frames(run, 0.0, 12.0, shift_s))
        estimate.poll()
        estimate.on_text(FINISHED)
        feed(estimate, frames(run, 12.0, 13.0, shift_s + 0.02))
        sds.append(estimate.poll().readings[Plane.YAW].numbers["b1_per_s2"].sd)
    assert sds[1] < 0.9 * sds[0]
