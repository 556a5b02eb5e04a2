"""Logs of all formats as records, arrays and data frames."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ground.log_tools.si_units import TIME, si_columns
from mavlink_io.errors import InputError
from sysid.data import readers, state_table
from sysid.data.dataset import Log

if TYPE_CHECKING:
    import pandas


def load_log(path: str | Path) -> Log:
    """Load a dive from a log of any format.

    Parameters
    ----------
    path : str or Path
        MCAP log, MAVLink .tlog, ArduPilot .bin, PX4 .ulg or CSV file.

    Returns
    -------
    Log
        Attitude, depth, commands, set-points, velocity, events and parameters as arrays in SI units
        and radians, each with its own times.

    Raises
    ------
    CaribouError
        The file is missing, damaged, of unknown format, or lacks attitude, commands or depth.
    """
    return readers.read(path)


def load_messages(path: str | Path) -> dict[str, dict[str, NDArray[Any]]]:
    """Load all messages of a log.

    Parameters
    ----------
    path : str or Path
        Log of any format.

    Returns
    -------
    dict
        Columns by name, for each message type by its topic, such as ``/mavlink/1/1/ATTITUDE``. The
        first column is ``time_s``. MAVLink fields are in SI units with the unit at the end of the
        name.

    Raises
    ------
    CaribouError
        The file is missing, damaged or of unknown format.
    """
    tables = readers.load(Path(path)).tables
    return {
        topic: {TIME: table.time_s, **si_columns(topic, table.columns)}
        for topic, table in tables.items()
    }


def to_arrays(log: Log) -> dict[str, NDArray[np.float64]]:
    """Return the state of the vehicle on one time base.

    Parameters
    ----------
    log : Log
        A recorded or simulated dive.

    Returns
    -------
    dict
        Arrays of equal length by column name, in SI units and radians: ``time_s``, ``depth_m``,
        ``heading_rad``, ``rudder_rad``, ``depth_setpoint_m`` and others (docs/logs.md, "Exports").
        NaN where the log has no value.
    """
    return state_table.state_table(log)


def to_frame(log: Log) -> "pandas.DataFrame":
    """Return the state of the vehicle as a data frame with the columns of `to_arrays`.

    Parameters
    ----------
    log : Log
        A recorded or simulated dive.

    Returns
    -------
    pandas.DataFrame
        One row per sample of the attitude; the index is ``time_s``.

    Raises
    ------
    CaribouError
        pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("to_frame needs pandas: install caribou-auv[pandas]") from None
    return pandas.DataFrame(to_arrays(log)).set_index(TIME)
