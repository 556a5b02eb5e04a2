"""Segments are proposed where tests are, with their plane; course keeping gives none."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from sitl.vehicle import config
from sysid import refit
from sysid.data import readers, segments
from sysid.planes import Plane
from sysid.refit import RefitRequest
from sysid.screening import proposals, screen
from tests.sysid import dives, recording, sea
from tests.sysid.dives import DiveTest

TESTS = [
    DiveTest(Plane.YAW, sea.doublet(5.0)),
    DiveTest(Plane.PITCH, sea.doublet(5.0, 4.0)),
    DiveTest(Plane.YAW, sea.step(-6.0, 20.0)),
    DiveTest(Plane.PITCH, sea.doublet(-5.0, 4.0)),
]
USABLE_TESTS = TESTS[:3]
"""Tests that a refit accepts: in the last one the heading still returns from the rudder step."""


@pytest.fixture(scope="module")
def unmarked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dive whose log has no texts."""
    vehicle = config.load("caribou_truth")
    path = tmp_path_factory.mktemp("proposals") / "silent.mcap"
    messages = dives.entries(vehicle, TESTS, texts=False)
    return recording.write(path, messages, {"ACT_TRAVEL_DEG": 15.0})


def test_proposed_segments_are_the_tests(unmarked: Path) -> None:
    marks = proposals.propose(readers.read(unmarked))
    assert [mark.plane for mark in marks] == [test.plane for test in USABLE_TESTS]
    begins_s = dives.begins_s(USABLE_TESTS)
    for mark, test, begin_s in zip(marks, USABLE_TESTS, begins_s, strict=True):
        assert mark.start_s == pytest.approx(begin_s, abs=0.5)
        end_s = begin_s + test.signal_rad.size * sea.DT
        assert end_s - 0.5 < mark.stop_s < end_s + proposals.QUIET_S + 2.0


def test_segments_of_long_excitation_do_not_overlap(tmp_path: Path) -> None:
    """Doublets without a pause for 110 s are two segments of at most MAX_S."""
    moving = [DiveTest(Plane.YAW, np.tile(sea.doublet(5.0), 10)[: round(110.0 / sea.DT)])]
    messages = dives.entries(config.load("caribou_truth"), moving, texts=False)
    path = recording.write(tmp_path / "long.mcap", messages, {"ACT_TRAVEL_DEG": 15.0})
    marks = [mark for mark in proposals.propose(readers.read(path)) if mark.plane == Plane.YAW]
    assert len(marks) > 1
    assert all(one.stop_s <= other.start_s for one, other in itertools.pairwise(marks))


def test_course_keeping_gives_no_segment(tmp_path: Path) -> None:
    nothing = [DiveTest(plane, np.zeros(3000)) for plane in Plane]
    messages = dives.entries(config.load("caribou_truth"), nothing, texts=False, loop_on=True)
    path = recording.write(tmp_path / "cruise.mcap", messages, {"ACT_TRAVEL_DEG": 15.0})
    assert proposals.propose(readers.read(path)) == []
    with pytest.raises(refit.RefitError, match=r"no test found; .*; no usable segment found"):
        refit.refit(RefitRequest(paths=[path]))


def test_refit_without_tests_proposes_segments(unmarked: Path) -> None:
    with pytest.raises(
        refit.RefitError,
        match=r"silent\.mcap: no test found; .*\(--segment\); 3 usable segments found:"
        r" 24\.\d\.\.4\d\.\d:rudder, 74\.\d\.\.9\d\.\d:elevator, ",
    ):
        refit.refit(RefitRequest(paths=[unmarked]))


def test_proposed_segments_pass_the_screening_of_a_refit(unmarked: Path) -> None:
    log = readers.read(unmarked)
    runs = segments.cut_runs(log, proposals.propose(log))
    assert all(screening.accepted for screening in screen(runs))


def test_segments_command_lists_them(unmarked: Path) -> None:
    shown = CliRunner().invoke(app, ["log", "segments", str(unmarked)], catch_exceptions=False)
    assert "silent.mcap: 3 usable segments found: " in shown.stdout.replace("\n", "")
