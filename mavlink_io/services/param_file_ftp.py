"""ArduPilot's parameter file ``@PARAM/param.pck``, which clients download over MAVLink FTP.

One file replaces a hundred PARAM_VALUE messages. Source: ArduPilot, AP_Filesystem/README.md,
"The @PARAM filesystem".

Format, little-endian: a head (magic, number of parameters in the file, number of all parameters),
then for each parameter in the order of names:

- one byte: type in bits 0 to 3; bit 4 is set if a default follows the value;
- one byte: number of characters shared with the beginning of the previous name in bits 0 to 3,
  length of the rest of the name minus one in bits 4 to 7;
- the rest of the name;
- the value, and the default if bit 4 is set (float32).
"""

import struct
from collections.abc import Mapping
from typing import NamedTuple

PATH = "@PARAM/param.pck"
WITH_DEFAULTS = "?withdefaults=1"
"""Suffix that MAVProxy and Mission Planner append to the path to request defaults too."""

_MAGIC, _MAGIC_DEFAULTS = 0x671B, 0x671C
_FLOAT, _HAS_DEFAULT = 4, 0x10
_HEAD = struct.Struct("<HHH")


class PackedParameter(NamedTuple):
    """Value and default of one parameter."""

    value: float
    default: float


def pack(parameters: Mapping[str, PackedParameter], with_defaults: bool = False) -> bytes:
    """Return the file of some parameters, all of type float32.

    Parameters
    ----------
    parameters : mapping of str to PackedParameter
        Parameters by name. A name has 1 to 16 characters.
    with_defaults : bool
        Whether to include the default of each parameter whose value differs from it.

    Returns
    -------
    bytes
        Content of ``param.pck``.
    """
    count = len(parameters)
    packed = [_HEAD.pack(_MAGIC_DEFAULTS if with_defaults else _MAGIC, count, count)]
    previous = ""
    for name, parameter in sorted(parameters.items()):
        has_default = with_defaults and parameter.value != parameter.default
        shared = min(len(name) - 1, _shared_length(name, previous))
        rest = name[shared:].encode()
        type_byte = _FLOAT | (_HAS_DEFAULT if has_default else 0)
        packed.append(bytes((type_byte, len(rest) - 1 << 4 | shared)) + rest)
        packed.append(struct.pack("<f", parameter.value))
        if has_default:
            packed.append(struct.pack("<f", parameter.default))
        previous = name
    return b"".join(packed)


def _shared_length(name: str, previous: str) -> int:
    """Return the number of characters that the beginnings of two names share."""
    return next(
        (n for n, (a, b) in enumerate(zip(name, previous, strict=False)) if a != b),
        min(len(name), len(previous)),
    )
