"""One dive, written in each format by its specification, is read as the same run."""

import math
import re
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink
from scipy.spatial.transform import Rotation

from sysid import usable_runs
from sysid.data import readers, segments
from sysid.data.dataset import LogError
from sysid.data.events import StopReason
from sysid.data.readers import (
    dataflash,
    messages,
    px4_outputs,
    servo_channels,
    ulog,
    ulog_recovery,
)
from sysid.data.readers.parameter_history import history_of
from sysid.data.readers.samples import FileDamage, MessageColumns
from sysid.data.readers.servo_channels import FROM_LOG, OutputOptions, ServoChannels
from sysid.data.runs import RATE_HZ, Run
from sysid.data.segments import MarkedInterval
from sysid.planes import Plane
from sysid.prior_knowledge import RefitError
from sysid.screening import screen
from tests.sysid import recording
from tests.sysid.data.readers import files

WRITERS: dict[str, Callable[[Path], Path]] = {
    "tlog": files.tlog,
    "bin": files.dataflash,
    "ulg": files.ulog,
}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("logs")
    return {suffix: write(folder / f"dive.{suffix}") for suffix, write in WRITERS.items()}


def the_run(
    path: Path, marks: tuple[MarkedInterval, ...] = (), chosen: ServoChannels | None = None
) -> Run:
    log = readers.read(path, FROM_LOG._replace(channels=chosen))
    known = replace(log, parameters={**log.parameters, segments.LOOP_RATE: RATE_HZ})
    (run,) = segments.cut_runs(known, marks)
    return run


@pytest.mark.parametrize("suffix", WRITERS)
def test_all_formats_give_the_same_run(written: dict[str, Path], suffix: str) -> None:
    """Tolerance: resolution of the format, 0.01 degree in ATT and 1 us in pulses."""
    run = the_run(written[suffix])
    testing = (run.time_s >= 0.0) & (run.time_s < 9.99)
    assert (run.plane, run.stop_reason) == ("yaw", StopReason.COMPLETE)
    assert run.magnitude_deg == pytest.approx(4.0, abs=0.01)
    assert run.time_s[-1] == pytest.approx(10.0, abs=0.03)
    assert run.time_s[0] == pytest.approx(-15.0, abs=0.03)
    np.testing.assert_allclose(np.degrees(run.rudder_rad[testing]), 4.0, atol=0.02)
    np.testing.assert_allclose(np.degrees(run.elevator_rad), 1.2, atol=0.02)
    np.testing.assert_allclose(run.thrust, 0.58, atol=0.002)
    np.testing.assert_allclose(np.degrees(run.r_radps[testing]), 3.0, atol=1e-4)
    np.testing.assert_allclose(np.degrees(run.pitch_rad), math.degrees(-0.03), atol=0.006)
    turned = np.degrees(run.heading_rad - run.heading_rad[0])
    np.testing.assert_allclose(turned[testing], 3.0 * run.time_s[testing], atol=0.03)
    np.testing.assert_allclose(run.depth_m, 4.0 + 0.05 * (20.0 + run.time_s), atol=1e-3)
    assert run.longest_gap_s < 0.11
    (screening,) = screen([run])
    assert screening.reasons == ()


def test_ulog_uses_time_of_sample(written: dict[str, Path]) -> None:
    """The time stamp of a PX4 topic is later than ``timestamp_sample``, which is used."""
    read = readers.read(written["ulg"])
    assert read.attitude.time_s[0] == pytest.approx(files.BOOTED_S, abs=1e-6)
    turning = read.attitude.time_s[np.flatnonzero(read.attitude.r_radps > 0.01)[0]]
    assert turning == pytest.approx(files.BOOTED_S + files.TEST[0], abs=1e-6)


def test_ulog_with_a_second_instance_only_gives_the_same_run(tmp_path: Path) -> None:
    """As in a .bin, the lowest instance that the log holds is read, whatever its number."""
    check_run(the_run(files.ulog(tmp_path / "second.ulg", instance=1)))


def test_ulog_topics_subscribed_again_are_read_whole(tmp_path: Path) -> None:
    """A subscription with another number continues the samples of the one before."""
    path = files.ulog(tmp_path / "again.ulg", subscribe_again=True)
    check_run(the_run(path))
    (longest,) = {table.time_s.size for table in readers.load(path).tables.values()} - {400}
    assert longest == files.SECONDS * files.RATE_HZ


def test_format_is_detected_from_content(written: dict[str, Path], tmp_path: Path) -> None:
    for suffix, path in written.items():
        renamed = tmp_path / f"{suffix}.log"
        renamed.write_bytes(path.read_bytes())
        assert readers.read(renamed).sha256 == readers.read(path).sha256
    for name, data in (("notes.txt", b"no log of any kind"), ("empty", b"")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(
            LogError, match=rf"{name}: not a log of a known format; give an MCAP log, .*\.ulg"
        ):
            readers.read(tmp_path / name)


@pytest.mark.parametrize("suffix", WRITERS)
def test_parameters_are_read(written: dict[str, Path], suffix: str) -> None:
    assert readers.read(written[suffix]).parameters == {"ACT_TRAVEL_DEG": 12.0}


def test_outputs_selected_and_reversed(tmp_path: Path) -> None:
    path = files.tlog(tmp_path / "servos.tlog", files.servo_pulses)
    run = the_run(path, chosen=servo_channels.parse("3,-1,2"))
    assert np.degrees(run.rudder_rad[run.time_s == 0.0]) == pytest.approx(4.0, abs=0.02)
    np.testing.assert_allclose(np.degrees(run.elevator_rad), 1.2, atol=0.02)
    np.testing.assert_allclose(run.thrust, 0.58, atol=0.002)
    with pytest.raises(
        LogError, match=r"servos\.tlog: SERVO_OUTPUT_RAW has 16 outputs but not number 17"
    ):
        readers.read(path, OutputOptions(ServoChannels(17, 1, 2)))
    for text in ("1,2", "0,1,2", "rudder"):
        with pytest.raises(LogError, match="give RUDDER,ELEVATOR,THRUST"):
            servo_channels.parse(text)


def test_marked_interval_without_texts_gives_run(tmp_path: Path) -> None:
    path = files.ulog(tmp_path / "silent.ulg", texts=False)
    assert segments.cut_runs(readers.read(path)) == []
    run = the_run(path, (MarkedInterval(120.0, 130.0, Plane.YAW),))
    assert (run.wave, run.plane) == ("marked", "yaw")
    assert run.magnitude_deg == pytest.approx(4.0, abs=0.01)
    assert run.rudder_rad[run.time_s >= 0.0][0] == pytest.approx(math.radians(4.0), abs=1e-3)
    with pytest.raises(
        LogError, match=r"silent\.ulg: run 120\.\.150 must lie within the log, 100\.0\.\.140\.0 s"
    ):
        the_run(path, (MarkedInterval(120.0, 150.0, Plane.YAW),))


def test_ardupilot_mode_change_ends_test(tmp_path: Path) -> None:
    """The mode change at the start of the test does not end it."""
    run = the_run(files.dataflash(tmp_path / "left.bin", ending="MODE"))
    assert (run.stop_reason, run.stop_detail) == (StopReason.MODE, "the mode changed")
    assert run.time_s[-1] == pytest.approx(10.0, abs=0.03)


@pytest.mark.parametrize(
    ("suffix", "lost", "named"),
    [
        ("bin", b"RCOU", "RCOU"),
        ("bin", b"ATT\0", "ATT"),
        ("ulg", b"vehicle_attitude", "vehicle_attitude"),
        ("ulg", b"actuator_outputs", "actuator_outputs"),
    ],
)
def test_missing_message_is_named_in_error(
    written: dict[str, Path], tmp_path: Path, suffix: str, lost: bytes, named: str
) -> None:
    path = tmp_path / f"less.{suffix}"
    path.write_bytes(written[suffix].read_bytes().replace(lost, b"X" * len(lost)))
    with pytest.raises(
        LogError, match=rf"less\.{suffix}: holds no {named}\..*identification needs"
    ):
        readers.read(path)


@pytest.mark.parametrize("suffix", WRITERS)
def test_tables_contain_all_messages(written: dict[str, Path], suffix: str) -> None:
    found = readers.load(written[suffix]).tables
    attitude = {"tlog": "/mavlink/1/1/ATTITUDE", "bin": "ATT", "ulg": "vehicle_attitude"}[suffix]
    assert found[attitude].time_s.size == files.SECONDS * files.RATE_HZ
    assert found[attitude].time_s[0] == pytest.approx(files.BOOTED_S)


@pytest.mark.parametrize("suffix", WRITERS)
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_file_read_or_rejected_in_one_line(
    written: dict[str, Path], tmp_path: Path, suffix: str, data: st.DataObject
) -> None:
    whole = written[suffix].read_bytes()
    torn = bytearray(whole[: data.draw(st.integers(0, len(whole)))])
    for at, byte in data.draw(
        st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 255)), max_size=8)
    ):
        if torn:
            torn[at % len(torn)] = byte
    path = tmp_path / f"torn.{suffix}"
    path.write_bytes(torn)
    said = f"torn.{suffix}"
    try:
        segments.cut_runs(readers.read(path))
    except LogError as error:
        said = str(error)
    assert f"torn.{suffix}" in said
    assert "\n" not in said


def test_truncated_file_loses_only_its_end(written: dict[str, Path], tmp_path: Path) -> None:
    for suffix, path in written.items():
        whole = path.read_bytes()
        torn = tmp_path / f"torn.{suffix}"
        torn.write_bytes(whole[: len(whole) * 9 // 10 + 3])
        assert readers.read(torn).attitude.time_s[-1] == pytest.approx(
            files.BOOTED_S + 36.0, abs=0.5
        )
        assert the_run(torn).stop_reason == StopReason.COMPLETE
        damage = readers.read(torn).damage
        assert re.fullmatch(
            r"it ends within a message \(\d+ bytes\) at 13[56]\.\d s; what followed is lost", damage
        ), damage


@pytest.mark.parametrize("suffix", WRITERS)
def test_whole_file_reports_no_damage(written: dict[str, Path], suffix: str) -> None:
    assert readers.read(written[suffix]).damage == ""


@pytest.mark.parametrize("suffix", WRITERS)
def test_hole_in_file_is_reported_with_time_lost(
    written: dict[str, Path], tmp_path: Path, suffix: str
) -> None:
    """A twentieth of the file, about 2 s of 40 s from 120 s on, is overwritten by zeros.

    A .ulg has no checksum: the message at the edge of the hole is whole by its length, but its
    zeros are contradicted by the samples around it.
    """
    data = bytearray(written[suffix].read_bytes())
    first, last = len(data) // 2, len(data) * 11 // 20
    data[first:last] = bytes(last - first)
    path = tmp_path / f"hole.{suffix}"
    path.write_bytes(data)
    match = re.fullmatch(
        r"(\d+) bytes in 1 place are unreadable, (\d+\.\d+) s are lost at (\d+\.\d) s"
        r"(?:; 1 sample is contradicted .*)?",
        readers.read(path).damage,
    )
    assert match, readers.read(path).damage
    assert int(match[1]) == pytest.approx(last - first, abs=300)
    # MAVLink 2 cuts zeros at the end of a payload, so that frames of a tlog differ in length.
    assert float(match[2]) == pytest.approx(2.0, abs=0.2)
    assert float(match[3]) == pytest.approx(120.0, abs=1.0)


def test_ulog_wrong_sizes_are_skipped(written: dict[str, Path], tmp_path: Path) -> None:
    whole = written["ulg"].read_bytes()
    torn = bytearray(whole)
    for at in range(len(whole) // 2, len(whole), len(whole) // 7):
        torn[at : at + 4] = b"\xff\xff\xff\xff"
    torn[16:18] = b"\xff\xff"
    path = tmp_path / "wrong.ulg"
    path.write_bytes(torn)
    read, sound = readers.read(path), readers.read(written["ulg"])
    assert read.attitude.time_s[-1] == sound.attitude.time_s[-1]
    assert read.attitude.time_s.size > 0.99 * sound.attitude.time_s.size


@pytest.mark.timeout(60)
def test_ulog_without_topics_rejected_without_endless_loop(tmp_path: Path) -> None:
    """pyulog alone would search for the topics without end; a size beyond the end moves it back."""
    path = files.ulog(tmp_path / "lost.ulg", texts=False)
    torn, at, starts = bytearray(path.read_bytes()), 16, []
    while at < len(torn):
        starts.append(at)
        if torn[at + 2] == ord("A"):
            torn[at + 2] = 0
        at += 3 + int.from_bytes(torn[at : at + 2], "little")
    torn[starts[-3] : starts[-3] + 3] = b"\xff\xff\0"
    path.write_bytes(torn)
    with pytest.raises(LogError, match=r"lost\.ulg: holds no vehicle_attitude"):
        readers.read(path)


def test_undamaged_ulog_is_unchanged(written: dict[str, Path]) -> None:
    whole = written["ulg"].read_bytes()
    assert ulog_recovery.keep_sound_messages(whole) == (whole, FileDamage())


def test_travel_without_parameter_is_the_vehicles(tmp_path: Path) -> None:
    """The rudder is at a third of its travel; a surface with 9 deg of travel is at 3 deg."""
    path = files.dataflash(tmp_path / "other.bin", parameters={"SCHED_LOOP_RATE": 400.0})
    (run,) = segments.cut_runs(readers.read(path, OutputOptions(travel_deg=9.0)))
    assert math.degrees(run.travel_rad) == pytest.approx(9.0)
    assert math.degrees(np.max(run.rudder_rad)) == pytest.approx(3.0, abs=0.02)
    (run,) = segments.cut_runs(readers.read(path))
    assert math.degrees(run.travel_rad) == pytest.approx(15.0)


def test_travel_of_log_is_preferred_to_the_vehicles(written: dict[str, Path]) -> None:
    for path in written.values():
        (run,) = segments.cut_runs(readers.read(path, OutputOptions(travel_deg=9.0)))
        assert math.degrees(run.travel_rad) == pytest.approx(12.0)


def test_ardupilot_outputs_found_by_function(tmp_path: Path) -> None:
    """In the file the rudder is on output 1, the elevator on 2, the thrust on 3.

    As the parameters have it, output 2 is the reversed rudder with 200 us of travel, output 1 the
    elevator with another centre.
    """
    parameters = {
        "SERVO2_FUNCTION": 21.0,
        "SERVO2_REVERSED": 1.0,
        "SERVO2_MIN": 1300.0,
        "SERVO2_MAX": 1700.0,
        "SERVO1_FUNCTION": 19.0,
        "SERVO1_TRIM": 1600.0,
        "SERVO1_MIN": 1100.0,
        "SERVO1_MAX": 1900.0,
        "SERVO3_FUNCTION": 70.0,
    }
    assert servo_channels.find_channels(parameters) == ServoChannels(-2, 1, 3)
    path = files.dataflash(tmp_path / "rover.bin", parameters=parameters)
    run = the_run(path)
    # 1540 us on output 2: 0.2 of its travel, reversed. 1500 us on output 1: 100 us of 500 below.
    np.testing.assert_allclose(np.degrees(run.rudder_rad[:100]), -0.2 * 15.0, atol=0.05)
    np.testing.assert_allclose(np.degrees(run.elevator_rad[:100]), -0.2 * 15.0, atol=0.05)
    np.testing.assert_allclose(run.thrust, 0.58, atol=0.002)
    chosen = the_run(path, chosen=ServoChannels(1, 2, 3))
    assert np.degrees(chosen.elevator_rad[0]) == pytest.approx(0.2 * 15.0, abs=0.05)


def test_lowest_of_outputs_with_one_function_is_found() -> None:
    numbers = {"SERVO1": 21.0, "SERVO2": 19.0, "SERVO3": 70.0, "SERVO10": 19.0, "SERVO16": 21.0}
    parameters = {f"{output}_FUNCTION": function for output, function in numbers.items()}
    assert servo_channels.find_channels(parameters) == ServoChannels(1, 2, 3)


def test_read_servo_reversed_after_the_dive_counts_from_then_on(tmp_path: Path) -> None:
    servos = {"SERVO1_FUNCTION": 21.0, "SERVO3_FUNCTION": 70.0, "SERVO1_REVERSED": 0.0}
    last = {"SERVO1_REVERSED": 1.0}
    same = the_run(files.dataflash(tmp_path / "same.bin", parameters=servos))
    path = files.dataflash(tmp_path / "later.bin", parameters=servos, last_parameters=last)
    np.testing.assert_array_equal(the_run(path).rudder_rad, same.rudder_rad)
    assert readers.read(path).parameters["SERVO1_REVERSED"] == 1.0
    px4 = [
        files.ulog(
            tmp_path / f"{len(later)}.ulg",
            parameters={"PWM_MAIN_REV1": 0.0},
            last_parameters=later,
        )
        for later in ({}, {"PWM_MAIN_REV1": 1.0})
    ]
    np.testing.assert_array_equal(the_run(px4[0]).rudder_rad, the_run(px4[1]).rudder_rad)
    assert readers.read(px4[1]).parameters["PWM_MAIN_REV1"] == 1.0


def test_actuator_commands_follow_changes_of_parameters() -> None:
    """Reversed from 2.0 s on, twice the range from 3.0 s on; a gain of a loop is none of it."""
    history = history_of(
        [
            (0.0, "SERVO1_REVERSED", 0.0),
            (0.0, "SERVO1_MAX", 1900.0),
            (0.0, "SERVO1_MIN", 1100.0),
            (1.0, "YAW_RATE_P", 1.0),
            (1.5, "YAW_RATE_P", 2.0),
            (2.0, "SERVO1_REVERSED", 1.0),
            (3.0, "SERVO1_MAX", 2300.0),
            (9.0, "SERVO1_MAX", 1600.0),
        ]
    )
    time_s = np.arange(5.0)
    values = np.full((5, 3), 1700.0)
    commands = servo_channels.actuator_commands(
        time_s, values, OutputOptions(travel_deg=10.0), history, "log"
    )
    np.testing.assert_allclose(np.degrees(commands.rudder_rad), [5.0, 5.0, -5.0, -2.5, -2.5])
    assert history.latest()["SERVO1_MAX"] == 1600.0


@pytest.mark.parametrize(
    ("attitude", "position", "depth_tolerance_m"),
    [
        (files.attitude_quaternion, files.global_position, 2e-3),
        (files.ahrs2, files.vfr_hud, 1e-3),
        (files.ahrs2, files.ahrs2, 1e-3),
    ],
)
def test_tlog_alternative_messages_give_the_same_run(
    tmp_path: Path,
    attitude: Callable[[files.Sample], object],
    position: Callable[[files.Sample], object],
    depth_tolerance_m: float,
) -> None:
    """AHRS2 and VFR_HUD have no time; it is that of the message before them.

    Rates from AHRS2 are differences, so that their steps are spread over two samples.
    """
    path = files.tlog(
        tmp_path / "other.tlog", files.servo_pulses, attitude=attitude, position=position
    )
    run = the_run(path, chosen=ServoChannels(3, -1, 2))
    testing = (run.time_s >= 0.05) & (run.time_s < 9.9)
    np.testing.assert_allclose(np.degrees(run.rudder_rad[testing]), 4.0, atol=0.02)
    np.testing.assert_allclose(np.degrees(run.r_radps[testing]), 3.0, atol=0.01)
    np.testing.assert_allclose(np.degrees(run.pitch_rad), math.degrees(-0.03), atol=0.006)
    turned = np.degrees(run.heading_rad - run.heading_rad[0])
    np.testing.assert_allclose(turned[testing], 3.0 * run.time_s[testing], atol=0.06)
    np.testing.assert_allclose(
        run.depth_m, 4.0 + 0.05 * (20.0 + run.time_s), atol=depth_tolerance_m
    )
    depth = readers.read(path, FROM_LOG).depth
    np.testing.assert_allclose(depth.rate_mps[1:-1], 0.05, atol=1e-3)
    (screening,) = screen([run])
    assert screening.reasons == ()


def test_late_servo_pulses_have_their_own_time(tmp_path: Path) -> None:
    """SERVO_OUTPUT_RAW comes 80 ms late; its time of 32 bits wrapped before the dive."""
    earlier = [*files.samples()][:4]

    def late(s: files.Sample) -> object:
        earlier.append(s)
        message = files.servo_pulses(earlier.pop(0))
        assert isinstance(message, mavlink.MAVLink_servo_output_raw_message)
        message.time_usec = (message.time_usec - round(1e6 * (files.BOOTED_S + 10.0))) % 2**32
        return message

    def shifted(s: files.Sample) -> object:
        wrapped_s = s.time_s + 2**32 * 1e-6 - files.BOOTED_S - 10.0
        q = Rotation.from_euler("ZYX", [s.yaw_rad, s.pitch_rad, 0.0]).as_quat(scalar_first=True)
        ms = round(1e3 * wrapped_s)
        return mavlink.MAVLink_attitude_quaternion_message(ms, *q, 0, 0, s.yaw_rate_radps)

    path = files.tlog(
        tmp_path / "late.tlog", late, attitude=shifted, position=files.vfr_hud, clock=False
    )
    chosen = ServoChannels(3, -1, 2)
    run = the_run(path, chosen=chosen)
    in_time = the_run(files.tlog(tmp_path / "pulses.tlog", files.servo_pulses), chosen=chosen)
    starts = [r.time_s[np.argmax(r.rudder_rad > 0.01)] for r in (run, in_time)]
    assert starts[0] == pytest.approx(starts[1], abs=0.002)


@pytest.mark.parametrize("lead_s", [0.0, 1.5])
def test_servo_pulses_with_the_only_time_keep_the_delay(tmp_path: Path, lead_s: float) -> None:
    """SERVO_OUTPUT_RAW gives the time of AHRS2, wherever its clock stands at the first message."""

    def booted(s: files.Sample) -> object:
        message = files.servo_pulses(s)
        assert isinstance(message, mavlink.MAVLink_servo_output_raw_message)
        message.time_usec = round(1e6 * (s.time_s - files.BOOTED_S + lead_s))
        return message

    path = files.tlog(
        tmp_path / "rx.tlog", booted, attitude=files.ahrs2, position=files.ahrs2, clock=False
    )
    log = readers.read(path, OutputOptions(channels=ServoChannels(3, -1, 2)))
    commanded_s = log.actuators.time_s[np.argmax(log.actuators.rudder_rad > 0.01)]
    turned_s = log.attitude.time_s[np.argmax(log.attitude.r_radps > 0.02)]
    assert turned_s == pytest.approx(commanded_s, abs=1.1 / files.RATE_HZ)


def test_tlog_without_any_time_has_that_of_reception(tmp_path: Path) -> None:
    path = files.tlog(tmp_path / "rx.tlog", attitude=files.ahrs2, position=files.ahrs2, clock=False)
    log = readers.read(path)
    assert log.attitude.time_s.size == files.SECONDS * files.RATE_HZ
    assert np.ptp(log.attitude.time_s) == pytest.approx(files.SECONDS, abs=0.05)


def test_tlog_without_attitude_names_what_is_missing(tmp_path: Path) -> None:
    path = files.tlog(tmp_path / "still.tlog", attitude=files.vfr_hud)
    with pytest.raises(
        LogError,
        match=r"still\.tlog: holds no ATTITUDE or ATTITUDE_QUATERNION or AHRS2 of a vehicle;",
    ):
        readers.read(path)


@pytest.mark.parametrize(
    ("suffix", "lost"),
    [("tlog", b""), ("bin", b"CTUN"), ("ulg", b"vehicle_local_position")],
)
def test_log_without_depth_gives_the_rudder_test(
    written: dict[str, Path], tmp_path: Path, suffix: str, lost: bytes
) -> None:
    path = tmp_path / f"yaw.{suffix}"
    if suffix == "tlog":
        files.tlog(path, position=files.system_time)
    else:
        path.write_bytes(written[suffix].read_bytes().replace(lost, b"X" * len(lost)))
    log = readers.read(path)
    assert not np.any(log.depth.depth_m)
    (run,) = segments.cut_runs(log)
    assert screen([run])[0].reasons == ()
    (other,) = screen([replace(run, plane=Plane.PITCH)])
    assert other.reasons[0] == "no depth: the log holds none, and a test of the elevator needs it"


def test_tlog_with_every_message_twice(tmp_path: Path, written: dict[str, Path]) -> None:
    """A ground station with two links to the vehicle records both."""
    run, once = the_run(files.tlog(tmp_path / "twice.tlog", links=2)), the_run(written["tlog"])
    assert (run.stop_reason, run.wave) == (StopReason.COMPLETE, once.wave)
    np.testing.assert_array_equal(run.time_s, once.time_s)
    np.testing.assert_array_equal(run.r_radps, once.r_radps)


def check_run(run: Run) -> None:
    """Check the values of the dive, within the resolution of the formats."""
    testing = (run.time_s >= 0.0) & (run.time_s < 9.99)
    np.testing.assert_allclose(np.degrees(run.rudder_rad[testing]), 4.0, atol=0.02)
    np.testing.assert_allclose(np.degrees(run.elevator_rad), 1.2, atol=0.02)
    np.testing.assert_allclose(run.thrust, 0.58, atol=0.002)
    np.testing.assert_allclose(np.degrees(run.r_radps[testing]), 3.0, atol=1e-4)
    np.testing.assert_allclose(np.degrees(run.pitch_rad), math.degrees(-0.03), atol=0.006)
    np.testing.assert_allclose(run.depth_m, 4.0 + 0.05 * (20.0 + run.time_s), atol=1e-3)


@pytest.mark.parametrize("variant", files.VARIANTS)
def test_ardupilot_vehicles_give_the_same_run(tmp_path: Path, variant: str) -> None:
    check_run(the_run(files.dataflash(tmp_path / "dive.bin", variant=variant)))


def test_ardupilot_log_with_milliseconds_gives_the_same_run(tmp_path: Path) -> None:
    """Versions before 2015: PARM and MSG have no time, and GPS has that of the week first."""
    path = files.dataflash_2014(tmp_path / "old.bin")
    log = readers.read(path)
    assert log.parameters == {"ACT_TRAVEL_DEG": 12.0, "INS_FILTER": 20.0}
    check_run(the_run(path))
    tables, damage = dataflash.load(path)
    assert not damage.impossible_names
    assert tables["GPS"].time_s[0] == pytest.approx(files.BOOTED_S)
    ends_s = files.BOOTED_S + files.TEST[0], files.BOOTED_S + files.TEST[1]
    assert [event.time_s for event in log.events] == pytest.approx(ends_s)
    assert tables["PARM"].time_s == pytest.approx((files.BOOTED_S, ends_s[1]))


@pytest.mark.parametrize("variant", files.ULOG_VARIANTS)
def test_px4_versions_give_the_same_run(tmp_path: Path, variant: str) -> None:
    """From 1.14 the thrust is a motor, which is output 9."""
    check_run(the_run(files.ulog(tmp_path / "dive.ulg", variant=variant)))


@pytest.mark.parametrize("suffix", ["bin", "ulg"])
def test_logs_without_rates_have_those_of_the_angles(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ATT has steps of 0.01 deg, so that a difference over two samples is off by 0.25 deg/s."""
    monkeypatch.setitem(files.VARIANTS, "angles", files.DataflashVariant(rates=""))
    monkeypatch.setitem(files.ULOG_VARIANTS, "angles", files.UlogVariant(rates=""))
    path = tmp_path / f"angles.{suffix}"
    if suffix == "bin":
        run = the_run(files.dataflash(path, variant="angles"))
    else:
        run = the_run(files.ulog(path, variant="angles"))
    testing = (run.time_s >= 0.05) & (run.time_s < 9.9)
    np.testing.assert_allclose(np.degrees(run.r_radps[testing]), 3.0, atol=0.26)
    assert np.degrees(np.mean(run.r_radps[testing])) == pytest.approx(3.0, abs=0.01)
    (screening,) = screen([run])
    assert screening.reasons == ()


def test_px4_pulses_have_the_range_of_its_parameters(tmp_path: Path) -> None:
    """An output of -1 to 1 has a pulse of PWM_MAIN_MINn to MAXn (PX4, Actuator Configuration).

    The motor turns forwards only, 0 to 1; the elevator's servo is reversed.
    """
    surfaces = {"CA_SV_CS0_TYPE": 3.0, "CA_SV_CS1_TYPE": 4.0}
    outputs = {"PWM_MAIN_FUNC1": 202.0, "PWM_MAIN_FUNC2": 201.0, "PWM_MAIN_FUNC3": 101.0}
    ranges = {
        f"PWM_MAIN_{name}{n}": us
        for n in (1, 2, 3)
        for name, us in (("MIN", 1000.0), ("MAX", 2000.0))
    }
    path = files.ulog(
        tmp_path / "wide.ulg",
        parameters=surfaces | outputs | ranges | {"PWM_MAIN_REV": 0b10},
        pulse_of=lambda fraction: round(1500 + 500 * fraction),
    )
    run = the_run(path)
    testing = (run.time_s >= 0.0) & (run.time_s < 9.99)
    np.testing.assert_allclose(np.degrees(run.rudder_rad[testing]), 4.0, atol=0.02)
    np.testing.assert_allclose(np.degrees(run.elevator_rad), -1.2, atol=0.02)
    np.testing.assert_allclose(run.thrust, (500 + 500 * 0.58) / 1000, atol=0.002)


def test_damaged_parameters_of_outputs_are_none() -> None:
    names = ("PWM_MAIN_FUNC1", "PWM_MAIN_MIN1", "PWM_MAIN_REV", "CA_R_REV", "CA_SV_CS0_TYPE")
    for value in (math.nan, math.inf, -1e30):
        damaged = dict.fromkeys(names, value)
        assert "SERVO1_FUNCTION" not in px4_outputs.servo_parameters(damaged)
        assert px4_outputs.surface_parameters(damaged) == {"SERVO9_FUNCTION": 70}
        assert servo_channels.mixed_surfaces({"SERVO1_FUNCTION": value}) == ""


V_TAIL = {"SERVO1_FUNCTION": 79.0, "SERVO2_FUNCTION": 80.0, "SERVO3_FUNCTION": 70.0}
"""ArduPilot, Plane: SERVOn_FUNCTION 79 and 80 are V-tail left and right."""


@pytest.mark.parametrize("is_reversed", [False, True])
def test_v_tail_gives_the_same_run(tmp_path: Path, is_reversed: bool) -> None:
    """left = elevator + rudder, right = elevator - rudder (ArduPilot, Plane: servos.cpp)."""
    parameters = V_TAIL | {"ACT_TRAVEL_DEG": 12.0, "SERVO2_REVERSED": float(is_reversed)}

    def halves(s: files.Sample) -> tuple[float, float]:
        right = s.elevator - s.rudder
        return s.elevator + s.rudder, -right if is_reversed else right

    path = files.dataflash(tmp_path / "vtail.bin", parameters=parameters, surfaces=halves)
    check_run(the_run(path))
    usable_runs.refuse_miswired(usable_runs.cut_logs([readers.read(path)], []))
    assert servo_channels.names_surfaces(V_TAIL)


PX4_OUTPUTS = {"PWM_MAIN_FUNC1": 201.0, "PWM_MAIN_FUNC2": 202.0, "PWM_MAIN_FUNC3": 101.0}


def px4_halves(
    *torques: tuple[float, float, float],
) -> tuple[dict[str, float], files.Surfaces]:
    """Return parameters and outputs of halves with a type, a pitch and a yaw torque each.

    PX4 sets outputs whose torques add up to the commanded ones.
    """
    parameters = dict(PX4_OUTPUTS)
    for k, (kind, pitch, yaw) in enumerate(torques):
        parameters[f"CA_SV_CS{k}_TYPE"] = kind
        parameters[f"CA_SV_CS{k}_TRQ_P"], parameters[f"CA_SV_CS{k}_TRQ_Y"] = pitch, yaw
    matrix = np.array([(yaw, pitch) for _, pitch, yaw in torques])

    def surfaces(s: files.Sample) -> tuple[float, float]:
        first, second = np.linalg.solve(matrix.T, (s.rudder, s.elevator))
        return float(first), float(second)

    return parameters, surfaces


@pytest.mark.parametrize("variant", ["1.10 to 1.13", "from 1.14", "simulated"])
@pytest.mark.parametrize(
    "torques",
    [
        ((7.0, 0.5, 0.5), (8.0, 0.5, -0.5)),
        ((13.0, 0.5, -0.5), (14.0, 0.5, 0.5)),
        ((7.0, -0.5, 0.5), (8.0, -0.5, -0.5)),
    ],
)
def test_v_tail_of_px4_gives_the_same_run(
    tmp_path: Path, variant: str, torques: tuple[tuple[float, float, float], ...]
) -> None:
    """Defaults of PX4, an A-tail, and servos that turn down for a positive output."""
    parameters, surfaces = px4_halves(*torques)
    path = files.ulog(
        tmp_path / "vtail.ulg", variant=variant, parameters=parameters, surfaces=surfaces
    )
    check_run(the_run(path))
    usable_runs.refuse_miswired(usable_runs.cut_logs([readers.read(path)], []))


def test_v_tail_of_px4_with_a_reversed_servo_gives_the_same_run(tmp_path: Path) -> None:
    parameters, surfaces = px4_halves((7.0, 0.5, 0.5), (8.0, 0.5, -0.5))

    def turned(s: files.Sample) -> tuple[float, float]:
        left, right = surfaces(s)
        return left, -right

    parameters["PWM_MAIN_REV"] = 0b10
    check_run(the_run(files.ulog(tmp_path / "a.ulg", parameters=parameters, surfaces=turned)))


def test_v_tail_of_px4_without_torques_is_refused(tmp_path: Path) -> None:
    parameters, surfaces = px4_halves((7.0, 0.5, 0.5), (8.0, 0.5, -0.5))
    del parameters["CA_SV_CS1_TRQ_Y"]
    path = files.ulog(tmp_path / "a.ulg", parameters=parameters, surfaces=surfaces)
    with pytest.raises(RefitError, match=r"output 2 \(half of a V-tail whose CA_SV_CSk_TRQ_P or"):
        usable_runs.refuse_miswired(usable_runs.cut_logs([readers.read(path)], []))


@pytest.mark.parametrize(
    ("functions", "reason"),
    [
        (V_TAIL | {"SERVO4_FUNCTION": 21.0}, r"SERVO1_FUNCTION = 79 \(a V-tail\), SERVO2_FUNCTION"),
        (V_TAIL | {"SERVO2_FUNCTION": 79.0}, r"SERVO1_FUNCTION = 79 \(a V-tail\), SERVO2_FUNCTION"),
        (V_TAIL | {"SERVO1_FUNCTION": 77.0, "SERVO2_FUNCTION": 78.0}, r"77 \(an elevon\)"),
    ],
)
def test_surfaces_of_both_planes_are_refused_with_their_outputs(
    tmp_path: Path, functions: dict[str, float], reason: str
) -> None:
    path = files.dataflash(tmp_path / "mixed.bin", parameters=functions)
    log = readers.read(path)
    with pytest.raises(RefitError, match=reason):
        usable_runs.refuse_miswired(usable_runs.cut_logs([log], []))
    chosen = OutputOptions(ServoChannels(1, 2, 3))
    usable_runs.refuse_miswired(usable_runs.cut_logs([readers.read(path, chosen)], []))


def test_marked_test_that_overlaps_another_is_refused(written: dict[str, Path]) -> None:
    log = readers.read(written["tlog"])
    overlapping = MarkedInterval(125.0, 135.0, Plane.YAW)
    with pytest.raises(LogError, match=r"125\.\.135 overlaps the test of the rudder at 120\.0\.\."):
        segments.cut_runs(log, [overlapping])
    behind = MarkedInterval(132.0, 139.0, Plane.YAW)
    assert len(segments.cut_runs(log, [behind])) == 2
    with pytest.raises(LogError, match=r"132\.\.139 overlaps the test"):
        segments.cut_runs(log, [behind, behind])


def test_events_of_a_slow_log_are_kept(tmp_path: Path) -> None:
    """All regular messages at 5 Hz: an event is up to 0.18 s after them."""
    log = readers.read(files.dataflash(tmp_path / "slow.bin", every=10))
    assert log.damage == ""
    assert len(segments.cut_runs(log)) == 1


def test_time_of_a_command_is_uncertain_by_the_rows(tmp_path: Path) -> None:
    """It is uniform over the interval of the rows, less the step of the grid of 20 ms."""
    slow = the_run(files.dataflash(tmp_path / "slow.bin", every=5))
    assert slow.delay_sd_s == pytest.approx(math.sqrt((0.1**2 - 0.02**2) / 12.0), rel=1e-3)
    assert the_run(files.dataflash(tmp_path / "fast.bin")).delay_sd_s == 0.0


def test_motor_that_turns_backwards_is_refused(tmp_path: Path) -> None:
    """Pulses of 1100 to 1900 us for a motor that turns forwards only: 30 % have 1340 us."""
    path = files.ulog(tmp_path / "motor.ulg", pulse_of=lambda _: 1340)
    logs = usable_runs.cut_logs([readers.read(path)], [])
    with pytest.raises(RefitError, match=r"motor\.ulg: the thrust in its tests is -40 %"):
        usable_runs.refuse_miswired(logs)


def test_outputs_of_a_second_port_are_left_out(tmp_path: Path) -> None:
    """Port 1 has the outputs 17 to 32; its messages come before those of port 0."""
    now = mavlink.MAVLink(None, 1, 1)

    class Both(NamedTuple):
        pulses: mavlink.MAVLink_servo_output_raw_message

        def pack(self, sender: mavlink.MAVLink) -> bytes:
            other = mavlink.MAVLink_servo_output_raw_message(self.pulses.time_usec, 1, *[1500] * 8)
            stamp = bytes(8)
            return bytes(other.pack(now)) + stamp + bytes(self.pulses.pack(sender))

    def pulses(s: files.Sample) -> object:
        message = files.servo_pulses(s)
        assert isinstance(message, mavlink.MAVLink_servo_output_raw_message)
        return Both(message)

    chosen = ServoChannels(3, -1, 2)
    run = the_run(files.tlog(tmp_path / "ports.tlog", pulses), chosen=chosen)
    one = the_run(files.tlog(tmp_path / "port.tlog", files.servo_pulses), chosen=chosen)
    np.testing.assert_allclose(run.rudder_rad, one.rudder_rad, atol=1e-9)


def test_boat_without_elevator(tmp_path: Path) -> None:
    """ArduRover: ground steering and throttle; the elevator is zero."""
    parameters = {"SERVO1_FUNCTION": 26.0, "SERVO3_FUNCTION": 70.0, "ACT_TRAVEL_DEG": 12.0}
    assert servo_channels.find_channels(parameters) == ServoChannels(1, 0, 3)
    run = the_run(files.dataflash(tmp_path / "boat.bin", parameters=parameters))
    assert np.degrees(np.max(run.rudder_rad)) == pytest.approx(4.0, abs=0.02)
    np.testing.assert_array_equal(run.elevator_rad, 0.0)
    assert servo_channels.parse("1,0,3") == ServoChannels(1, 0, 3)


def test_elevator_test_without_elevator_function_names_it(tmp_path: Path) -> None:
    """Two outputs have the function of the rudder, the elevator's one included."""
    parameters = {"SERVO1_FUNCTION": 21.0, "SERVO2_FUNCTION": 21.0, "SERVO3_FUNCTION": 70.0}
    path = files.dataflash(tmp_path / "two.bin", parameters=parameters)
    missing = "no excitation: no output has the function of an elevator (SERVOn_FUNCTION = 19"

    def is_missing(run: Run) -> bool:
        return any(reason.startswith(missing) for reason in screen([run])[0].reasons)

    rudder_test, chosen = the_run(path), the_run(path, chosen=ServoChannels(1, 2, 3))
    assert not is_missing(rudder_test)
    assert is_missing(replace(rudder_test, plane=Plane.PITCH))
    assert not is_missing(replace(chosen, plane=Plane.PITCH))


def test_samples_that_are_not_finite_are_a_gap(tmp_path: Path) -> None:
    """The estimator of the vehicle fails for one second within the test."""

    def failing(s: files.Sample) -> object:
        lost = 24.0 <= s.time_s - files.BOOTED_S < 25.0
        return files.attitude_quaternion(s._replace(yaw_rate_radps=math.nan) if lost else s)

    run = the_run(files.tlog(tmp_path / "nan.tlog", attitude=failing))
    assert np.all(np.isfinite(run.r_radps))
    assert np.all(np.isfinite(run.heading_rad))
    (screening,) = screen([run])
    assert screening.reasons == ("gap: 1.02 s without data, less than 0.2 needed",)


def test_setpoint_without_a_number_leaves_the_later_ones() -> None:
    """One ATTITUDE_TARGET, vehicle_attitude_setpoint or ATT of five holds NaN."""
    time_s = np.arange(5.0)
    heading_rad = np.array([3.0, np.nan, 3.1, 3.2, -3.0])
    half = 0.5 * heading_rad
    q = np.column_stack([np.cos(half), np.zeros(5), np.zeros(5), np.sin(half)])
    record = np.zeros(5, [("q", "f4", 4)])
    record["q"] = q
    topic = MessageColumns(time_s, {f"q_d[{part}]": q[:, part] for part in range(4)})
    att = MessageColumns(time_s, {"DesYaw": np.degrees(heading_rad), "DesPitch": np.zeros(5)})
    for setpoints in (
        messages._setpoints({"ATTITUDE_TARGET": (time_s, record)}),
        ulog._setpoints({"vehicle_attitude_setpoint": topic}),
        dataflash._setpoints({"ATT": att}),
    ):
        np.testing.assert_array_equal(setpoints.attitude_time_s, [0.0, 2.0, 3.0, 4.0])
        np.testing.assert_allclose(
            setpoints.heading_rad, [3.0, 3.1, 3.2, math.tau - 3.0], atol=1e-6
        )
        np.testing.assert_allclose(setpoints.pitch_rad, np.zeros(4), atol=1e-6)


def test_tlog_of_two_vehicles_names_systems_and_remedy(
    tmp_path: Path, written: dict[str, Path]
) -> None:
    other = mavlink.MAVLink(None, 7, 1)
    frame = mavlink.MAVLink_attitude_message(100_000, 0, 0, 0, 0, 0, 0).pack(other)
    path = tmp_path / "two.tlog"
    path.write_bytes(written["tlog"].read_bytes() + struct.pack(">Q", 10**15) + bytes(frame))
    with pytest.raises(LogError) as refused:
        readers.read(path)
    assert str(refused.value) == (
        f"{path}: 2 vehicles send an attitude (systems 1, 7); a log for identification has one:"
        " write one file per vehicle, for example with"
        " `mavlogdump.py --source-system 1 -o vehicle_1.tlog two.tlog`"
    )


def test_several_senders_of_one_system_are_named(tmp_path: Path) -> None:
    path = tmp_path / "two.mcap"
    with pytest.raises(LogError, match=r"\(components 1/2, 1/3\); .* one file per vehicle$"):
        messages.refuse_several(path, [("1", "2"), ("1", "3")], "x")
    messages.refuse_several(path, [("1", "1")], "x")


@pytest.mark.parametrize(("autopilot", "value"), [(12, 4_000.0), (3, 4.0)])
def test_tlog_integer_parameter_of_px4_has_its_bytes(
    autopilot: int, value: float, tmp_path: Path
) -> None:
    """PX4 sends PARAM_ENCODE_BYTEWISE, ArduPilot (3) the number; both name the type INT32 (6)."""
    path, sender = files.tlog(tmp_path / "px4.tlog"), mavlink.MAVLink(None, 1, 1)
    field = struct.unpack("<f", struct.pack("<i", 4_000))[0] if autopilot == 12 else value
    stamp = struct.pack(">Q", 1_700_000_100_000_000)
    for message in (
        mavlink.MAVLink_heartbeat_message(12, autopilot, 0, 0, 3, 3),
        mavlink.MAVLink_param_value_message(b"PWM_MAIN_MAX1", field, 6, 1, 0),
    ):
        path.write_bytes(path.read_bytes() + stamp + bytes(message.pack(sender)))
    parameters = readers.read(path, FROM_LOG).parameters
    assert parameters == {"ACT_TRAVEL_DEG": 12.0, "PWM_MAIN_MAX1": value}


@pytest.mark.parametrize("suffix", ["tlog", "bin"])
@pytest.mark.parametrize("booted_s", [3.0, 110.0])
def test_test_after_a_restart_is_refused_by_its_clock(
    suffix: str, booted_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The times of the second part are before those of the first, or overlap them."""
    path = tmp_path / f"dive.{suffix}"
    content = WRITERS[suffix](path).read_bytes()
    monkeypatch.setattr(files, "BOOTED_S", booted_s)
    path.write_bytes(content + WRITERS[suffix](path).read_bytes())
    log = readers.read(path, FROM_LOG)
    known = replace(log, parameters={**log.parameters, segments.LOOP_RATE: RATE_HZ})
    before, after = segments.cut_runs(known, ())
    assert before.clock_back == ""
    assert re.search(r"went back by \d+.0 s \(a restart\?\)", after.clock_back)


def test_test_after_a_restart_in_an_mcap_is_refused_by_its_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entries = files.entries()
    monkeypatch.setattr(files, "BOOTED_S", 3.0)
    path = recording.write(
        tmp_path / "dive.mcap", [*entries, *files.entries()], {"ACT_TRAVEL_DEG": 12.0}
    )
    log = readers.read(path, FROM_LOG)
    known = replace(log, parameters={**log.parameters, segments.LOOP_RATE: RATE_HZ})
    before, after = segments.cut_runs(known, ())
    assert before.clock_back == ""
    assert "went back by 137.0 s (a restart?)" in after.clock_back
