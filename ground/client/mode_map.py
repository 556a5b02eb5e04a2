"""The file `custom_mode_map.json`, from which pymavlink programs (MAVProxy) read mode names.

Its content is `{MAV_TYPE: {custom_mode: name}}` with decimal numbers in quotes as keys. For a
vehicle type in this file, pymavlink ignores its built-in mode names.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from mavlink_io.errors import InputError
from mavlink_io.text_files import parse_json, read_text
from mavlink_io.user_data_dir import write_output

ModeMap = dict[str, dict[str, str]]

DEFAULT_PATH = Path("~/.pymavlink/custom_mode_map.json")
"""File that `pymavlink.mavutil` reads when it is imported."""


class ModeMapChange(NamedTuple):
    """Result of `merge`."""

    merged: ModeMap
    """The complete new map."""
    added: dict[str, str]
    """The new names, by "type.custom_mode"."""


def read(path: Path) -> ModeMap:
    """Return the map in a file, empty without a file. Raises InputError if it is malformed."""
    try:
        content = parse_json(read_text(path))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}; repair or move it") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds no object; expected {{MAV_TYPE: {{custom_mode: name}}}}")
    for kind, names in content.items():
        if not _is_number(kind) or not isinstance(names, dict):
            raise InputError(f"{path}: {kind}: expected a MAV_TYPE number and an object of names")
        for number, name in names.items():
            if not _is_number(number) or not isinstance(name, str):
                raise InputError(
                    f"{path}: {kind}.{number}: expected a custom_mode number and a name"
                )
    return content


def merge(
    present: Mapping[str, Mapping[str, str]], kind: int, modes: Mapping[str, int], path: Path
) -> ModeMapChange:
    """Add the modes of a vehicle to a map.

    Parameters
    ----------
    present : Mapping
        The map in the file.
    kind : int
        MAV_TYPE of the vehicle.
    modes : Mapping
        `custom_mode` by name.
    path : Path
        The file, for error messages.

    Raises
    ------
    InputError
        The map has another name for one of the numbers, or another number for one of the names.
    """
    merged = {key: dict(names) for key, names in present.items()}
    names = merged.setdefault(str(kind), {})
    numbers = {name: number for number, name in names.items()}
    added = {}
    for name, number in modes.items():
        present_name, key = names.get(str(number)), f"{kind}.{number}"
        if present_name == name:
            continue
        if present_name is not None:
            raise InputError(
                f"{path}: {key}: is {present_name!r} in the file, {name!r} on the vehicle; "
                "remove or rename one"
            )
        if name in numbers:
            key = f"{kind}.{numbers[name]}"
            raise InputError(
                f"{path}: {key}: is {name!r} in the file, the vehicle's {name!r} is {number}; "
                "remove one"
            )
        names[str(number)] = added[key] = name
    return ModeMapChange(merged, added)


def write(path: Path, modes: ModeMap) -> None:
    """Replace the file by a map in one atomic step. Raises InputError."""
    try:
        path.resolve().parent.mkdir(parents=True, exist_ok=True)
        write_output(path, json.dumps(modes, indent=2) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


def _is_number(key: str) -> bool:
    """Return whether a key is a decimal number."""
    return key.isascii() and key.isdecimal()
