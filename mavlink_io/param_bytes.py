"""Parameters whose bytes are sent in the float of PARAM_VALUE: PARAM_ENCODE_BYTEWISE, as PX4."""

import struct

from mavlink_io.dialect import constant

PX4 = constant("MAV_AUTOPILOT_PX4")
"""Autopilot of HEARTBEAT that sends integers as bytes."""
INTEGER_FORMATS = {
    constant(f"MAV_PARAM_TYPE_{name}"): code
    for name, code in {
        "UINT8": "<B",
        "INT8": "<b",
        "UINT16": "<H",
        "INT16": "<h",
        "UINT32": "<I",
        "INT32": "<i",
    }.items()
}
"""Format of the first bytes of param_value by MAV_PARAM_TYPE; other types are floats."""
_REAL32 = "<f"


def decode_bytewise(data: bytes, param_type: int) -> float:
    """Return the value of a parameter.

    Parameters
    ----------
    data : bytes
        The four bytes of param_value, which come first in PARAM_VALUE. As a float, the bytes of
        some integers would change.
    param_type : int
        MAV_PARAM_TYPE.

    Returns
    -------
    float
        The value.
    """
    return float(struct.unpack_from(INTEGER_FORMATS.get(param_type, _REAL32), data)[0])
