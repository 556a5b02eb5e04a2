"""Fetches the logs that a vehicle keeps on board: resumed where it broke off, and proved by
checksum.

The vehicle's file server is asked first; an autopilot without one, or with none of our folders,
serves its logs by the LOG_* service, which knows no checksums."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from ground.client.file_names import safe_file_name
from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.errors import InputError, OperationError
from mavlink_io.logging.mcap import MAGIC
from mavlink_io.services.ftp import payload
from mavlink_io.services.ftp.client import FileClient
from mavlink_io.services.log_transfer.client import LogClient
from mavlink_io.services.log_transfer.client import RemoteLog as ListedLog
from mavlink_io.services.log_transfer.server import DATA_BYTES

FOLDER = "/logs"
ATTEMPTS = 3
"""How often a log that has grown meanwhile, or came out wrong, is fetched on."""

WatchCallback = Callable[[str, float], None]
"""Is told what is being fetched and the share that is there."""


class LogOnVehicle(NamedTuple):
    """A log on board."""

    number: int
    name: str
    """The name of the file that is written here: a safe base name, whatever the vehicle calls
    it."""
    bytes: int
    path: str
    """On the file server; empty where there is none."""


class Download(NamedTuple):
    """A log that is here now."""

    file: Path
    bytes: int
    resumed_at: int
    """How many bytes were here before."""
    checked: bool
    """Whether the vehicle's checksum says that it is the same."""
    finished: bool
    """Whether its end is there: a vehicle that lost her power leaves it open, and ``ground log
    recover`` mends it."""


def list_logs(vehicle: VehicleClient) -> list[LogOnVehicle]:
    """The logs on board, the oldest first. Raises VehicleError."""
    try:
        entries = vehicle.use(FileClient, lambda files: files.list(FOLDER))
    except VehicleClientError:
        return [_from_listing(log) for log in vehicle.use(LogClient, lambda logs: logs.list())]
    logs = [entry for entry in entries if entry.size is not None]
    return [
        LogOnVehicle(
            _number(log.name), safe_file_name(log.name), log.size or 0, f"{FOLDER}/{log.name}"
        )
        for log in logs
    ]


def select_logs(logs: list[LogOnVehicle], which: str) -> list[LogOnVehicle]:
    """``all``, ``latest``, or the one of a number. Raises BadInputError, and FailedError where
    there are none."""
    if not logs:
        raise OperationError("the vehicle has no logs")
    if which == "all":
        return logs
    if which == "latest":
        return logs[-1:]
    found = [log for log in logs if which.isdecimal() and log.number == int(which)]
    if not found:
        known = ", ".join(str(log.number) for log in logs)
        raise InputError(f"log {which}: the vehicle has {known}; give one of these, latest or all")
    return found


def fetch(
    vehicle: VehicleClient, log: LogOnVehicle, folder: Path, watch: WatchCallback | None = None
) -> Download:
    """Fetch a log into a folder; what lies there is kept.

    Raises:
        VehicleError: the vehicle went away; what has come stays as ``NAME.part``, for the next
        time. FailedError: what came is not what the vehicle has.
    """
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / log.name
    if target.is_file() and _is_same(vehicle, log, target):
        return Download(target, log.bytes, log.bytes, True, _is_finished(target))
    part = folder / f"{log.name}.part"
    begun = part.stat().st_size if part.exists() else 0
    checked = (
        _fetch_file(vehicle, log, part, watch)
        if log.path
        else _fetch_log(vehicle, log, part, watch)
    )
    target = part.rename(_unused_path(target))
    return Download(target, target.stat().st_size, begun, checked, _is_finished(target))


def _fetch_file(
    vehicle: VehicleClient, log: LogOnVehicle, part: Path, watch: WatchCallback | None
) -> bool:
    """Until the checksums agree: a log that is being written grows, and what is left of an older
    one is wrong."""
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
    if _size(part) > _size_on_vehicle(vehicle, log):
        part.unlink()
    with part.open("ab") as sink:
        start = sink.tell()
        vehicle.use(
            FileClient,
            lambda files: files.download(log.path, sink, start, _as_fraction(log, watch)),
        )


def _fetch_log(
    vehicle: VehicleClient, log: LogOnVehicle, part: Path, watch: WatchCallback | None
) -> bool:
    if _size(part) > log.bytes:
        part.unlink()
    with part.open("ab") as sink:
        start = sink.truncate(sink.tell() // DATA_BYTES * DATA_BYTES)
        listed = ListedLog(log.number, log.bytes, 0)
        if start < log.bytes:
            vehicle.use(
                LogClient, lambda logs: logs.download(listed, sink, start, _as_fraction(log, watch))
            )
    return False


def _is_same(vehicle: VehicleClient, log: LogOnVehicle, file: Path) -> bool:
    """Whether a file here is the log on board, by its checksum; by its size where the vehicle knows
    no checksums."""
    if not log.path:
        return file.stat().st_size == log.bytes
    crc = 0
    with file.open("rb") as data:
        while block := data.read(1 << 20):
            crc = payload.crc32(block, crc)
    on_board: int = vehicle.use(FileClient, lambda files: files.checksum(log.path))
    return on_board == crc


def _size_on_vehicle(vehicle: VehicleClient, log: LogOnVehicle) -> int:
    entries = vehicle.use(FileClient, lambda files: files.list(FOLDER))
    return next((entry.size or 0 for entry in entries if f"{FOLDER}/{entry.name}" == log.path), 0)


def _size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


def _as_fraction(
    log: LogOnVehicle, watch: WatchCallback | None
) -> Callable[[int, int], None] | None:
    return None if watch is None else lambda there, of: watch(log.name, there / max(1, of))


def _unused_path(target: Path) -> Path:
    """A name of which nothing is here yet."""
    names = (target.with_name(f"{target.stem}-{n}{target.suffix}") for n in range(2, 1_000_000))
    return target if not target.exists() else next(name for name in names if not name.exists())


def _is_finished(file: Path) -> bool:
    with file.open("rb") as data:
        data.seek(max(0, file.stat().st_size - len(MAGIC)))
        return data.read() == MAGIC


def _from_listing(log: ListedLog) -> LogOnVehicle:
    began = (
        datetime.fromtimestamp(log.began_unix_s, UTC).strftime("-%Y%m%dT%H%M%SZ")
        if log.began_unix_s
        else ""
    )
    return LogOnVehicle(log.number, f"log-{log.number:05d}{began}.bin", log.bytes, "")


def _number(name: str) -> int:
    digits = name.split("-", 1)[0].split(".", 1)[0]
    return int(digits) if digits.isdecimal() else -1
