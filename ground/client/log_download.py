"""Download of the logs on the vehicle, with resume and checksum.

MAVLink FTP is tried first. A vehicle without it, or without the folder `FOLDER`, serves its logs by
the LOG_* messages, which have no checksums.
"""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import count, takewhile
from pathlib import Path
from typing import NamedTuple

from ground.client.file_names import safe_file_name
from ground.client.vehicle import VehicleClient, VehicleClientError
from mavlink_io.errors import InputError, OperationError
from mavlink_io.logging.mcap import MAGIC
from mavlink_io.services.ftp import payload
from mavlink_io.services.ftp.client import FileClient
from mavlink_io.services.log_transfer.client import LogClient
from mavlink_io.services.log_transfer.client import RemoteLog as ListedLog
from mavlink_io.services.log_transfer.server import DATA_BYTES
from mavlink_io.user_data_dir import open_output

FOLDER = "/logs"
"""Folder of the logs on the file server of the vehicle."""
ATTEMPTS = 3
"""Maximum number of downloads of a log that grows, or whose checksum differs."""

WatchCallback = Callable[[str, float], None]
"""Called with the name of the log and the fraction that is downloaded."""


class LogOnVehicle(NamedTuple):
    """A log on the vehicle."""

    number: int
    name: str
    """Safe base name of the local file, derived from the name on the vehicle."""
    bytes: int
    path: str
    """Path on the file server; empty without a file server."""
    can_resume: bool = True
    """Whether the name belongs to this log only. LOG_* without a start time gives only a number,
    which a vehicle uses again after its logs were erased."""


class Download(NamedTuple):
    """A downloaded log."""

    file: Path
    bytes: int
    resumed_at: int
    """Number of bytes from an earlier download."""
    checked: bool
    """True if the checksum of the vehicle matches."""
    finished: bool
    """False for an MCAP log without an end, after a loss of power; `ground log recover` repairs
    it."""


def list_logs(vehicle: VehicleClient) -> list[LogOnVehicle]:
    """Return the logs on the vehicle, oldest first. Raises VehicleClientError."""
    try:
        entries = vehicle.use(FileClient, lambda files: files.list(FOLDER))
    except VehicleClientError:
        return [_from_listing(log) for log in vehicle.use(LogClient, lambda logs: logs.list())]
    logs = [entry for entry in entries if entry.size is not None]
    return [
        LogOnVehicle(
            number=_number(log.name),
            name=safe_file_name(log.name),
            bytes=log.size or 0,
            path=f"{FOLDER}/{log.name}",
        )
        for log in logs
    ]


def select_logs(logs: list[LogOnVehicle], which: str) -> list[LogOnVehicle]:
    """Return the logs that `all`, `latest` or a number selects.

    Raises
    ------
    InputError
        No log has the number.
    OperationError
        The vehicle has no logs.
    """
    if not logs:
        raise OperationError("the vehicle has no logs")
    if which == "all":
        return logs
    if which == "latest":
        return logs[-1:]
    selected = [log for log in logs if which.isdecimal() and log.number == int(which)]
    if not selected:
        known = ", ".join(str(log.number) for log in logs)
        raise InputError(f"log {which}: the vehicle has {known}; give one of these, latest or all")
    return selected


def fetch(
    vehicle: VehicleClient, log: LogOnVehicle, folder: Path, watch: WatchCallback | None = None
) -> Download:
    """Download a log into a folder; existing files are kept.

    Raises
    ------
    VehicleClientError
        The vehicle was lost. The received part stays as `NAME.part`; the next call resumes it.
    OperationError
        The checksum of the downloaded file differs from that of the vehicle.
    """
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / log.name
    for file in _existing_copies(target):
        if _is_same(vehicle, log, file):
            return Download(
                file=file,
                bytes=log.bytes,
                resumed_at=log.bytes,
                checked=bool(log.path),
                finished=_is_finished(file),
            )
    part = folder / f"{log.name}.part"
    if not log.can_resume:
        part.unlink(missing_ok=True)
    resumed_at = part.stat().st_size if part.exists() else 0
    checked = (
        _fetch_file(vehicle, log, part, watch)
        if log.path
        else _fetch_log(vehicle, log, part, watch)
    )
    target = part.rename(_unused_path(target))
    return Download(
        file=target,
        bytes=target.stat().st_size,
        resumed_at=resumed_at,
        checked=checked,
        finished=_is_finished(target),
    )


def _fetch_file(
    vehicle: VehicleClient, log: LogOnVehicle, part: Path, watch: WatchCallback | None
) -> bool:
    """Download by MAVLink FTP until the checksums agree.

    They may differ because the log still grows, or because the local part is of an older log.
    """
    for _ in range(ATTEMPTS):
        _append(vehicle, log, part, watch)
        if _is_same(vehicle, log, part):
            return True
        if _size_on_vehicle(vehicle, log) <= _size(part):
            part.unlink()
    raise OperationError(
        f"{log.name}: the checksums differ; it may still be written: try again after disarming"
    )


def _append(
    vehicle: VehicleClient, log: LogOnVehicle, part: Path, watch: WatchCallback | None
) -> None:
    """Download the rest of a file."""
    if _size(part) > _size_on_vehicle(vehicle, log):
        part.unlink()
    with open_output(part, "ab") as sink:
        start = sink.tell()
        vehicle.use(
            FileClient,
            lambda files: files.download(log.path, sink, start, _as_fraction(log, watch)),
        )


def _fetch_log(
    vehicle: VehicleClient, log: LogOnVehicle, part: Path, watch: WatchCallback | None
) -> bool:
    """Download by LOG_* messages; return False, as they have no checksum."""
    if _size(part) > log.bytes:
        part.unlink()
    with open_output(part, "ab") as sink:
        start = sink.truncate(sink.tell() // DATA_BYTES * DATA_BYTES)
        listed = ListedLog(log.number, log.bytes, 0)
        if start < log.bytes:
            vehicle.use(
                LogClient, lambda logs: logs.download(listed, sink, start, _as_fraction(log, watch))
            )
    return False


def _is_same(vehicle: VehicleClient, log: LogOnVehicle, file: Path) -> bool:
    """Compare a local file with the log on the vehicle: by checksum, or by size without FTP."""
    if not log.path:
        return file.stat().st_size == log.bytes
    crc = 0
    with file.open("rb") as data:
        while block := data.read(1 << 20):
            crc = payload.crc32(block, crc)
    remote_crc: int = vehicle.use(FileClient, lambda files: files.checksum(log.path))
    return remote_crc == crc


def _size_on_vehicle(vehicle: VehicleClient, log: LogOnVehicle) -> int:
    """Return the present size of a log on the file server; 0 if it is gone."""
    entries = vehicle.use(FileClient, lambda files: files.list(FOLDER))
    return next((entry.size or 0 for entry in entries if f"{FOLDER}/{entry.name}" == log.path), 0)


def _size(file: Path) -> int:
    """Return the size of a file; 0 if it does not exist."""
    return file.stat().st_size if file.exists() else 0


def _as_fraction(
    log: LogOnVehicle, watch: WatchCallback | None
) -> Callable[[int, int], None] | None:
    """Return a callback for byte counts that reports fractions to `watch`."""
    return (
        None if watch is None else lambda received, total: watch(log.name, received / max(1, total))
    )


def _names(target: Path) -> Iterator[Path]:
    """Yield the path, and then the path with the numbers 2, 3, ... appended."""
    yield target
    for n in count(2):
        yield target.with_name(f"{target.stem}-{n}{target.suffix}")


def _existing_copies(target: Path) -> Iterator[Path]:
    """Yield the files of earlier downloads under the names of `_names`."""
    return takewhile(Path.is_file, _names(target))


def _unused_path(target: Path) -> Path:
    """Return the path, with a number appended if it exists."""
    return next(name for name in _names(target) if not name.exists())


def _is_finished(file: Path) -> bool:
    """Return whether a file is no MCAP, or ends with the magic bytes."""
    if file.suffix != ".mcap":
        return True
    with file.open("rb") as data:
        data.seek(max(0, file.stat().st_size - len(MAGIC)))
        return data.read() == MAGIC


def _from_listing(log: ListedLog) -> LogOnVehicle:
    """Return a log that LOG_ENTRY lists; its name is made from number and start time."""
    start = (
        datetime.fromtimestamp(log.began_unix_s, UTC).strftime("-%Y%m%dT%H%M%SZ")
        if log.began_unix_s
        else ""
    )
    return LogOnVehicle(
        number=log.number,
        name=f"log-{log.number:05d}{start}.bin",
        bytes=log.bytes,
        path="",
        can_resume=bool(start),
    )


def _number(name: str) -> int:
    """Return the number at the start of a file name; -1 without one."""
    digits = name.split("-", 1)[0].split(".", 1)[0]
    return int(digits) if digits.isdecimal() else -1
