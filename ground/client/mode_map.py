"""``custom_mode_map.json``: where pymavlink's programs (MAVProxy, MAVExplorer) look up what modes
are called.

The file is ``{MAV_TYPE: {custom_mode: name}}``, its keys decimal numbers in quotes. A vehicle type
that is listed there loses the names that pymavlink has built in for it."""

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ground.errors import InputError

ModeMap = dict[str, dict[str, str]]

DEFAULT_PATH = Path("~/.pymavlink/custom_mode_map.json")
"""Where pymavlink's ``mavutil`` reads it when it is imported."""


class ModeMapChange(NamedTuple):
    """A map as it is to be, and what of it is new: names by "type.custom_mode"."""

    merged: ModeMap
    added: dict[str, str]


def read(path: Path) -> ModeMap:
    """The map in a file, empty where there is no file. Raises BadInputError where pymavlink could
    not read it."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}; mend it or move it away") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: holds no object; expected {{MAV_TYPE: {{custom_mode: name}}}}")
    for kind, names in found.items():
        if not _is_number(kind) or not isinstance(names, dict):
            raise InputError(f"{path}: {kind}: expected a MAV_TYPE number and an object of names")
        for number, name in names.items():
            if not _is_number(number) or not isinstance(name, str):
                raise InputError(
                    f"{path}: {kind}.{number}: expected a custom_mode number and a name"
                )
    return found


def merge(
    present: Mapping[str, Mapping[str, str]], kind: int, modes: Mapping[str, int], path: Path
) -> ModeMapChange:
    """Add a vehicle's modes (custom_mode by name) to those of its MAV_TYPE ``kind``.

    Raises:
        BadInputError: the map has another name for one of the numbers, or another number for one of
        the names:
            what is there already belongs to somebody.
    """
    merged = {key: dict(names) for key, names in present.items()}
    names = merged.setdefault(str(kind), {})
    numbers = {name: number for number, name in names.items()}
    added = {}
    for name, number in modes.items():
        there, key = names.get(str(number)), f"{kind}.{number}"
        if there == name:
            continue
        if there is not None:
            raise InputError(
                f"{path}: {key}: is {there!r} there, {name!r} on the vehicle; remove or rename one"
            )
        if name in numbers:
            key = f"{kind}.{numbers[name]}"
            raise InputError(
                f"{path}: {key}: is {name!r} there, the vehicle's {name!r} is {number}; remove one"
            )
        names[str(number)] = added[key] = name
    return ModeMapChange(merged, added)


def write(path: Path, modes: ModeMap) -> None:
    """Put a map in place of a file's, whole or not at all. Raises BadInputError where that cannot
    be done."""
    target = path.resolve()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(
            "w", dir=target.parent, encoding="utf-8", delete=False
        ) as file:
            json.dump(modes, file, indent=2)
            file.write("\n")
        Path(file.name).chmod(target.stat().st_mode & 0o777 if target.exists() else 0o644)
        Path(file.name).replace(target)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


def _is_number(key: str) -> bool:
    return key.isascii() and key.isdecimal()
