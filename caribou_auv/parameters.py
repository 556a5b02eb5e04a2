"""Parameter files of the autopilot."""

from collections.abc import Mapping
from pathlib import Path

from ground.client import param_file


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
    """
    param_file.save(Path(path), parameters)
