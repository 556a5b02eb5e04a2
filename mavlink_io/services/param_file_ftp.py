"""A whole parameter list as one file, which clients fetch over FTP as ``@PARAM/param.pck``:
ArduPilot's way to tell in one go what PARAM_VALUE tells in a hundred messages (ArduPilot's
AP_Filesystem/README.md, "The @PARAM filesystem").

Little-endian. A head: magic, count, count of all. Then each parameter in the order of names: its
type in the low four bits of a byte and in the high ones whether a default follows; the length less
one of the rest of its name, and how much of its beginning is that of the last name, four bits each;
the rest of the name; the value; and the default."""

import struct
from collections.abc import Mapping
from typing import NamedTuple

PATH = "@PARAM/param.pck"
WITH_DEFAULTS = "?withdefaults=1"
"""What MAVProxy and MissionPlanner append to the path."""

_MAGIC, _MAGIC_DEFAULTS = 0x671B, 0x671C
_FLOAT, _HAS_DEFAULT = 4, 0x10
_HEAD = struct.Struct("<HHH")


class PackedParameter(NamedTuple):
    value: float
    default: float


def pack(parameters: Mapping[str, PackedParameter], with_defaults: bool = False) -> bytes:
    """The file of some parameters, all of them REAL32. Names are 1 to 16 characters."""
    count = len(parameters)
    packed = [_HEAD.pack(_MAGIC_DEFAULTS if with_defaults else _MAGIC, count, count)]
    last = ""
    for name, parameter in sorted(parameters.items()):
        differs = with_defaults and parameter.value != parameter.default
        shared = min(len(name) - 1, _shared(name, last))
        rest = name[shared:].encode()
        packed.append(
            bytes((_FLOAT | (_HAS_DEFAULT if differs else 0), len(rest) - 1 << 4 | shared)) + rest
        )
        packed.append(struct.pack("<f", parameter.value))
        if differs:
            packed.append(struct.pack("<f", parameter.default))
        last = name
    return b"".join(packed)


def _shared(name: str, last: str) -> int:
    """How many characters two names have in common at their beginning."""
    return next(
        (n for n, (a, b) in enumerate(zip(name, last, strict=False)) if a != b),
        min(len(name), len(last)),
    )
