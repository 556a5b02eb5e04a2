"""Published empirical formulas for hull and fins, from geometry alone.

Symbols: l length, d diameter (m), rho density (kg/m3), x forward from mid-length (m). Coefficients
are dimensionless; the docstring names the reference area.
"""

from __future__ import annotations

from math import atanh, degrees, log10, pi, sqrt

VISCOSITY_M2PS = 1.19e-6
"""Kinematic viscosity of sea water at 15 C, m2/s (ITTC 2011, 7.5-02-01-03)."""
HULL_LIFT_PER_DEG = 0.003
"""Side force coefficient on d^2, per l/d and per degree of incidence, for l/d of 6 to 10.

Hoerner and Borst 1975, "Fluid-Dynamic Lift", ch. 19."""
HULL_LIFT_AT = -0.15
"""Position of the hull lift in lengths forward of mid-length (65 % of the length from the nose).

Hoerner and Borst 1975, ch. 19."""
ROUGHNESS = 2.0
"""Drag of a vehicle with holes, joints and instruments over the drag of the smooth hull.

It is 2.4 for the REMUS (Prestero 2001, measured 3.9 over computed 1.6 kg/m) and 1.6 for Caribou
(thrust balance)."""


def axial_added_mass_kg(length_m: float, diameter_m: float, density_kgpm3: float) -> float:
    """Return -X_udot of the spheroid with the given length and diameter, kg."""
    # Lamb 1932, sec. 114 (the paper, after Blevins). a, b: half axes, e: eccentricity,
    #     e^2 = 1 - (b/a)^2,  alpha_0 = 2 (1 - e^2)/e^3 (artanh e - e),
    #     -X_udot = alpha_0/(2 - alpha_0) rho 4/3 pi a b^2.
    a, b = length_m / 2, diameter_m / 2
    e = sqrt(1 - (b / a) ** 2)
    alpha_0 = 2 * (1 - e**2) / e**3 * (atanh(e) - e)
    return alpha_0 / (2 - alpha_0) * density_kgpm3 * 4 / 3 * pi * a * b**2


def hull_lift_slope_per_rad() -> float:
    """Return the side force coefficient of the hull on length times diameter, per radian."""
    return degrees(HULL_LIFT_PER_DEG)


def friction_coefficient(speed_mps: float, length_m: float) -> float:
    """Return the friction coefficient on wetted area: C_f = 0.075/(log10 Re - 2)^2 (ITTC 1957)."""
    return 0.075 / (log10(speed_mps * length_m / VISCOSITY_M2PS) - 2) ** 2


def form_factor(slenderness: float) -> float:
    """Return the drag of a streamlined body of revolution over its friction drag.

    ``slenderness`` is l/d: 1 + 1.5 (d/l)^(3/2) + 7 (d/l)^3 (Hoerner 1965, ch. 6, eq. 28).
    """
    return 1 + 1.5 / (slenderness * sqrt(slenderness)) + 7 / slenderness**3


def fin_lift_slope_per_rad(aspect_ratio: float) -> float:
    """Return dC_L/dalpha of an unswept control surface of low aspect ratio, per radian.

    0.9 2 pi AR/(sqrt(AR^2 + 4) + 1.8), on planform area (Whicker and Fehlner 1958, DTMB report
    933).
    """
    return 0.9 * 2 * pi * aspect_ratio / (sqrt(aspect_ratio**2 + 4) + 1.8)


def fin_crossflow_per_rad2(aspect_ratio: float) -> float:
    """Return the quadratic lift coefficient C_Dc/AR, with C_Dc = 0.8 for squared tips.

    Source: Whicker and Fehlner 1958, DTMB report 933.
    """
    return 0.8 / aspect_ratio


def finned_section_kgpm(radius_m: float, tip_radius_m: float, density_kgpm3: float) -> float:
    """Return the transverse added mass that four fins add to a round section, kg/m.

    rho pi (s^2 - R^2)^2/s^2 with radius R and tip radius s (Blevins 1979, table 14-1).
    """
    return density_kgpm3 * pi * (tip_radius_m**2 - radius_m**2) ** 2 / tip_radius_m**2


def finned_section_roll_kgm(tip_radius_m: float, density_kgpm3: float) -> float:
    """Return the added roll inertia of four crossed fins per metre, kg m.

    2/pi rho s^4 with tip radius s (Blevins 1979, table 14-1).
    """
    return 2 / pi * density_kgpm3 * tip_radius_m**4
