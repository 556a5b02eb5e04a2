"""A telemetry log, read by pymavlink's tool."""

import struct
import subprocess
import sys
import tempfile
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from mavlink_io import dialect
from mavlink_io.codec import SIGNED_FLAG, encode
from mavlink_io.logging.tlog import TelemetryLog
from mavlink_io.signing import Signing, Timestamp

ATTITUDE = dialect.by_name("ATTITUDE")
START_US = 1_700_000_000_000_000


def frame(boot_ms: int, flags: int = 0) -> bytes:
    return encode(ATTITUDE, (boot_ms, 0.0, 0.1, 0.2, 0.0, 0.0, 0.0), boot_ms & 0xFF, 1, 1, flags)


def test_tlog_is_read_by_pymavlink(tmp_path: Path) -> None:
    path = tmp_path / "dive.tlog"
    log = TelemetryLog(path.open("xb"))
    log.write(START_US, frame(1))
    log.write(START_US + 20_000, Signing(bytes(32), 1, Timestamp()).sign(frame(2, SIGNED_FLAG)))
    log.write(START_US + 10_000, frame(3))
    log.close()
    program = Path(sys.executable).with_name("mavlogdump.py")
    done = subprocess.run(
        [sys.executable, program, path], capture_output=True, text=True, timeout=60, check=True
    )
    lines = done.stdout.splitlines()
    assert [line.split("time_boot_ms : ")[1].split(",")[0] for line in lines] == ["1", "2", "3"]
    assert [line.split(":")[2][:5] for line in lines] == ["20.00", "20.02", "20.02"]


@given(st.lists(st.integers(0, 1 << 62), min_size=1, max_size=30))
def test_tlog_time_never_decreases(times_us: list[int]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dive.tlog"
        log = TelemetryLog(path.open("xb"))
        for time_us in times_us:
            log.write(time_us, b"x")
        log.close()
        stamps = [stamp for stamp, _ in struct.iter_unpack(">Qc", path.read_bytes())]
    assert stamps == [max(times_us[: n + 1]) for n in range(len(times_us))]
