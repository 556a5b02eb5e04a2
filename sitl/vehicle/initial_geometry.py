"""Initial vehicle geometry from length and diameter, with the usual proportions of its kind."""

from __future__ import annotations

from typing import Any, Literal

Kind = Literal["series58", "myring", "cylinder"]
Steering = Literal["duct", "cruciform", "x"]

DUCT_DIAMETER, DUCT_CHORD = 0.78, 0.23
"""Duct diameter and chord over hull diameter, from Caribou."""
FIN_SPAN, FIN_CHORD = 0.50, 0.45
"""Fin span and chord over hull diameter.

REMUS 100: 0.45 and 0.39; Explorer: 0.52 and 0.52."""


def starter(
    name: str, kind: Kind, steering: Steering, length_m: float, diameter_m: float
) -> dict[str, Any]:
    """Return the tables of a minimal vehicle file."""
    steer = (
        {"duct": {"diameter_m": DUCT_DIAMETER * diameter_m, "chord_m": DUCT_CHORD * diameter_m}}
        if steering == "duct"
        else {
            "fins": {
                "layout": steering,
                "span_m": FIN_SPAN * diameter_m,
                "root_chord_m": FIN_CHORD * diameter_m,
            }
        }
    )
    return {"name": name, "hull": {"shape": kind, **_hull(kind, length_m, diameter_m)}, **steer}


def _hull(kind: Kind, length_m: float, diameter_m: float) -> dict[str, float]:
    """Return the hull table of a kind, without its ``shape``."""
    if kind == "series58":
        return {
            "base_length_m": length_m,
            "diameter_m": diameter_m,
            "midbody_length_m": 0.0,
            "nose_radius": 0.5,
            "tail_radius": 0.1,
            "prismatic": 0.65,
            "max_section": 0.4,
        }
    if kind == "myring":
        nose, tail = min(1.0 * diameter_m, 0.25 * length_m), min(2.5 * diameter_m, 0.4 * length_m)
        return {
            "nose_length_m": nose,
            "mid_length_m": length_m - nose - tail,
            "tail_length_m": tail,
            "diameter_m": diameter_m,
        }
    return {"length_m": length_m, "diameter_m": diameter_m}
