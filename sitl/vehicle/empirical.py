"""Published formulas for what a hull and its fins do to the water, from their geometry alone."""

from __future__ import annotations

from math import atanh, degrees, log10, pi, sqrt

VISCOSITY_M2PS = 1.19e-6
"""Kinematic, of sea water at 15 C (ITTC 2011, 7.5-02-01-03)."""
HULL_LIFT_PER_DEG = 0.003
"""Of side force on d^2, per l/d and degree (Hoerner and Borst 1975, "Fluid-Dynamic Lift", ch. 19),
l/d of 6 to 10."""
HULL_LIFT_AT = -0.15
"""Where it acts, in lengths forward of mid-length: 65 % of the length behind the nose (the
same)."""
ROUGHNESS = 2.0
"""Drag of a vehicle with holes, joints and instruments over that of her smooth hull: 2.4 for the
REMUS (Prestero 2001, measured 3.9 over computed 1.6 kg/m) and 1.6 for Caribou (her thrust balance),
so of the order of two."""


def axial_added_mass_kg(length_m: float, diameter_m: float, density_kgpm3: float) -> float:
    """-X_udot of the spheroid on length and diameter (Lamb 1932, sec. 114; the paper, after
    Blevins), kg."""
    a, b = length_m / 2, diameter_m / 2
    e = sqrt(1 - (b / a) ** 2)
    alpha_0 = 2 * (1 - e**2) / e**3 * (atanh(e) - e)
    return alpha_0 / (2 - alpha_0) * density_kgpm3 * 4 / 3 * pi * a * b**2


def hull_lift_slope_per_rad() -> float:
    """Side force of the hull on length times diameter, per radian of incidence."""
    return degrees(HULL_LIFT_PER_DEG)


def friction_coefficient(speed_mps: float, length_m: float) -> float:
    """ITTC 1957 line, on wetted area."""
    return 0.075 / (log10(speed_mps * length_m / VISCOSITY_M2PS) - 2) ** 2


def form_factor(slenderness: float) -> float:
    """Drag of a streamlined body of revolution over its friction (Hoerner 1965, ch. 6, eq. 28)."""
    return 1 + 1.5 / (slenderness * sqrt(slenderness)) + 7 / slenderness**3


def fin_lift_slope_per_rad(aspect_ratio: float) -> float:
    """dC_L/dalpha of an unswept low-aspect-ratio control surface (Whicker and Fehlner 1958, DTMB
    report 933)."""
    return 0.9 * 2 * pi * aspect_ratio / (sqrt(aspect_ratio**2 + 4) + 1.8)


def fin_crossflow_per_rad2(aspect_ratio: float) -> float:
    """Quadratic lift, C_Dc/AR with 0.8 for squared tips (the same)."""
    return 0.8 / aspect_ratio


def finned_section_kgpm(radius_m: float, tip_radius_m: float, density_kgpm3: float) -> float:
    """Sideways added mass that four fins add to a round section, per metre (Blevins 1979, table
    14-1)."""
    return density_kgpm3 * pi * (tip_radius_m**2 - radius_m**2) ** 2 / tip_radius_m**2


def finned_section_roll_kgm(tip_radius_m: float, density_kgpm3: float) -> float:
    """Added roll inertia of four crossed fins, 2/pi rho s^4 per metre (Blevins 1979, table
    14-1)."""
    return 2 / pi * density_kgpm3 * tip_radius_m**4
