"""Rounding to float32, in which MAVLink sends the values of parameters (REAL32)."""

import struct


def as_real32(value: float) -> float:
    """Round a number to float32.

    Parameters
    ----------
    value : float
        Any number.

    Returns
    -------
    float
        The nearest float32.

    Raises
    ------
    OverflowError
        The number is beyond the range of float32.
    """
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
