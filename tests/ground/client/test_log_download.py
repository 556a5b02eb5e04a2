"""Downloads of logs: local names stay inside the folder, and logs are not mixed."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ground.client import log_download
from ground.client.file_names import MAX_BYTES, safe_file_name
from ground.client.vehicle import VehicleClientError
from ground.log_tools import export
from mavlink_io.dialect import by_name
from mavlink_io.logging import ros1
from mavlink_io.logging.mcap import McapWriter
from mavlink_io.request import ExchangeError, MavlinkId
from mavlink_io.services.ftp.client import FileClient
from mavlink_io.services.ftp.payload import crc32
from mavlink_io.services.ftp.tree import ListingEntry
from mavlink_io.services.log_transfer.client import RemoteLog as ListedLog
from mavlink_io.services.log_transfer.server import DATA_BYTES

CONTENT = b"what the vehicle sent"
HOSTILE = (
    "../../x",
    "/etc/x",
    "..",
    ".",
    "",
    "-rf",
    ".profile",
    "..\\x",
    "C:\\x",
    "a\nb\x1b",
    300 * "a",
)


class StubVehicle:
    """Answers the file service with one file of any name, and the checksum that belongs to it."""

    def __init__(self, name: str) -> None:
        self.name, self.asked = name, set[str]()

    def use(self, kind: Any, ask: Callable[[Any], Any]) -> Any:
        return ask(self)

    def list(self, path: str) -> list[ListingEntry]:
        return [ListingEntry(self.name, len(CONTENT))]

    def checksum(self, path: str) -> int:
        self.asked.add(path)
        return crc32(CONTENT)

    def download(self, path: str, sink: Any, start: int, watch: object) -> int:
        self.asked.add(path)
        sink.write(CONTENT[start:])
        return len(CONTENT)


@pytest.mark.parametrize("name", HOSTILE)
def test_download_hostile_name_stays_in_folder(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "logs"
    vehicle: Any = StubVehicle(name)
    (log,) = log_download.list_logs(vehicle)
    fetched = log_download.fetch(vehicle, log, folder)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert files == [fetched.file]
    assert fetched.file.parent == folder
    assert fetched.file.read_bytes() == CONTENT
    assert vehicle.asked == {f"/logs/{name}"}, (
        "on board the file has the name that the vehicle gave"
    )


def test_download_two_names_alike_overwrites_nothing(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"here before")
    vehicle: Any = StubVehicle("../x.mcap")
    (log,) = log_download.list_logs(vehicle)
    assert log_download.fetch(vehicle, log, tmp_path).file.name == "x-2.mcap"
    assert (tmp_path / "x.mcap").read_bytes() == b"here before"


def test_download_beside_a_changed_copy_is_found_again(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"here before")
    vehicle: Any = StubVehicle("x.mcap")
    (log,) = log_download.list_logs(vehicle)
    first, second = (log_download.fetch(vehicle, log, tmp_path) for _ in range(2))
    assert (first.file.name, second.file.name) == ("x-2.mcap", "x-2.mcap")
    assert second.resumed_at == len(CONTENT)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x-2.mcap", "x.mcap"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_download_on_full_disk_names_the_file(tmp_path: Path) -> None:
    (tmp_path / "x.mcap.part").symlink_to("/dev/full")
    vehicle: Any = StubVehicle("x.mcap")
    (log,) = log_download.list_logs(vehicle)
    with pytest.raises(OSError, match="No space left") as failure:
        log_download.fetch(vehicle, log, tmp_path)
    assert failure.value.filename == str(tmp_path / "x.mcap.part")


class StubWithoutFiles:
    """Answers the LOG_* service with one log; the file service is missing."""

    def __init__(self, began_unix_s: int) -> None:
        self.began_unix_s = began_unix_s

    def use(self, kind: Any, ask: Callable[[Any], Any]) -> Any:
        if kind is FileClient:
            raise VehicleClientError("no answer")
        return ask(self)

    def list(self) -> list[ListedLog]:
        return [ListedLog(1, len(LOG), self.began_unix_s)]

    def download(self, log: ListedLog, sink: Any, start: int, watch: object) -> int:
        sink.write(LOG[start:])
        return len(LOG)


LOG = bytes(range(256))
"""Content of a log without MCAP's magic bytes, as of ArduPilot."""


def test_download_existing_file_is_not_checked_without_checksum(tmp_path: Path) -> None:
    vehicle: Any = StubWithoutFiles(1_700_000_000)
    (log,) = log_download.list_logs(vehicle)
    first, second = (log_download.fetch(vehicle, log, tmp_path) for _ in range(2))
    assert first.file == second.file
    assert (first.checked, second.checked) == (False, False)
    assert first.finished


@pytest.mark.parametrize("began_unix_s", [0, 1_700_000_000])
def test_download_continues_only_logs_with_start_time(tmp_path: Path, began_unix_s: int) -> None:
    vehicle: Any = StubWithoutFiles(began_unix_s)
    (log,) = log_download.list_logs(vehicle)
    beginning = LOG[:DATA_BYTES] if began_unix_s else bytes(DATA_BYTES)
    (tmp_path / f"{log.name}.part").write_bytes(beginning)
    download = log_download.fetch(vehicle, log, tmp_path)
    assert download.file.read_bytes() == LOG
    assert download.resumed_at == (DATA_BYTES if began_unix_s else 0)


@given(st.text())
@example("/")
@example("..-../.")
@example("\ud800")
@example("\u202egpj.exe")
def test_safe_file_name_any_text_is_base_name(name: str) -> None:
    safe = safe_file_name(name)
    assert safe
    assert safe.isprintable()
    assert not set("/\\:") & set(safe)
    assert safe[0] not in ".- "
    assert ".." not in safe
    assert len(safe.encode()) <= MAX_BYTES
    assert safe_file_name(safe) == safe


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("00012-20260131T120000Z.mcap", "00012-20260131T120000Z.mcap"),
        ("IMU[0].csv", "IMU[0].csv"),
        ("../../x", "x"),
        ("/abs/olute.bin", "olute.bin"),
        ("..", "unnamed"),
        ("a" * 300 + ".mcap", "a" * (MAX_BYTES - 5) + ".mcap"),
    ],
)
def test_safe_file_name_known_names(name: str, safe: str) -> None:
    assert safe_file_name(name) == safe


def test_request_path_too_long_fails_with_reason() -> None:
    """A name of 238 bytes fits in a listing; with its folder it is longer than a request holds."""
    files = FileClient(lambda name, **fields: None, MavlinkId(250, 190), MavlinkId(1, 1))
    exchange = files.checksum("/logs/" + "n" * 238)
    exchange.poll(0.0)
    with pytest.raises(ExchangeError, match="239 bytes"):
        exchange.result()


def test_export_hostile_topic_stays_in_folder(tmp_path: Path) -> None:
    path, out = tmp_path / "log.mcap", tmp_path / "csv"
    message = by_name("HEARTBEAT")
    with path.open("wb") as file:
        writer = McapWriter(file, "ros1", "test")
        layout = ros1.schema_text(message).encode()
        schema = writer.register_schema(message.name, ros1.SCHEMA_ENCODING, layout)
        channel = writer.register_channel(
            "/mavlink/..\\..\0\x1b/HEARTBEAT", ros1.MESSAGE_ENCODING, schema
        )
        writer.add_message(channel, 0, message.pack((0, 0, 0, 0, 0, 0)), 0)
        writer.finish()
    (table,) = export.export_csv(path, out)
    assert table.parent == out
    assert table.name.isprintable()
    with table.open(newline="") as file_of_rows:
        assert len(list(csv.DictReader(file_of_rows))) == 1
