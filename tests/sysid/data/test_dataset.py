"""A log written by pymavlink and the mcap library is read with the same values."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from mavlink_io.errors import InputError
from mavlink_io.vehicle_modes import VehicleMode
from sysid import refit
from sysid.data import readers, segments
from sysid.data.dataset import LogError, Velocity, VelocitySource
from sysid.data.events import (
    Armed,
    ModeChanged,
    StopReason,
    TestAxis,
    TestEnded,
    TestStarted,
    TestWave,
    VehicleEvent,
)
from sysid.monitor import tracking_metrics
from sysid.planes import Plane
from tests.sysid import recording
from tests.sysid.recording import Entry

ALL = 0b1111


def attitude(time_s: float, yaw: float, rate: float) -> Entry:
    return time_s, mavlink.MAVLink_attitude_message(
        round(1e3 * time_s), 0.01, -0.03, yaw, 0.001, 0.002, rate
    )


def actuators(time_s: float, rudder: float, elevator: float) -> Entry:
    controls = [rudder, elevator, 0.58, *[0.0] * 29]
    return time_s, mavlink.MAVLink_actuator_output_status_message(round(1e6 * time_s), 7, controls)


def position(time_s: float, depth: float) -> Entry:
    return time_s, mavlink.MAVLink_local_position_ned_message(
        round(1e3 * time_s), 0, 0, depth, 1.3, 0, 0.05
    )


def heading_target(time_s: float, yaw: float) -> Entry:
    q = [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]
    return time_s, mavlink.MAVLink_attitude_target_message(
        round(1e3 * time_s), ALL, q, 0, 0, 0, 0.58
    )


def depth_target(time_s: float, depth: float) -> Entry:
    return time_s, mavlink.MAVLink_position_target_local_ned_message(
        round(1e3 * time_s), 1, 0, 0, 0, depth, 0, 0, 0, 0, 0, 0, 0, 0
    )


Test = tuple[float, float, str]
"""Start and end time of a test, and the text at its end."""


def dive(
    seconds: float = 40.0, test: Test | None = (20.0, 30.0, "SystemID Finished")
) -> list[Entry]:
    """Return a dive: yaw increases past pi at 0.1 rad/s; rudder at 1/3 travel in the test."""
    entries: list[Entry] = []
    for k in range(int(seconds * 50)):
        t = k / 50
        inside = test is not None and test[0] <= t < test[1]
        yaw = (3.0 + 0.1 * t + math.pi) % (2 * math.pi) - math.pi
        entries += [attitude(t, yaw, 0.1), actuators(t, 1 / 3 if inside else 0.0, 0.1)]
        if k % 5 == 0:
            entries += [position(t, 4.0 + 0.001 * k), heading_target(t, -2.0), depth_target(t, 4.0)]
        if test and t == test[0]:
            entries += recording.texts(t, "SystemID Starting: axis=12 wave=step magnitude=-5.25", 9)
        if test and t == test[1]:
            entries += recording.texts(t, test[2], 10)
    return entries


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return recording.write(
        tmp_path / "dive.mcap", dive(), {"ACT_TRAVEL_DEG": 12.0, "TRIM_RUD_DEG": 6.0}
    )


def test_log_values_read_as_written(path: Path) -> None:
    read = readers.read(path)
    assert read.name == "dive.mcap"
    assert read.parameters == {"ACT_TRAVEL_DEG": 12.0, "TRIM_RUD_DEG": 6.0}
    assert read.attitude.time_s[-1] == pytest.approx(39.98, abs=1e-6)
    np.testing.assert_allclose(read.attitude.yaw_rad, 3.0 + 0.1 * read.attitude.time_s, atol=1e-5)
    np.testing.assert_allclose(read.attitude.pitch_rad, -0.03, atol=1e-7)
    np.testing.assert_allclose(read.attitude.r_radps, 0.1, atol=1e-7)
    during = (read.actuators.time_s >= 20.0) & (read.actuators.time_s < 30.0)
    np.testing.assert_allclose(np.degrees(read.actuators.rudder_rad[during]), 4.0, atol=1e-5)
    np.testing.assert_allclose(read.actuators.thrust, 0.58, atol=1e-7)
    np.testing.assert_allclose(read.depth.depth_m, 4.0 + 0.05 * read.depth.time_s, atol=1e-5)
    np.testing.assert_allclose(read.setpoints.heading_rad, -2.0, atol=1e-6)
    np.testing.assert_allclose(read.setpoints.depth_m, 4.0)


def events(path: Path) -> list[tuple[float, VehicleEvent]]:
    """Return the events of a log, with times rounded to a microsecond."""
    return [(round(time_s, 6), event) for time_s, event in readers.read(path).events]


def test_long_text_chunks_are_joined(path: Path) -> None:
    assert events(path) == [
        (20.0, TestStarted(TestAxis.RUDDER, TestWave.STEP, -5.25)),
        (30.0, TestEnded(StopReason.COMPLETE)),
    ]


def test_modes_and_arming_are_read_from_heartbeat(tmp_path: Path) -> None:
    """Texts of modes are not used beside HEARTBEAT, so that a lost text changes nothing."""
    states = [
        (1.0, VehicleMode.HOLD, 0),
        (2.0, VehicleMode.MISSION, 128),
        (3.0, VehicleMode.MISSION, 128),
        (4.0, VehicleMode.SURFACE, 128),
        (5.0, 9, 0),
    ]
    heartbeats = [
        (time_s, mavlink.MAVLink_heartbeat_message(12, 0, 1 | armed, mode, 4, 3))
        for time_s, mode, armed in states
    ]
    expected = [
        (1.0, ModeChanged(VehicleMode.HOLD)),
        (2.0, ModeChanged(VehicleMode.MISSION)),
        (2.0, Armed()),
        (4.0, ModeChanged(VehicleMode.SURFACE)),
        (5.0, ModeChanged(None)),
    ]
    entries = dive(seconds=6.0, test=None)
    silent = recording.write(tmp_path / "silent.mcap", entries + heartbeats, {})
    texts = [*recording.texts(2.0, "Armed: MISSION", 1), *recording.texts(4.0, "Mode SURFACE", 2)]
    whole = recording.write(tmp_path / "whole.mcap", entries + heartbeats + texts, {})
    assert events(silent) == events(whole) == expected
    old = recording.write(tmp_path / "texts.mcap", entries + texts, {})
    assert events(old) == [(2.0, Armed()), (4.0, ModeChanged(VehicleMode.SURFACE))]
    bare = recording.write(tmp_path / "bare.mcap", entries, {})
    assert readers.read(silent).sha256 == readers.read(bare).sha256


def test_run_is_cut_on_uniform_grid(path: Path) -> None:
    log = readers.read(path)
    own = replace(log, parameters={**log.parameters, segments.OWN_PARAMETER: 5.0})
    (run,) = segments.cut_runs(own)
    assert (run.name, run.plane, run.wave, run.magnitude_deg) == ("dive/1", "yaw", "step", -5.25)
    assert run.time_s[0] == pytest.approx(-segments.PREROLL_S)
    assert run.time_s[-1] == pytest.approx(10.0)
    np.testing.assert_allclose(np.diff(run.time_s), 0.02, atol=1e-12)
    stepped = run.time_s[np.flatnonzero(run.rudder_rad > 0.01)]
    assert stepped[0] == pytest.approx(0.0)
    assert run.stop_reason == StopReason.COMPLETE
    assert run.longest_gap_s < 0.11
    assert math.degrees(run.rudder_trim_rad) == pytest.approx(6.0)
    assert run.since(-1.0).time_s[0] == pytest.approx(-1.0)


def test_run_has_velocity_without_false_echoes(path: Path) -> None:
    """A false echo of a Doppler log makes one sample wrong; one of them is even backwards."""
    time_s = np.arange(0.0, 40.0, 0.2)
    forward_mps = 1.3 + 0.005 * np.random.default_rng(1).standard_normal(time_s.size)
    forward_mps[[70, 110, 130]] = 2.4, -0.3, 0.2
    velocity = Velocity(time_s, forward_mps, 0.0 * time_s, 0.0 * time_s, VelocitySource.WATER_TRACK)
    (run,) = segments.cut_runs(replace(readers.read(path), velocity=velocity))
    assert run.relative_speed is not None
    np.testing.assert_allclose(run.relative_speed, 1.0, atol=0.02)


@pytest.mark.parametrize(
    ("ending", "reason", "detail"),
    [
        (
            "SystemID Stopped: depth 2.0 m: above 3.0 m",
            StopReason.DEPTH,
            "depth 2.0 m: above 3.0 m",
        ),
        ("nothing of note", StopReason.LOG_ENDED, "the log ended"),
    ],
)
def test_stopped_run_has_stop_reason(
    tmp_path: Path, ending: str, reason: StopReason, detail: str
) -> None:
    entries = dive(test=(20.0, 25.0, ending))
    (run,) = segments.cut_runs(readers.read(recording.write(tmp_path / "a.mcap", entries, {})))
    assert (run.stop_reason, run.stop_detail) == (reason, detail)


def test_longest_gap_is_measured(tmp_path: Path) -> None:
    entries = [e for e in dive() if not (24.0 < e[0] < 24.5 and e[1].msgname == "ATTITUDE")]
    (run,) = segments.cut_runs(readers.read(recording.write(tmp_path / "gap.mcap", entries, {})))
    assert run.longest_gap_s == pytest.approx(0.5, abs=0.021)


def test_repeated_and_late_samples_are_dropped(tmp_path: Path) -> None:
    entries = dive(seconds=2.0, test=None)
    stale = attitude(0.5, 3.05, 0.1)
    read = readers.read(recording.write(tmp_path / "late.mcap", [*entries, stale], {}))
    assert np.all(np.diff(read.attitude.time_s) > 0)


def test_log_errors_name_file_and_remedy(tmp_path: Path, path: Path) -> None:
    with pytest.raises(LogError, match=r"nowhere\.mcap: No such file.*give an MCAP log"):
        readers.read(tmp_path / "nowhere.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-4000])
    with pytest.raises(LogError, match=r"cut\.mcap: .*ground log recover"):
        readers.read(cut)
    still = recording.write(
        tmp_path / "still.mcap", [e for e in dive() if e[1].msgname != "ATTITUDE"], {}
    )
    with pytest.raises(LogError, match=r"still\.mcap: holds no .*ATTITUDE"):
        readers.read(still)
    quiet = recording.write(tmp_path / "quiet.mcap", dive(test=None), {})
    with pytest.raises(refit.RefitError, match=r"quiet\.mcap: no test found"):
        refit.refit(refit.RefitRequest(paths=[quiet]))


def test_tracking_excludes_settling_and_tests(tmp_path: Path) -> None:
    """The heading error is 0.5 deg; the depth error is 1 m at each change and then 0.1 m."""
    entries: list[Entry] = []
    for k in range(100 * 50):
        t = k / 50
        wanted = 0.0 if t < 50 else 1.0
        settling = 1.0 if (t % 50.0) < 20.0 else 0.0
        entries.append(attitude(t, wanted + math.radians(0.5), 0.0))
        entries.append(actuators(t, 0.0, 0.0))
        if k % 5 == 0:
            entries += [
                position(t, 5.1 + settling),
                heading_target(t, wanted),
                depth_target(t, 5.0),
            ]
    found = tracking_metrics.tracking(
        readers.read(recording.write(tmp_path / "hold.mcap", entries, {}))
    )
    assert found is not None
    assert [round(w.stop_s - w.start_s) for w in found.windows] == [25, 25]
    assert found.heading_deg.p95 == pytest.approx(0.5, abs=1e-4)
    assert found.depth_m.max == pytest.approx(0.1, abs=1e-5)
    assert found.depth_m.mean == pytest.approx(0.1, abs=1e-5)
    assert found.pitch_deg.max == pytest.approx(0.0, abs=1e-6)


NAN = math.nan
STILL = (0.0, 0.0, 0.0, 0.0)
"""Yaw, yaw rate, rudder and depth of a vehicle that does not move."""
DEGENERATE: dict[str, tuple[tuple[float, float, float, float], str]] = {
    "constant": (STILL, "no excitation: the rudder moved by 0.00 deg"),
    "no answer": ((0.0, 0.0, 0.3, 4.0), "the rudder does not move the yaw rate, which is constant"),
    "no attitude": ((NAN, NAN, 0.3, 4.0), "holds 0 usable samples of attitude"),
    "no depth": ((0.0, 0.0, 0.3, NAN), "holds 0 usable samples of depth"),
    "no command": ((0.0, 0.0, NAN, 4.0), "no excitation: the rudder moved by 0.00 deg"),
    "beyond measure": ((0.0, 1e30, 0.3, 1e30), "holds 0 usable samples of attitude"),
}


@pytest.mark.parametrize("case", DEGENERATE)
@pytest.mark.filterwarnings("error")
def test_degenerate_data_are_refused_without_warning(tmp_path: Path, case: str) -> None:
    """Neither LinAlgError nor a warning of numpy reaches the user."""
    (yaw, rate, rudder, depth), said = DEGENERATE[case]
    entries: list[Entry] = []
    for k in range(2000):
        moved = rudder if k >= 1000 else 0.0 * rudder
        entries += [attitude(k / 50, yaw, rate), actuators(k / 50, moved, 0.0)]
        entries.append(position(k / 50, depth))
    path = recording.write(tmp_path / "bad.mcap", entries, {})
    mark = segments.MarkedInterval(20.0, 35.0, Plane.YAW)
    with pytest.raises(InputError, match=f"bad.mcap: .*{said}") as refused:
        refit.refit(refit.RefitRequest(paths=[path], marks=[mark]))
    assert "\n" not in str(refused.value)
