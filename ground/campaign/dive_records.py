"""Record of the finished dives of a campaign, so that a campaign that was ended can be resumed.

`dives.json` is in the folder while a campaign is under way. It is replaced as a whole after each
dive, so that a kill at any time leaves the old or the new one. A dive is repeated if its log is not
the recorded one, or if it would be flown with other parameters, another mission or another seed.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from threading import Lock

import msgspec

from ground.client.flight import FlightResult
from ground.output_files import write_whole
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MissionItem
from mavlink_io.text_files import read_text

RECORDS_FILE = "dives.json"
"""File of the records in the folder of a campaign."""
AFLOAT = ", afloat"
"""End of the name of an attempt that did not leave the surface."""


class DiveRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A finished dive."""

    request_sha256: str
    """Digest of parameters, mission items and seed."""
    log_sha256: str
    vehicle_s: float
    messages: int
    lost_frames: int


def digest_request(
    parameters: Mapping[str, float], items: tuple[MissionItem, ...], seed: int
) -> str:
    """Return the digest of what decides about the log of a dive."""
    text = json.dumps([sorted(parameters.items()), items, seed])
    return hashlib.sha256(text.encode()).hexdigest()


class DiveRecords:
    """Finished dives in the folder of a campaign; a record is added by any thread."""

    def __init__(self, folder: Path) -> None:
        """Read the records of a folder. Raises InputError if they cannot be read."""
        self._path = folder / RECORDS_FILE
        self._lock = Lock()
        self._records: dict[str, DiveRecord] = {}
        try:
            text = read_text(self._path)
            self._records = msgspec.json.decode(text, type=dict[str, DiveRecord])
        except FileNotFoundError:
            pass
        except (OSError, UnicodeDecodeError, msgspec.DecodeError) as error:
            raise InputError(
                f"{self._path}: {error}; remove it to fly all dives again".replace("`", "'")
            ) from None

    def find(self, name: str, log: Path, request_sha256: str) -> DiveRecord | None:
        """Return the record of a dive if it was flown as requested and its log is unchanged."""
        record = self._records.get(name)
        if record is None or record.request_sha256 != request_sha256:
            return None
        try:
            return record if _sha256(log) == record.log_sha256 else None
        except OSError:
            return None

    def failed_attempts(self, name: str) -> dict[str, DiveRecord]:
        """Return the records of the attempts of a dive that ended with a failsafe."""
        with self._lock:
            records = self._records.items()
            return {key: record for key, record in records if key.startswith(f"{name}, attempt ")}

    def afloat_attempts(self) -> dict[str, DiveRecord]:
        """Return the records of the attempts that did not leave the surface."""
        with self._lock:
            return {key: record for key, record in self._records.items() if key.endswith(AFLOAT)}

    def add(self, name: str, request_sha256: str, result: FlightResult) -> DiveRecord:
        """Record a finished dive, whose log is closed."""
        record = DiveRecord(
            request_sha256=request_sha256,
            log_sha256=_sha256(result.log),
            vehicle_s=result.vehicle_s,
            messages=result.messages,
            lost_frames=result.lost_frames,
        )
        with self._lock:
            self._records[name] = record
            write_whole(self._path, msgspec.json.encode(self._records).decode())
        return record

    def remove(self) -> None:
        """Remove the file: the campaign is finished."""
        self._path.unlink(missing_ok=True)


def _sha256(path: Path) -> str:
    """Return the digest of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
