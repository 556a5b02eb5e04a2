"""Parameter files of the autopilot."""

import math
from collections.abc import Mapping
from numbers import Real
from pathlib import Path

from ground.client import param_file
from mavlink_io.errors import InputError


def load_parameters(path: str | Path) -> dict[str, float]:
    """Load a parameter file.

    Parameters
    ----------
    path : str or Path
        File with one ``NAME,VALUE`` per line, such as a ``gains.param``.

    Returns
    -------
    dict
        Values by parameter name, in the units of the parameters.

    Raises
    ------
    CaribouError
        The file cannot be read, or a line is no parameter.
    """
    return param_file.load(Path(path))


def save_parameters(parameters: Mapping[str, float], path: str | Path) -> None:
    """Save parameters, sorted by name.

    Parameters
    ----------
    parameters : mapping
        Values by parameter name.
    path : str or Path
        File to write; an existing one is overwritten.

    Raises
    ------
    CaribouError
        A value is no finite number, or the file cannot be written.
    """
    param_file.save(Path(path), checked(parameters))


def checked(parameters: Mapping[str, float] | None) -> dict[str, float]:
    """Return parameters given by a caller; none for None.

    Parameters
    ----------
    parameters : mapping or None
        Values by parameter name.

    Returns
    -------
    dict
        The same values.

    Raises
    ------
    InputError
        `parameters` is no mapping, or a value is no finite number.
    """
    if not isinstance(parameters, Mapping | None):
        raise InputError(
            f"parameters = {parameters!r}: expected values by name, such as {{'HDG_P': 0.6}}"
        )
    for name, value in (parameters or {}).items():
        if not isinstance(name, str):
            raise InputError(f"parameter {name!r}: expected the name of a parameter as text")
        if not isinstance(value, Real) or not math.isfinite(value):
            raise InputError(f"parameter {name} = {value!r}: expected a finite number")
    return dict(parameters or {})
