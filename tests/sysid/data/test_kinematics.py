"""Kinematically inconsistent runs and clock errors are rejected before any model is used."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from sitl.vehicle import config
from sysid.data import kinematics, readers, segments
from sysid.data.runs import Run
from sysid.planes import Plane
from sysid.screening import screen
from tests.sysid import recording, sea
from tests.sysid.data.test_dataset import attitude, dive


@pytest.fixture(scope="module")
def yaw(field: config.VehicleConfig) -> Run:
    return sea.fly(
        field, Plane.YAW, sea.step(4.0, 10.0), level=sea.CALM, trim_rad=(math.radians(6.0), 0.0)
    )


@pytest.fixture(scope="module")
def pitch(field: config.VehicleConfig) -> Run:
    return sea.fly(
        field, Plane.PITCH, sea.step(4.0, 10.0), level=sea.CALM, trim_rad=(math.radians(6.0), 0.0)
    )


def named(run: Run, name: str) -> list[str]:
    (screening,) = screen([run])
    return [reason for reason in screening.reasons if reason.startswith(f"{name}: ")]


def test_simulated_run_is_kinematically_consistent(yaw: Run, pitch: Run) -> None:
    for run in (yaw, pitch):
        assert named(run, "kinematics") == []
    sinking = kinematics.depth_mismatch(pitch)
    assert sinking is not None
    assert 0.5 < sinking.speed_mps < 1.5


def test_inconsistent_run_is_rejected_with_name(yaw: Run, pitch: Run) -> None:
    impossible = {
        "heading and yaw rate": [
            replace(yaw, r_radps=-yaw.r_radps),
            replace(yaw, r_radps=np.degrees(yaw.r_radps)),
            replace(yaw, r_radps=yaw.r_radps + math.radians(2.0)),
            replace(yaw, heading_rad=np.full_like(yaw.heading_rad, yaw.heading_rad[0])),
            replace(yaw, r_radps=np.roll(yaw.r_radps, 100)),
        ],
        "pitch and pitch rate": [replace(pitch, q_radps=-pitch.q_radps)],
        "depth": [replace(pitch, depth_m=-pitch.depth_m)],
    }
    for what, broken in impossible.items():
        for run in broken:
            assert any(what in reason for reason in named(run, "kinematics")), what


@pytest.mark.parametrize(
    ("factor", "cause"),
    [
        (-1.0, "one of them has the wrong sign"),
        (180.0 / math.pi, "in the wrong unit (the rate changes 57 times as much)"),
        (math.pi / 180.0, "in the wrong unit (the angle changes 57 times as much)"),
        (3.0, ""),
    ],
)
def test_inconsistent_rate_has_its_cause_named(yaw: Run, factor: float, cause: str) -> None:
    (reason,) = named(replace(yaw, r_radps=factor * yaw.r_radps), "kinematics")
    named_cause = reason.partition("; ")[2].partition(": ")[0]
    assert named_cause.endswith(cause)
    assert ("; " in reason) == bool(cause)


def test_frozen_heading_is_named(yaw: Run) -> None:
    frozen = replace(yaw, heading_rad=np.full_like(yaw.heading_rad, yaw.heading_rad[0]))
    (reason,) = named(frozen, "kinematics")
    assert reason.endswith("; the angle does not change")


def test_frozen_angle_has_ratio_zero_and_no_lag(pitch: Run) -> None:
    frozen = replace(pitch, pitch_rad=np.zeros_like(pitch.pitch_rad))
    fit = kinematics.fit_pitch([frozen] * 3)
    assert fit is not None
    assert fit.ratio == 0.0
    assert math.isnan(fit.lag_s)


def test_heading_mismatch_accounts_for_roll(yaw: Run) -> None:
    """At 90 degrees of roll the heading changes with the pitch rate."""
    side = math.radians(90.0)
    rolled = replace(
        yaw,
        roll_rad=np.full_like(yaw.roll_rad, side),
        q_radps=yaw.r_radps,
        r_radps=0.0 * yaw.r_radps,
        pitch_rad=0.0 * yaw.pitch_rad,
    )
    found = kinematics.heading_mismatch(rolled)
    assert found is not None
    assert math.degrees(found.rms_rad) < 1.0


def test_backward_clock_step_is_reported(tmp_path: Path) -> None:
    """The autopilot restarts in the middle of a test. A single late datagram is no clock step."""
    entries = dive()
    reborn = [attitude(24.0 + k / 50, 3.0, 0.1) for k in range(100)]
    at = next(k for k, entry in enumerate(entries) if entry[0] >= 26.0)
    broken = readers.read(
        recording.write(tmp_path / "reborn.mcap", [*entries[:at], *reborn, *entries[at:]], {})
    )
    (run,) = segments.cut_runs(broken)
    assert named(run, "clock") == [
        "clock: the time of ATTITUDE went back by 2.0 s (a restart?); give what follows as a log"
        " of its own"
    ]
    late = [*entries[:at], reborn[0], *entries[at:]]
    (run,) = segments.cut_runs(readers.read(recording.write(tmp_path / "late.mcap", late, {})))
    assert named(run, "clock") == []


@pytest.mark.parametrize(("gain", "refused"), [(1.0, False), (1.001, False), (1.02, True)])
def test_fast_recorder_clock_is_reported(tmp_path: Path, gain: float, refused: bool) -> None:
    """A recorder clock 2 % too fast is rejected; 0.1 %, as of a cheap quartz, is accepted."""
    entries = [
        (time_s * gain, message)
        for time_s, message in dive()
        if isinstance(message, mavlink.MAVLink_message)
    ]
    (run,) = segments.cut_runs(readers.read(recording.write(tmp_path / "fast.mcap", entries, {})))
    assert bool(named(run, "clock")) == refused
