"""Disturbance moments of a shipped scenario, scaled to another vehicle than Caribou."""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from sysid.planes import Plane

SIGNIFICANT_DIGITS = 4
"""Digits of a scaled moment."""


class ScaledScenario(NamedTuple):
    """A scenario for a vehicle."""

    content: dict[str, Any]
    """Tables with all keys."""
    text: str
    """TOML text; empty if the scenario is used as it is."""
    note: str
    """What was scaled, in one line."""


def scale(scenario: str, content: dict[str, Any], ratios: Mapping[str, float]) -> ScaledScenario:
    """Return a shipped scenario with its moments scaled.

    Parameters
    ----------
    scenario : str
        Name of a shipped scenario, or a file, which is used as it is.
    content : dict
        The scenario with all keys.
    ratios : Mapping
        Moment relative to Caribou's, by plane (`sysid.test_design.vehicle_scale`).

    Returns
    -------
    ScaledScenario
        Scenario with scaled moments (N m).
    """
    if Path(scenario).is_file():
        return ScaledScenario(content, "", f"sea: {scenario} as it is")
    scaled = copy.deepcopy(content)
    moments = [
        (table, f"{plane}_rms_nm", ratios[plane])
        for table in scaled["disturbance"].values()
        for plane in map(str, Plane)
    ]
    if not any(table[key] for table, key, _ in moments):
        return ScaledScenario(content, "", f"sea: {scenario} as it is, without moments")
    for table, key, ratio in moments:
        table[key] = float(f"{ratio * table[key]:.{SIGNIFICANT_DIGITS}g}")
    by_plane = ", ".join(f"{ratio:.3g} times in {plane}" for plane, ratio in ratios.items())
    note = f"ratio of the moments of inertia to Caribou's, less where surfaces are weak: {by_plane}"
    head = f"# Scenario {scenario} with its disturbance moments times the {note}\n"
    return ScaledScenario(
        scaled, head + encode(scaled), f"sea: moments of {scenario} times the {note}"
    )


def encode(content: Mapping[str, Any]) -> str:
    """Return the tables of a scenario as TOML; keys without a value are left out."""
    lines: list[str] = []
    tables = {key: value for key, value in content.items() if isinstance(value, dict)}
    lines += [f"{key} = {_literal(value)}" for key, value in content.items() if key not in tables]
    for name, table in tables.items():
        keys = [f"{key} = {_literal(value)}" for key, value in table.items() if value is not None]
        lines += ["", f"[{name}]", *keys]
    return "\n".join(lines) + "\n"


def _literal(value: Any) -> str:
    """Return a TOML literal."""
    if isinstance(value, dict):
        keys = (f"{key} = {_literal(v)}" for key, v in value.items() if v is not None)
        return "{ " + ", ".join(keys) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_literal, value)) + "]"
    return msgspec.json.encode(value).decode()
