"""Check of a vehicle file with its instruments; `sitl.vehicle.check` checks the physics."""

from __future__ import annotations

from pathlib import Path

from sitl.core.sensors import datasheets
from sitl.vehicle import check as physics_checks
from sitl.vehicle import config as files
from sitl.vehicle.check import Report
from sitl.vehicle.config import VehicleConfig, VehicleFileError

NEEDED_TO_ARM = ("imu", "magnetometer", "pressure")
"""Instruments without which Caribou's autopilot never initialises its estimate, and never arms."""


def check(name_or_path: str | Path) -> Report:
    """Check a vehicle file and predict the behaviour of the vehicle.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a shipped vehicle, or path of a vehicle file.

    Returns
    -------
    Report
        Trim, speeds, periods, linear planes and warnings.

    Raises
    ------
    VehicleFileError
        The file is invalid, the vehicle is physically impossible, or an instrument is unknown.
    """
    return check_config(files.load(name_or_path), str(name_or_path))


def check_config(config: VehicleConfig, source: str) -> Report:
    """Check the content of a vehicle file as `check` does.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle with all keys.
    source : str
        Name of the file in error messages.

    Returns
    -------
    Report
        Trim, speeds, periods, linear planes and warnings.

    Raises
    ------
    VehicleFileError
        The vehicle is physically impossible, or an instrument is unknown.
    """
    datasheets.check(config.instruments, source)
    report = physics_checks.check_config(config, source)
    missing = _missing_to_arm(config)
    warnings = [
        f'instruments.{kind} = "none": Caribou\'s autopilot does not arm' for kind in missing
    ]
    return report._replace(warnings=[*report.warnings, *warnings])


def check_flight(name_or_path: str | Path) -> Report:
    """Check a vehicle file as `check` does, before Caribou's autopilot flies it.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a shipped vehicle, or path of a vehicle file.

    Returns
    -------
    Report
        Trim, speeds, periods, linear planes and warnings.

    Raises
    ------
    VehicleFileError
        As of `check`; or an instrument is missing without which the autopilot does not arm.
    """
    config, source = files.load(name_or_path), str(name_or_path)
    report = check_config(config, source)
    for kind in _missing_to_arm(config):
        known = ", ".join(getattr(datasheets.catalogue(), kind))
        raise VehicleFileError(
            f'{source}: instruments.{kind} = "none": the autopilot does not arm without it;'
            f" expected {known}"
        )
    return report


def _missing_to_arm(config: VehicleConfig) -> list[str]:
    """Return the kinds of instruments that the autopilot needs and the vehicle does not have."""
    return [kind for kind in NEEDED_TO_ARM if getattr(config.instruments, kind) == datasheets.NONE]
