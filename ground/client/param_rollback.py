"""Parameters changed as one change: what was there before is kept first, every value is read back,
all can be undone.

A change is kept in the state directory (``caribou/changes/system-N.json``, one list for each
MAVLink system id) before the first value is sent. So it can be undone whenever the vehicle answers
again, whatever became of the link meanwhile."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec

from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.errors import InputError, OperationError
from mavlink_io.user_data_dir import replace_file, user_data_dir

MAX_HISTORY = 50
"""Changes of one vehicle that can be undone one after another."""


class ParamUpload(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What one upload did: the values of its parameters before and after."""

    source: str
    """The file it came from, or what else ordered it."""
    before: dict[str, float]
    after: dict[str, float]
    model_sha256: str = ""
    """Of the model that the values were designed on; empty where nobody said."""


class ParamChange(NamedTuple):
    """One parameter, as the vehicle read it back."""

    name: str
    before: float
    after: float


def upload(
    vehicle: VehicleClient, values: Mapping[str, float], source: str, model_sha256: str = ""
) -> tuple[ParamChange, ...]:
    """Set parameters and keep what was there before; if one cannot be set, those before it are put
    back.

    Raises:
        BadInputError: the vehicle has no parameter of a name; nothing was set. FailedError: a value
        was refused or the link was lost; names what was set, what not, and what is so now.
    """
    before = _current_values(vehicle, values, source)
    history = History.of(vehicle)
    history.push(ParamUpload(source, before, dict(values), model_sha256))
    done: list[ParamChange] = []
    for name, value in values.items():
        try:
            done.append(ParamChange(name, before[name], vehicle.set_parameter(name, value)))
        except VehicleClientError as error:
            _restore(vehicle, history, done, list(values)[len(done) :], error)
    return tuple(done)


def rollback(
    vehicle: VehicleClient, file: Path | None = None, *, force: bool = False
) -> tuple[ParamUpload, tuple[ParamChange, ...]]:
    """Undo the last change of this vehicle, or the one kept in a file.

    Raises:
        BadInputError: nothing is kept to undo. FailedError: she has other values than the change
        set, unless ``force``; or the link was lost.
    """
    history = History(file) if file else History.of(vehicle)
    change = history.last()
    present = _current_values(vehicle, change.before, str(history.path))
    if (strange := _unexpected_value(change, present)) and not force:
        raise OperationError(
            f"{strange}; somebody changed it since. --force puts the old values back all the same"
        )
    steps = []
    for name, value in change.before.items():
        try:
            steps.append(ParamChange(name, present[name], vehicle.set_parameter(name, value)))
        except VehicleClientError as error:
            left = ", ".join(list(change.before)[len(steps) :])
            raise OperationError(
                f"{error}; not put back yet: {left}. `ground params rollback` again goes on"
            ) from None
    history.pop()
    return change, tuple(steps)


class History:
    """The changes of one vehicle, the last one last."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def of(cls, vehicle: VehicleClient) -> "History":
        system = vehicle.party.system if vehicle.party else 0
        return cls(user_data_dir() / "changes" / f"system-{system}.json")

    def last(self) -> ParamUpload:
        """Raises BadInputError where there is none."""
        changes = self._read()
        if not changes:
            raise InputError(f"{self.path}: keeps no change that could be undone")
        return changes[-1]

    def push(self, change: ParamUpload) -> None:
        """Raises OSError."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._write([*self._read(), change][-MAX_HISTORY:])

    def pop(self) -> None:
        """Raises OSError."""
        self._write(self._read()[:-1])

    def _read(self) -> list[ParamUpload]:
        try:
            return msgspec.json.decode(self.path.read_bytes(), type=list[ParamUpload])
        except FileNotFoundError:
            return []
        except msgspec.MsgspecError as error:
            raise InputError(
                f"{self.path}: {error}; expected a list of changes: mend it or move it away"
            ) from None

    def _write(self, changes: list[ParamUpload]) -> None:
        replace_file(
            self.path, msgspec.json.format(msgspec.json.encode(changes), indent=1).decode() + "\n"
        )


def _current_values(
    vehicle: VehicleClient, wanted: Mapping[str, float], source: str
) -> dict[str, float]:
    aboard = vehicle.parameters()
    unknown = [name for name in wanted if name not in aboard]
    if unknown:
        raise InputError(
            f"{source}: {', '.join(unknown)}: the vehicle has no such parameter; nothing was set"
        )
    return {name: aboard[name] for name in wanted}


def _restore(
    vehicle: VehicleClient,
    history: History,
    done: list[ParamChange],
    left: list[str],
    error: VehicleClientError,
) -> None:
    """Undo half a change; the value that failed may be aboard too. Raises FailedError in any
    case."""
    before, names = history.last().before, [step.name for step in done]
    told = ", ".join(names) or "nothing"
    try:
        for name in (left[0], *reversed(names)):
            vehicle.set_parameter(name, before[name])
    except VehicleClientError:
        raise OperationError(
            f"{error}; set: {told}; not set: {', '.join(left)}. "
            "Once she answers, `ground params rollback` puts back what was there before"
        ) from None
    history.pop()
    raise OperationError(
        f"{error}; set and put back: {told}. She has the values that she had before"
    ) from None


def _unexpected_value(change: ParamUpload, present: Mapping[str, float]) -> str:
    """The first value that is neither the one set nor the one before: half a change can be undone
    too."""
    for name, value in present.items():
        wanted = change.before[name], change.after[name]
        if not any(abs(value - other) <= 1e-6 * max(1.0, abs(other)) for other in wanted):
            return f"{name} is {value:g} aboard, and {change.source} set {change.after[name]:g}"
    return ""
