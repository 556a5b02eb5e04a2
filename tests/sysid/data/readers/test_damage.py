"""Damaged or hostile logs are rejected in one line and bounded memory, never read as other data."""

import random
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import Writer

from mavlink_io import dialect
from mavlink_io.logging.mavlink_log import MavlinkLog
from sysid.data import readers
from sysid.data.bit_errors import damaged_names
from sysid.data.dataset import Log, LogError
from tests.sysid import recording
from tests.sysid.data.readers import files
from tests.sysid.data.test_dataset import dive

FLIPS = 60
PARAMETERS = {"ACT_TRAVEL_DEG": 12.0, "TRIM_RUD_DEG": 6.0}
SECONDS = 6.0
TEST = (2.0, 5.0, "SystemID Finished")
BOMB_BYTES = 400_000_000
"""Unpacked size of the decompression bombs below, from a file of about ten kB."""
MOST_BYTES = 250_000_000
"""Limit of memory: twice the maximum chunk size plus the overhead of the interpreter."""


def write_own(path: Path) -> Path:
    """Write the dive as ground and the vehicle do, in several chunks."""
    with path.open("wb") as file:
        log = MavlinkLog(file)
        channels = {}
        for number, (time_s, sent) in enumerate(dive(SECONDS, TEST)):
            name = sent.msgname
            if name not in channels:
                channels[name] = log.channel(1, 1, dialect.by_name(name))
            time_ns = recording.START_NS + round(time_s * 1e9)
            log.write(channels[name], time_ns, recording.payload(sent), number & 0xFF)
            if number % 150 == 149:
                log.flush()
        log.attach_parameters(recording.START_NS, PARAMETERS)
        log.annotate("vehicle", {"system": "1"})
        log.finish()
    return path


def write_with_library(path: Path) -> Path:
    return recording.write(path, dive(SECONDS, TEST), PARAMETERS)


WRITERS: dict[str, Callable[[Path], Path]] = {"own": write_own, "library": write_with_library}


def content(log: Log) -> bytes:
    """Return all data that identification reads from a log."""
    parts = (log.attitude, log.actuators, log.depth, log.setpoints, log.duct)
    arrays = [np.ascontiguousarray(v).tobytes() for part in parts for v in vars(part).values()]
    return b"".join(arrays) + repr((log.events, sorted(log.parameters.items()))).encode()


def flipped(data: bytes, seed: int) -> tuple[int, bytes]:
    bit = random.Random(seed).randrange(8 * len(data))
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bit, bytes(changed)


@pytest.mark.parametrize("writer", WRITERS)
def test_mcap_flipped_bit_never_gives_other_data(writer: str, tmp_path: Path) -> None:
    path = WRITERS[writer](tmp_path / "dive.mcap")
    data, expected = path.read_bytes(), content(readers.read(path))
    wrong: list[str] = []
    refusals: list[str] = []
    for seed in range(FLIPS):
        bit, damaged = flipped(data, seed)
        path.write_bytes(damaged)
        try:
            same = content(readers.read(path)) == expected
        except LogError as error:
            refusals.append(str(error))
        except Exception as error:
            wrong.append(f"byte {bit // 8} of {len(data)}: {type(error).__name__}: {error}")
        else:
            if not same:
                wrong.append(f"byte {bit // 8} of {len(data)}: read as other data")
    assert wrong == []
    assert [said for said in refusals if not said.startswith(f"{path}: ") or "\n" in said] == []
    if writer == "own":  # its data section has a checksum, which the others do not write
        assert len(refusals) == FLIPS


ATTITUDE_SCHEMA = b"uint32 time_boot_ms\nfloat32 roll\n"


def mcap_record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def mcap_text(text: bytes) -> bytes:
    return struct.pack("<I", len(text)) + text


def mcap_file(*records: bytes) -> bytes:
    """Return a finished file without summary, by https://mcap.dev/spec."""
    magic = b"\x89MCAP0\r\n"
    header, end = mcap_record(1, mcap_text(b"") * 2), mcap_record(15, bytes(4))
    footer = mcap_record(2, bytes(20))
    return magic + header + b"".join(records) + end + footer + magic


def mcap_chunk(stored: bytes, compression: bytes, declared: int, crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 1, 2, declared, crc)
    return mcap_record(6, head + mcap_text(compression) + struct.pack("<Q", len(stored)) + stored)


def zstd_without_size(data: bytes) -> bytes:
    packer = zstandard.ZstdCompressor().compressobj()
    return packer.compress(data) + packer.flush()


def messages_in_many_chunks() -> bytes:
    """Return chunks below the maximum size, each full of messages that identification reads."""
    described = mcap_text(b"m") + mcap_text(b"ros1msg") + mcap_text(ATTITUDE_SCHEMA)
    schema = mcap_record(3, b"\1\0" + described)
    topic = mcap_text(b"/mavlink/1/1/ATTITUDE") + mcap_text(b"ros1") + mcap_text(b"")
    channel = mcap_record(4, b"\1\0\1\0" + topic)
    message = mcap_record(5, struct.pack("<HIQQ", 1, 0, 1, 1) + bytes(8))
    records = message * (50_000_000 // len(message))
    stored = zstandard.ZstdCompressor().compress(records)
    chunk = mcap_chunk(stored, b"zstd", len(records), zlib.crc32(records))
    return mcap_file(schema, channel, chunk * (BOMB_BYTES // len(records)))


def zeros(
    compress: Callable[[bytes], bytes],
    compression: bytes,
    declared: int,
) -> Callable[[], bytes]:
    return lambda: mcap_file(mcap_chunk(compress(bytes(BOMB_BYTES)), compression, declared))


BOMBS: dict[str, tuple[Callable[[], bytes], str]] = {
    "zstd": (zeros(zstandard.compress, b"zstd", BOMB_BYTES), "declares 400 MB"),
    "zstd, wrong size": (zeros(zstandard.compress, b"zstd", 1000), "size that it declares"),
    "zstd, no size in the frame": (zeros(zstd_without_size, b"zstd", 1000), "zstd data are broken"),
    "lz4": (zeros(lz4.frame.compress, b"lz4", BOMB_BYTES), "declares 400 MB"),
    "lz4, wrong size": (zeros(lz4.frame.compress, b"lz4", 1000), "size that it declares"),
    "many chunks": (messages_in_many_chunks, "bytes unpack to more than"),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_mcap_bomb_rejected_in_bounded_memory(bomb: str, tmp_path: Path) -> None:
    make, reason = BOMBS[bomb]
    path = tmp_path / "bomb.mcap"
    path.write_bytes(make())
    readers.format_of(path)
    tracemalloc.start()
    with pytest.raises(LogError, match=rf"bomb\.mcap: .*{reason}") as refusal:
        readers.read(path)
    _, most_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "\n" not in str(refusal.value)
    assert path.stat().st_size < 3_000_000
    assert most_bytes < MOST_BYTES


def test_mcap_length_beyond_the_file_allocates_nothing(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    path.write_bytes(mcap_file(struct.pack("<BQ", 9, 1 << 40)))
    with pytest.raises(LogError, match=r"long\.mcap: is damaged: broken record at byte 25"):
        readers.read(path)


@pytest.mark.parametrize("parameters", [b"[" * 100_000, b'{"A": 1' + b"0" * 400 + b"}", b"[]"])
def test_mcap_non_numeric_parameters_rejected(parameters: bytes, tmp_path: Path) -> None:
    head = bytes(16) + mcap_text(b"params.json") + mcap_text(b"")
    content = head + struct.pack("<Q", len(parameters)) + parameters + bytes(4)
    path = tmp_path / "odd.mcap"
    path.write_bytes(mcap_file(mcap_record(9, content)))
    with pytest.raises(LogError, match=r"odd\.mcap: attachment params\.json must be an object"):
        readers.read(path)


def test_mavlink_message_with_missing_field_rejected(tmp_path: Path) -> None:
    path = tmp_path / "odd.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for name in ("ATTITUDE", "ACTUATOR_OUTPUT_STATUS", "LOCAL_POSITION_NED"):
            schema = writer.register_schema(name, "ros1msg", ATTITUDE_SCHEMA)
            channel = writer.register_channel(f"/mavlink/1/1/{name}", "ros1", schema)
            writer.add_message(channel, 1, bytes(8), 1)
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(LogError, match=r"odd\.mcap: .*must follow the MAVLink definition"):
        readers.read(path)


def ulog_block(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<H", len(body)) + kind + body


def ulog_file(formats: dict[str, str], topics: list[str]) -> bytes:
    """By docs.px4.io, "ULog File Format"."""
    data = b"ULog\x01\x12\x35\x01" + bytes(8)
    for name, fields in formats.items():
        data += ulog_block(b"F", f"{name}:{fields}".encode())
    subscriptions = (struct.pack("<BH", 0, n) + topic.encode() for n, topic in enumerate(topics))
    return data + b"".join(ulog_block(b"A", body) for body in subscriptions)


NESTED = {f"level{n}": f"level{n + 1}[60000] part;" for n in range(4)}
NESTED["level4"] = "float[60000] x;"
ULOG_BOMBS = {
    "nested arrays": (NESTED, ["level0"]),
    "format within itself": ({"a": "a[2] a;a[2] b;"}, ["a"]),
    "many subscriptions": ({"a": "float[60000] x;"}, ["a"] * 100),
    "long names": ({"a": f"float[60000] {'x' * 9000};"}, ["a"]),
}


@pytest.mark.parametrize("bomb", ULOG_BOMBS)
def test_ulog_bomb_rejected_in_bounded_memory(bomb: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb.ulg"
    path.write_bytes(ulog_file(*ULOG_BOMBS[bomb]))
    tracemalloc.start()
    with pytest.raises(LogError, match=r"bomb\.ulg: is no readable PX4 log .*its formats"):
        readers.read(path)
    _, most_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most_bytes < MOST_BYTES


def test_dataflash_memory_is_a_few_times_the_file(tmp_path: Path) -> None:
    """The messages have the maximum length: 255 bytes, of which 8 are the time."""
    codes, columns = "Q" + "Z" * 3 + "N" * 3 + "B" * 4, "TimeUS,A,B,C,D,E,F,G,H,I,J"
    body = struct.pack("<BB4s16s64s", 1, 255, b"BIG", codes.encode(), columns.encode())
    data = bytes((0xA3, 0x95, 0x80)) + body + (bytes((0xA3, 0x95, 1)) + bytes(252)) * 20_000
    path = tmp_path / "big.bin"
    path.write_bytes(data)
    readers.load(files.dataflash(tmp_path / "other.bin"))  # imports
    tracemalloc.start()
    assert readers.load(path).tables["BIG"].time_s.size == 20_000
    _, most_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most_bytes < 6 * len(data)


NAMES = [b"PARM", b"ACT_TRAVEL_DEG", b"DesPitch", b"QNff", b"SystemID Finished"]
"""Message, parameter, column, field codes and text."""


@pytest.mark.parametrize("bit", [0, 1, 7])
@pytest.mark.parametrize("name", NAMES)
def test_damaged_name_in_dataflash_is_reported(name: bytes, bit: int, tmp_path: Path) -> None:
    path = files.dataflash(tmp_path / "dive.bin")
    data = path.read_bytes()
    assert readers.read(path).damage == ""
    path.write_bytes(data.replace(name, bytes((name[0] ^ 1 << bit,)) + name[1:], 1))
    damage = readers.read(path).damage
    assert "name or text is damaged: a message or a parameter may be missing" in damage


@pytest.mark.parametrize("shift_s", [-1.05, 0.13, 268.0])
@pytest.mark.parametrize("name", ["MODE", "MSG"])
def test_event_of_dataflash_out_of_order_is_left_out(
    name: str, shift_s: float, tmp_path: Path
) -> None:
    path = files.dataflash(tmp_path / "dive.bin")
    data = bytearray(path.read_bytes())
    events = readers.read(path).events
    number = {"MODE": 8, "MSG": 6}[name]
    time_at = data.rindex(bytes((0xA3, 0x95, number))) + 3
    (time_us,) = struct.unpack_from("<Q", data, time_at)
    struct.pack_into("<Q", data, time_at, time_us + round(1e6 * shift_s))
    path.write_bytes(data)
    log = readers.read(path)
    assert "1 sample is contradicted by the ones around" in log.damage
    assert set(log.events) <= set(events)


def test_similar_names_of_sound_logs_are_no_damage() -> None:
    """ArduPilot has A beside R, P and Y in RATE, and numbered outputs and estimators."""
    assert damaged_names(("C1", "C3", "Ch2"), ("C1", "C2", "C3", "C10")) == 0
    assert damaged_names(("R", "A"), ("R", "C")) == 0
    assert damaged_names(("XKF1", "XKF0", "XKF3"), ("XKF1",)) == 0
    assert damaged_names(("XKF0", "POWR"), ("XKF1", "POS")) == 1


def attitude_rows(log: Log) -> set[bytes]:
    """Return each attitude sample as bytes, rounded because unwrapping of yaw adds rounding."""
    table = np.stack(tuple(vars(log.attitude).values()), axis=1).round(9)
    return {row.tobytes() for row in table}


def test_tlog_flipped_bit_loses_samples_but_alters_none(tmp_path: Path) -> None:
    """A damaged frame fails its CRC-16 and is dropped; time stamps between frames are not used."""
    path = files.tlog(tmp_path / "dive.tlog")
    data, expected = path.read_bytes(), attitude_rows(readers.read(path))
    for seed in range(5):
        path.write_bytes(flipped(data, seed)[1])
        found = attitude_rows(readers.read(path))
        assert found <= expected
        assert len(found) >= len(expected) - 1


def test_single_wrong_time_of_an_mcap_leaves_out_its_sample(tmp_path: Path) -> None:
    entries = list(dive(SECONDS, TEST))
    (place, *_) = (k for k, (t, m) in enumerate(entries) if m.msgname == "ATTITUDE" and t > 1.0)
    whole = readers.read(recording.write(tmp_path / "whole.mcap", entries, PARAMETERS))
    entries[place] = (999.0, entries[place][1])
    log = readers.read(recording.write(tmp_path / "wrong.mcap", entries, PARAMETERS))
    assert log.attitude.time_s.size == whole.attitude.time_s.size - 1
    assert log.damage.startswith("1 sample is contradicted by the ones around and left out, at ")
