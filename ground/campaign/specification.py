"""Specification of a redesign: defaults, changed by a file, changed by options.

The file is TOML with one `name = number` per line; the names are those of `sysid.design.pid.Spec`.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path

from msgspec.structs import replace

from mavlink_io.errors import InputError
from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import parse_toml, read_text
from sysid.design.pid import Spec

BOUNDS = {
    "damping": (0.05, 0.95),
    "gm_db": (1.0, 40.0),
    "pm_deg": (5.0, 90.0),
    "max_sensitivity": (1.05, 10.0),
    "robust_gm_db": (0.0, 40.0),
    "robust_pm_deg": (0.0, 90.0),
    "robust_fraction": (0.0, 1.0),
    "integral_settling_s": (1.0, 3600.0),
    "integral_residual": (0.01, 1.0),
    "impulse_overshoot": (0.01, 1.0),
    "heading_step_deg": (1.0, 180.0),
    "travel_deg": (1.0, 45.0),
    "rate_degps": (0.1, 720.0),
    "depth_step_m": (0.1, 100.0),
    "depth_overshoot": (0.0, 1.0),
    "operating_depth_m": (0.0, 6000.0),
    "assumed_wave_depth_m": (0.0, 2.0),
    "assumed_wave_ratio": (0.0, 10.0),
    "pitch_rms_ratio": (0.1, math.inf),
    "pitch_per_metre_deg": (0.1, 90.0),
    "command_noise_deg": (0.01, 10.0),
}
"""Plausible range of each limit; a value outside was probably meant in another unit."""


def read(file: Path | None, options: Mapping[str, float | None], first: Spec | None = None) -> Spec:
    """Return a specification.

    Parameters
    ----------
    file : Path, optional
        TOML file with limits that replace those of `first`.
    options : Mapping
        Limits that replace those of the file; None for an option that is not given.
    first : Spec, optional
        Specification to start from; the default one if missing.

    Raises
    ------
    InputError
        A limit is unknown or out of range, or the file cannot be read.
    """
    table = _table(file) if file else {}
    unknown = next((name for name in table if name not in BOUNDS), None)
    if unknown:
        raise InputError(
            f"{file}: {unknown}: there is no such limit; expected one of {', '.join(BOUNDS)}"
            f"{did_you_mean(unknown, BOUNDS)}"
        )
    given = {name: value for name, value in options.items() if value is not None}
    limits = {name: _number(f"{file}: {name} =", name, value) for name, value in table.items()}
    limits |= {
        name: _number(f"--{name.replace('_', '-')}", name, value) for name, value in given.items()
    }
    return replace(first or Spec(), **limits)


def _table(file: Path) -> dict[str, object]:
    """Read a TOML file. Raises InputError."""
    try:
        return parse_toml(read_text(file))
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: not TOML: {error}") from None


def _number(where: str, name: str, value: object) -> float:
    """Return a limit as a number. Raises InputError."""
    low, high = BOUNDS[name]
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        shown = repr(value) if isinstance(value, str) else value
        raise InputError(f"{where} {shown}: must be a number from {low:g} to {high:g}")
    return float(value)
