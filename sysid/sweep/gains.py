"""Sets of gains of a sweep: PID parameters, with or without LQG controllers."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import autopilot.control.lqg_file as lqg_file
from autopilot.control import params
from sysid.monte_carlo.study import GainsError
from sysid.sweep.dives import SweepGains


def read(
    name: str,
    values: Mapping[str, float],
    trims_deg: Mapping[str, float],
    controller: Path | None = None,
) -> SweepGains:
    """Return a set of gains.

    Parameters
    ----------
    name : str
        Name of the set.
    values : mapping
        Parameters by name.
    trims_deg : mapping
        Trim parameters, for a set without them.
    controller : Path, optional
        File of LQG controllers, which are flown instead of the PID loops.

    Returns
    -------
    SweepGains
        Parameters of the autopilot.

    Raises
    ------
    GainsError
        The autopilot rejects a parameter.
    LqgFileError
        The controller file is invalid.
    """
    enabled = {"LQG_ENABLE": 1.0} if controller else {}
    try:
        config = params.config({**trims_deg, **values, **enabled})
    except params.ParamError as error:
        raise GainsError(f"{name}: {error}") from None
    if controller:
        config = replace(config, lqg_controllers=lqg_file.load(controller))
    return SweepGains(name, config)
