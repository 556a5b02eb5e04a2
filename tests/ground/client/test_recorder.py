"""Recorded logs equal the sent messages, read by an independent decoder."""

import io
import json
import math
import signal
import struct
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros1.decoder import DecoderFactory

from ground.client.recorder import Recorder
from ground.log_tools import export, mcap
from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.dialect import MessageField, MessageType
from mavlink_io.frames import rotate
from mavlink_io.logging import tlog
from tests.mavlink_io.logging import decoding

START_NS = 1_700_000_000_000_000_000
_INTEGERS = {"uint8_t": (0, 8), "uint16_t": (0, 16), "uint32_t": (0, 32), "uint64_t": (0, 64)} | {
    "int8_t": (1, 8),
    "int16_t": (1, 16),
    "int32_t": (1, 32),
    "int64_t": (1, 64),
    "char": (0, 8),
}


def value_of(field: MessageField) -> st.SearchStrategy[Any]:
    if field.type == "char" and field.array_length:
        return st.text(
            st.characters(min_codepoint=32, max_codepoint=126), max_size=field.array_length
        )
    if field.type == "char":
        return st.integers(0, 255).map(lambda n: bytes([n]))
    if field.type in ("float", "double"):
        scalar: st.SearchStrategy[Any] = st.floats(
            width=32 if field.type == "float" else 64, allow_nan=False
        )
    else:
        signed, bits = _INTEGERS[field.type]
        low = -(2 ** (bits - 1)) if signed else 0
        scalar = st.integers(low, low + 2**bits - 1)
    return (
        st.lists(scalar, min_size=field.array_length, max_size=field.array_length)
        if field.array_length
        else scalar
    )


def frame_of(name: str, sequence: int = 0, system: int = 1, **fields: Any) -> Frame:
    message = dialect.by_name(name)
    return frame_from(message, message.values(**fields), sequence, system)


def frame_from(
    message: MessageType, values: tuple[Any, ...], sequence: int = 0, system: int = 1
) -> Frame:
    (frame,) = Framer().feed(encode(message, values, sequence, system, 1))
    return frame


def attitude(ms: int, **fields: Any) -> Frame:
    zeros = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.0)
    return frame_of("ATTITUDE", time_boot_ms=ms, **(zeros | fields))


def text(words: str, sequence: int = 0, **fields: Any) -> Frame:
    return frame_of("STATUSTEXT", sequence, severity=6, text=words, **fields)


def record(path: Path, frames: list[Frame], tlog: Path | None = None) -> None:
    recorder = Recorder(path, tlog, now_unix_ns=lambda: START_NS)
    for frame in frames:
        recorder.record(frame)
    recorder.finish()


def read(path: Path) -> list[tuple[str, int, Any]]:
    reader = make_reader(
        io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()], validate_crcs=True
    )
    summary = reader.get_summary()
    assert summary
    topics = [
        channel.topic
        for channel in summary.channels.values()
        if channel.topic.startswith("/mavlink/")
    ]
    decoded_messages = reader.iter_decoded_messages(topics, log_time_order=False)
    return [
        (channel.topic, message.log_time, decoded)
        for _, channel, message, decoded in decoded_messages
    ]


def read_json(path: Path, topic: str) -> list[tuple[str, dict[str, Any]]]:
    reader = make_reader(io.BytesIO(path.read_bytes()))
    return [
        (schema.name, json.loads(m.data))
        for schema, _, m in reader.iter_messages([topic])
        if schema
    ]


def test_telemetry_log_that_cannot_be_opened_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Recorder(tmp_path / "a.mcap", tmp_path / "none" / "a.tlog")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.mcap", "a.tlog"])
def test_log_of_another_recorder_is_kept(name: str, tmp_path: Path) -> None:
    """Two commands that began at once both found the name free."""
    (tmp_path / name).write_bytes(b"other")
    with pytest.raises(FileExistsError):
        Recorder(tmp_path / "a.mcap", tmp_path / "a.tlog")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"other"]


@pytest.mark.parametrize("name", dialect.names())
def test_every_message_of_the_dialect_reads_back_equal(name: str, tmp_path: Path) -> None:
    message = dialect.by_name(name)

    @settings(max_examples=3, suppress_health_check=list(HealthCheck))
    @given(st.tuples(*(value_of(field) for field in message.fields)))
    def check(values: tuple[Any, ...]) -> None:
        path = tmp_path / "log.mcap"
        path.unlink(missing_ok=True)
        record(path, [frame_from(message, values)])
        ((topic, _, decoded),) = read(path)
        assert topic == f"/mavlink/1/1/{name}"
        for field, sent in zip(message.fields, values, strict=True):
            got = getattr(decoded, field.name)
            if isinstance(sent, str):
                assert bytes(got) == sent.encode().ljust(field.array_length, b"\0")
            elif isinstance(sent, bytes):
                assert got == sent[0]
            else:
                assert list(got) == sent if field.array_length else got == sent

    check()


def test_log_time_is_the_start_plus_vehicle_time(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    later = frame_of("GPS_RAW_INT", time_usec=1_234_567, **gps_zeros())
    record(path, [attitude(500), text("now"), later, text("then")])
    zero_ns = START_NS - 500_000_000
    assert [time_ns - zero_ns for _, time_ns, _ in read(path)] == [500_000_000] * 2 + [
        1_234_567_000
    ] * 2


def test_log_time_continues_where_the_time_in_messages_wraps(tmp_path: Path) -> None:
    """`time_boot_ms` has 32 bits."""
    path, stamps = tmp_path / "log.mcap", (2**32 - 100, 2**32 - 20, 60)
    record(path, [attitude(ms) for ms in stamps], tmp_path / "log.tlog")
    assert [time_ns - START_NS for _, time_ns, _ in read(path)] == [0, 80_000_000, 160_000_000]
    (series,) = tlog.read((tmp_path / "log.tlog").read_bytes())
    assert np.diff(series.times_us).tolist() == [80_000, 80_000]


def test_a_unix_time_in_a_message_does_not_set_the_vehicle_clock(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    record(
        path, [attitude(500), frame_of("GPS_RAW_INT", time_usec=START_NS // 1000, **gps_zeros())]
    )
    assert {time_ns for _, time_ns, _ in read(path)} == {START_NS}


def gps_zeros() -> dict[str, int]:
    names = ("fix_type", "lat", "lon", "alt", "eph", "epv", "vel", "cog", "satellites_visible")
    return dict.fromkeys(names, 0)


def test_texts_are_joined_for_the_log_panel(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    record(
        path, [text("a" * 50, id=7), text("b" * 9, id=7, chunk_seq=1), text("SystemID Finished")]
    )
    entries = read_json(path, "/log")
    assert [(schema, entry["message"], entry["level"]) for schema, entry in entries] == [
        ("foxglove.Log", "a" * 50 + "b" * 9, 2),
        ("foxglove.Log", "SystemID Finished", 2),
    ]


def test_pose_has_vehicle_attitude_in_east_north_up(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    position = frame_of(
        "LOCAL_POSITION_NED", time_boot_ms=0, x=10.0, y=20.0, z=3.0, vx=0.0, vy=0.0, vz=0.0
    )
    record(path, [position, attitude(20, pitch=math.radians(10), yaw=math.radians(30))])
    ((schema, pose),) = read_json(path, "/tf")
    assert schema == "foxglove.FrameTransform"
    assert pose["translation"] == {"x": 20.0, "y": 10.0, "z": -3.0}
    q = pose["rotation"]
    forward = rotate((q["w"], q["x"], q["y"], q["z"]), (1.0, 0.0, 0.0))
    level = math.cos(math.radians(10))
    east, north, up = level * 0.5, level * math.cos(math.radians(30)), math.sin(math.radians(10))
    assert forward == pytest.approx((east, north, up), abs=1e-6)
    up_axis = rotate((q["w"], q["x"], q["y"], q["z"]), (0.0, 0.0, 1.0))
    assert up_axis[2] == pytest.approx(level, abs=1e-6)


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_pose_that_is_not_finite_is_left_out(tmp_path: Path, value: float) -> None:
    path = tmp_path / "log.mcap"
    place: dict[str, Any] = {
        "time_boot_ms": 0,
        "x": 10.0,
        "y": 20.0,
        "z": 3.0,
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
    }
    frames = [
        frame_of("LOCAL_POSITION_NED", **place),
        attitude(20, yaw=value),
        attitude(40, pitch=0.1),
        frame_of("LOCAL_POSITION_NED", **place | {"x": value}),
        attitude(400),
    ]
    record(path, frames)
    assert len(read_json(path, "/tf")) == 1


def test_profile_names_no_encoding_that_a_channel_lacks(tmp_path: Path) -> None:
    """Profile ros1: "message_encoding MUST be ros1" (https://mcap.dev/spec/registry)."""
    path = tmp_path / "log.mcap"
    record(path, [attitude(0), text("one"), attitude(20)])
    profile, count, decoded = decoding.decode(path)
    assert profile == ""
    assert decoded == {"ros1": 3, "json": 1}
    assert decoded.total() == count


def test_info_counts_what_a_sender_lost(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    record(path, [text("x", sequence) for sequence in (254, 255, 0, 3)])
    report = mcap.info(path)
    assert (report["messages"], report["lost_frames"]) == (
        8,
        2,
    )  # each text is also in the log panel's channel


def test_attachments_and_parameters_come_back(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    recorder = Recorder(path)
    recorder.attach_parameters({"HDG_P": 0.65, "DPT_P": 0.13})
    recorder.attach("mission.plan", b"{}", "application/json")
    recorder.finish()
    with path.open("rb") as file:
        files = {found.name: found.data for found in make_reader(file).iter_attachments()}
    assert json.loads(files["params.json"]) == {"HDG_P": 0.65, "DPT_P": 0.13}
    assert files["mission.plan"] == b"{}"


def test_a_tlog_holds_the_frames_as_they_came(tmp_path: Path) -> None:
    frames = [attitude(20), text("hello", 1)]
    record(tmp_path / "log.mcap", frames, tmp_path / "log.tlog")
    data = (tmp_path / "log.tlog").read_bytes()
    for frame in frames:
        (stamp_us,) = struct.unpack_from(">Q", data)
        assert stamp_us == START_NS // 1000
        assert data[8 : 8 + len(frame.raw)] == frame.raw
        data = data[8 + len(frame.raw) :]
    assert data == b""


def test_a_csv_export_holds_every_value(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    record(path, [attitude(0, yaw=0.5), attitude(20, yaw=1.5)])
    (table,) = export.export_csv(path, tmp_path / "csv")
    lines = table.read_text().splitlines()
    assert lines[0].split(",")[:4] == ["time_s", "time_boot_s", "roll_rad", "pitch_rad"]
    assert [row.split(",")[0] for row in lines[1:]] == ["0.0", "0.02"]
    assert [float(row.split(",")[4]) for row in lines[1:]] == [0.5, 1.5]


def test_a_killed_recorder_leaves_all_but_the_last_moment(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    script = textwrap.dedent(f"""
        import sys, time
        sys.path[:0] = {sys.path!r}
        from pathlib import Path
        from ground.client.recorder import Recorder
        from tests.ground.client.test_recorder import attitude
        recorder = Recorder(Path({str(path)!r}))
        for n in range(100_000):
            recorder.record(attitude(20 * n))
            recorder.flush_when_due()
            print(n, flush=True)
            time.sleep(0.01)
    """)
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        for line in process.stdout:
            if int(line) == 150:
                process.send_signal(signal.SIGKILL)
                break
        last = max([150, *(int(line) for line in process.stdout)])
    with pytest.raises(mcap.McapFileError, match="recover"):
        mcap.info(path)
    saved = mcap.recover(path, tmp_path / "saved.mcap").messages
    newest_ms = max(decoded.time_boot_ms for _, _, decoded in read(tmp_path / "saved.mcap"))
    assert saved == mcap.info(tmp_path / "saved.mcap")["messages"] > 0
    assert newest_ms >= 20 * (last - 100)  # 100 messages took at least one second


def test_what_is_no_log_is_said_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(b"not a log at all, but long enough")
    for use in (mcap.info, lambda p: mcap.recover(p, tmp_path / "saved.mcap")):
        with pytest.raises(mcap.McapFileError, match=r"log\.mcap: no"):
            use(path)
    with pytest.raises(mcap.McapFileError, match="No such file"):
        mcap.info(tmp_path / "absent.mcap")


def test_an_idle_recorder_flushes_by_the_wall_clock(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    recorder = Recorder(path)
    recorder.flush_when_due()
    recorder.record(attitude(20))
    while not recorder._flush.due():
        time.sleep(0.01)
    recorder._flush.hasten()
    recorder.flush_when_due()
    assert mcap.recover(path, tmp_path / "saved.mcap").messages == 1
    recorder.finish()
