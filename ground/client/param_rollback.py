"""Upload of several parameters as one change that can be undone.

Before the first value is sent, the old values are stored in the user's state directory
(`caribou/changes/system-N.json`, one list per MAVLink system id). So a change can be undone later,
even if the link was lost during the upload.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec

from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.errors import Interrupted
from mavlink_io.errors import InputError, OperationError
from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import MAX_TEXT_BYTES, read_limited
from mavlink_io.user_data_dir import replace_file, user_data_dir
from sysid.models.json_record import decode

MAX_HISTORY = 50
"""Maximum number of stored changes per vehicle."""


class ParamUpload(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Record of one upload: the parameters before and after it."""

    source: str
    """File or command from which the values came."""
    before: dict[str, float]
    after: dict[str, float]
    model_sha256: str = ""
    """SHA-256 of the model that the values were designed on; empty if not known."""


class ParamChange(NamedTuple):
    """One changed parameter; `after` is the value that the vehicle reported back."""

    name: str
    before: float
    after: float


def upload(
    vehicle: VehicleClient, values: Mapping[str, float], source: str, model_sha256: str = ""
) -> tuple[ParamChange, ...]:
    """Set parameters and store the old values; if one cannot be set, restore the others.

    After Ctrl-C nothing is restored; the exception has a note that names which parameters were set.

    Raises
    ------
    InputError
        There is no value, or the vehicle lacks a parameter or reports no finite value; nothing was
        set.
    OperationError
        A value was refused, or the link was lost; the message names which parameters were set.
    """
    if not values:
        raise InputError(f"{source}: holds no parameter")
    before = _current_values(vehicle, values, source)
    history = UploadHistory.of(vehicle)
    history.push(
        ParamUpload(source=source, before=before, after=dict(values), model_sha256=model_sha256)
    )
    changes: list[ParamChange] = []
    for name, value in values.items():
        try:
            changes.append(ParamChange(name, before[name], vehicle.set_parameter(name, value)))
        except VehicleClientError as error:
            _restore(vehicle, history, changes, list(values)[len(changes) :], error)
        except Interrupted as interruption:
            names = [change.name for change in changes]
            interruption.add_note(
                f"{_progress_text(names, list(values)[len(changes) :])}."
                " `ground params rollback` restores the old values"
            )
            raise
    return tuple(changes)


def rollback(
    vehicle: VehicleClient, file: Path | None = None, *, force: bool = False
) -> tuple[ParamUpload, tuple[ParamChange, ...]]:
    """Undo the last change of this vehicle, or the last one in a file.

    Returns
    -------
    tuple
        The record of the undone upload, and the changes that were made now.

    Raises
    ------
    InputError
        The file does not exist, or there is no change to undo.
    OperationError
        The link was lost; or, without `force`, a value was changed after the upload.
    """
    if file and not file.exists():
        raise InputError(f"{file}: does not exist")
    history = UploadHistory(file) if file else UploadHistory.of(vehicle)
    record = history.last()
    present = _current_values(vehicle, record.before, str(history.path))
    if (unexpected := _unexpected_value(record, present)) and not force:
        raise OperationError(
            f"{unexpected}; it was changed since. --force restores the old values all the same"
        )
    changes = []
    for name, value in record.before.items():
        try:
            changes.append(ParamChange(name, present[name], vehicle.set_parameter(name, value)))
        except VehicleClientError as error:
            remaining = ", ".join(list(record.before)[len(changes) :])
            raise OperationError(
                f"{error}; not restored yet: {remaining}. Run `ground params rollback` again"
            ) from None
        except Interrupted as interruption:
            remaining = ", ".join(list(record.before)[len(changes) :])
            interruption.add_note(
                f"not restored yet: {remaining}. Run `ground params rollback` again"
            )
            raise
    history.pop()
    return record, tuple(changes)


class UploadHistory:
    """Stored uploads to one vehicle, oldest first."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def of(cls, vehicle: VehicleClient) -> "UploadHistory":
        """Return the history of a connected vehicle."""
        system = vehicle.vehicle_id.system if vehicle.vehicle_id else 0
        return cls(user_data_dir() / "changes" / f"system-{system}.json")

    def last(self) -> ParamUpload:
        """Return the last upload. Raises InputError if there is none."""
        changes = self._read()
        if not changes:
            raise InputError(f"{self.path}: holds no change that can be undone")
        return changes[-1]

    def push(self, change: ParamUpload) -> None:
        """Store an upload. Raises OSError."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._write([*self._read(), change][-MAX_HISTORY:])

    def pop(self) -> None:
        """Remove the last upload. Raises OSError."""
        self._write(self._read()[:-1])

    def _read(self) -> list[ParamUpload]:
        """Read the stored uploads. Raises InputError."""
        try:
            changes = decode(read_limited(self.path, MAX_TEXT_BYTES), list[ParamUpload])
        except FileNotFoundError:
            return []
        except msgspec.MsgspecError as error:
            raise InputError(
                f"{self.path}: {error}; expected a list of changes: repair or move it"
            ) from None
        for change in changes:
            if missing := sorted(change.before.keys() - change.after.keys()):
                raise InputError(
                    f"{self.path}: {missing[0]}: is in `before` and not in `after`: repair or"
                    " move it"
                )
        return changes

    def _write(self, changes: list[ParamUpload]) -> None:
        """Store the uploads. Raises OSError."""
        replace_file(
            self.path, msgspec.json.format(msgspec.json.encode(changes), indent=1).decode() + "\n"
        )


def _current_values(
    vehicle: VehicleClient, wanted: Mapping[str, float], source: str
) -> dict[str, float]:
    """Return the present values of the parameters in `wanted`. Raises InputError.

    A value that is not finite could not be stored: JSON has no such numbers.
    """
    present = vehicle.parameters()
    unknown = [name for name in wanted if name not in present]
    if unknown:
        raise InputError(
            f"{source}: {', '.join(unknown)}: the vehicle has no such parameter; nothing was set"
            f"{did_you_mean(unknown[0], present)}"
        )
    values = {name: present[name] for name in wanted}
    for name, value in values.items():
        if not math.isfinite(value):
            raise InputError(f"{source}: {name}: the vehicle reports {value:g}; nothing was set")
    return values


def _restore(
    vehicle: VehicleClient,
    history: UploadHistory,
    changes: list[ParamChange],
    remaining: list[str],
    error: VehicleClientError,
) -> None:
    """Undo an incomplete upload, and raise OperationError.

    The first of the `remaining` parameters is restored too: it failed, but may have been set.
    """
    before, names = history.last().before, [change.name for change in changes]
    try:
        for name in (remaining[0], *reversed(names)):
            vehicle.set_parameter(name, before[name])
    except VehicleClientError:
        raise OperationError(
            f"{error}; {_progress_text(names, remaining)}. "
            "When the vehicle answers again, `ground params rollback` restores the old values"
        ) from None
    history.pop()
    set_names = ", ".join(names) or "nothing"
    raise OperationError(
        f"{error}; set and restored: {set_names}. The vehicle has its old values"
    ) from None


def _progress_text(set_names: list[str], remaining: list[str]) -> str:
    """Return which parameters of an incomplete upload are set, and which are not."""
    return f"set: {', '.join(set_names) or 'nothing'}; not set: {', '.join(remaining)}"


def _unexpected_value(upload: ParamUpload, present: Mapping[str, float]) -> str:
    """Return a text about the first value that is neither the old nor the new one; or nothing.

    An incomplete upload, with some old and some new values, can be undone.
    """
    for name, value in present.items():
        expected = upload.before[name], upload.after[name]
        if not any(abs(value - other) <= 1e-6 * max(1.0, abs(other)) for other in expected):
            return f"{name} is {value:g}, and {upload.source} set {upload.after[name]:g}"
    return ""
