"""Velocity and acceleration are read where a log has them, in body axes.

Reference: the velocity in FRD that tests.sysid.data.readers.files turns to NED with scipy.
"""

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from sysid.data import readers, segments
from sysid.data.dataset import Log, VelocitySource
from tests.sysid import recording
from tests.sysid.data.readers import files
from tests.sysid.data.readers.test_csv_table import COLUMNS, rows, write

WRITERS: dict[str, Callable[[Path], Path]] = {
    "local position": lambda path: files.tlog(path, position=files.moving_local_position),
    "global position": lambda path: files.tlog(path, position=files.moving_global_position),
    "dataflash": lambda path: files.dataflash(path, variant="estimator"),
    "ulog": files.ulog,
}
DVL_COMPONENT = 197


def assert_velocity(log: Log, source: VelocitySource, tolerance: float) -> None:
    velocity = log.velocity
    assert velocity.source == source
    measured = np.stack([velocity.forward_mps, velocity.starboard_mps, velocity.down_mps])
    expected = np.array(files.BODY_VELOCITY_MPS)[:, None]
    np.testing.assert_allclose(measured, np.broadcast_to(expected, measured.shape), atol=tolerance)


@pytest.mark.parametrize("form", WRITERS)
def test_velocity_in_ned_is_read_in_body_axes(form: str, tmp_path: Path) -> None:
    """Tolerance: cm/s in GLOBAL_POSITION_INT, 0.01 deg of ATT, and angles between samples."""
    log = readers.read(WRITERS[form](tmp_path / "dive"))
    assert_velocity(log, VelocitySource.ESTIMATE, 0.008 if form == "global position" else 0.002)
    (run,) = segments.cut_runs(log)
    assert run.velocity_source == VelocitySource.ESTIMATE
    assert run.forward_mps.shape == run.time_s.shape
    np.testing.assert_allclose(run.forward_mps, files.BODY_VELOCITY_MPS[0], atol=0.01)
    assert run.since(2.0).forward_mps.shape == run.since(2.0).time_s.shape


def test_ground_speed_has_no_direction(tmp_path: Path) -> None:
    path = files.tlog(tmp_path / "dive.tlog", position=files.moving_vfr_hud)
    velocity = readers.read(path).velocity
    assert velocity.source == VelocitySource.GROUND_SPEED
    np.testing.assert_allclose(velocity.forward_mps, 1.2, atol=0.04)
    assert np.all(np.isnan(velocity.starboard_mps))


def test_constant_velocity_of_an_estimator_is_no_measurement(tmp_path: Path) -> None:
    """Without a measurement ArduPilot reports zero, PX4 the last value."""
    log = readers.read(files.tlog(tmp_path / "dive.tlog"))
    assert log.velocity.source == VelocitySource.NONE
    (run,) = segments.cut_runs(log)
    assert run.forward_mps.size == 0
    assert run.since(2.0).forward_mps.size == 0


@pytest.mark.parametrize("source", [VelocitySource.WATER_TRACK, VelocitySource.BOTTOM_TRACK])
def test_doppler_log_comes_before_the_estimate(source: VelocitySource, tmp_path: Path) -> None:
    path = files.tlog(tmp_path / "dive.tlog", position=files.moving_vfr_hud)
    whole = readers.read(path)
    path.write_bytes(path.read_bytes() + doppler_log(source))
    log = readers.read(path)
    assert_velocity(log, source, 1e-6)
    assert log.sha256 == whole.sha256, "models of earlier versions must recognise their logs"


def doppler_log(source: VelocitySource) -> bytes:
    """Return the messages of the Doppler log as they follow in a tlog."""
    link = mavlink.MAVLink(None, 1, DVL_COMPONENT)
    stamped = (
        struct.pack(">Q", 1_700_000_000_000_000 + round(1e6 * time_s)) + bytes(message.pack(link))
        for time_s, message in doppler_messages(source)
    )
    return b"".join(stamped)


def doppler_messages(source: VelocitySource) -> Iterator[recording.Entry]:
    """Yield the ODOMETRY of a Doppler log at 5 Hz; every tenth measures nothing."""
    frame = (
        mavlink.MAV_FRAME_BODY_FRD
        if source == VelocitySource.WATER_TRACK
        else mavlink.MAV_FRAME_LOCAL_FRD
    )
    pose = (math.nan, math.nan, math.nan, [math.nan] * 4)
    for k, s in enumerate(files.samples()):
        velocity = (math.nan,) * 3 if k % 100 == 50 else files.BODY_VELOCITY_MPS
        motion = (*velocity, *(math.nan,) * 3, [math.nan] * 21, [math.nan] * 21)
        if k % 10 == 0:
            us = round(1e6 * s.time_s)
            yield (
                s.time_s,
                mavlink.MAVLink_odometry_message(
                    us, frame, mavlink.MAV_FRAME_BODY_FRD, *pose, *motion
                ),
            )


def test_onboard_log_has_doppler_log_and_accelerometer(tmp_path: Path) -> None:
    """The devices have components of their own; the autopilot's ODOMETRY is its estimate."""

    def entries() -> Iterator[recording.Entry]:
        for s in files.samples():
            ms, us = round(1e3 * s.time_s), round(1e6 * s.time_s)
            yield s.time_s, mavlink.MAVLink_attitude_message(ms, 0, s.pitch_rad, s.yaw_rad, 0, 0, 0)
            yield s.time_s, files.moving_local_position(s)
            controls = [s.rudder, s.elevator, s.thrust, *[0.0] * 29]
            yield s.time_s, mavlink.MAVLink_actuator_output_status_message(us, 7, controls)
            force = (0.1 * s.yaw_rad, -0.2, -9.8)
            rest = (0.0,) * 9
            yield s.time_s, mavlink.MAVLink_hil_sensor_message(us, *force, *rest, 0.0, 0)
        yield from doppler_messages(VelocitySource.WATER_TRACK)

    devices = {"ODOMETRY": DVL_COMPONENT, "HIL_SENSOR": 25}
    path = recording.write(tmp_path / "dive.mcap", entries(), {}, components=devices)
    log = readers.read(path)
    assert_velocity(log, VelocitySource.WATER_TRACK, 1e-6)
    np.testing.assert_allclose(log.specific_force.z_mps2, -9.8, rtol=1e-6)
    assert log.specific_force.time_s.size == log.attitude.time_s.size


@pytest.mark.parametrize(
    "write_log",
    [
        lambda path: files.dataflash(path, variant="ArduRover"),
        lambda path: files.ulog(path, variant="gyro and barometer"),
    ],
    ids=["dataflash", "ulog"],
)
def test_accelerometer_is_read(write_log: Callable[[Path], Path], tmp_path: Path) -> None:
    log = readers.read(write_log(tmp_path / "dive"))
    (run,) = segments.cut_runs(log)
    x_mps2, y_mps2, z_mps2 = files.SPECIFIC_FORCE_MPS2
    np.testing.assert_allclose(run.specific_force_x_mps2, x_mps2 + run.r_radps, atol=1e-6)
    np.testing.assert_allclose(run.specific_force_y_mps2, y_mps2, rtol=1e-6)
    np.testing.assert_allclose(run.specific_force_z_mps2, z_mps2, rtol=1e-6)


def test_csv_columns_of_velocity_and_gap(tmp_path: Path) -> None:
    """Rows 22 to 26 s of the dive have no speed: unknown further than 1 s from a sample."""
    lines = [
        f"{row},{'' if 22.0 <= k / files.RATE_HZ < 26.0 else 1.25}" for k, row in enumerate(rows())
    ]
    log = readers.read(write(tmp_path / "dive.csv", f"{COLUMNS},u_mps", lines))
    assert log.velocity.source == VelocitySource.COLUMN
    (run,) = segments.cut_runs(log)
    since_start_s = run.time_s + files.TEST[0]
    unknown = (since_start_s > 23.1) & (since_start_s < 24.9)
    assert np.all(np.isnan(run.forward_mps[unknown]))
    known = (since_start_s < 22.5) | (since_start_s > 25.5)
    np.testing.assert_allclose(run.forward_mps[known], 1.25)
    assert np.all(np.isnan(run.starboard_mps))
