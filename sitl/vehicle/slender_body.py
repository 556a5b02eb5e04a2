"""Table 1's column for any slender vehicle: each number with its formula, inputs and source.

``fill_missing`` uses these steps for the keys that a vehicle file omits, and ``first_principles``
prints them beside the paper's table. Axes and symbols are the paper's: x forward, y port, z up,
origin on the hull axis at mid-length; rudder dr, elevator de in rad.

Linear coefficients at speed U (m/s), with tails i at x_i with side force k_i = 1/2 rho A_i
dC_L/dalpha U per m/s of sway, hull side force h = 1/2 rho l d C_L' U at x_h, and thrust T:

    Y_v = -sum k_i - h                        N_v = -sum x_i k_i - 1/2 rho l^2 d C_M' U
    Y_r = -sum x_i k_i - x_h h + X_udot U     N_r = -sum x_i^2 k_i - x_h^2 h
    Y_dr = sum (k_d,i U + T_i)                N_dr = sum x_i (k_d,i U + T_i)

with k_d the side force per m/s and radian of command (the paper, "Overall Vehicle Modeling"). Added
mass is by strips (Newman 1977) and, along x, of a spheroid (Lamb 1932, sec. 114).
"""

from __future__ import annotations

from typing import NamedTuple

from sitl.vehicle import empirical, hull
from sitl.vehicle.file_schema import DuctGeometry, FinGeometry, HullGeometry
from sitl.vehicle.hull import Integrals


class Derivation(NamedTuple):
    """One derived quantity with its derivation in words."""

    symbol: str
    """Symbol, or key of the vehicle file."""
    unit: str
    formula: str
    inputs: str
    """Values of the inputs with units, as text."""
    value: float
    source: str
    """Author and year, or the assumption."""
    table: float | None = None
    """Value in Table 1 or in the paper's text; None where the paper has no value."""

    @property
    def difference_pct(self) -> float | None:
        """Derived minus printed value, in percent of the printed value."""
        return None if self.table is None else 100 * (self.value - self.table) / abs(self.table)


class Tail(NamedTuple):
    """Effect of a ring duct or a set of fins in one plane, for small angles."""

    x_m: float
    """Position forward of mid-length; negative."""
    lift_kgpm: float
    """Side force per m/s of speed and m/s of sway: 1/2 rho A dC_L/dalpha."""
    steer_kgpm: float
    """Side force per speed squared and radian of command."""
    thrust_n: float
    """Thrust that turns with the command."""


def duct_tail(ring: DuctGeometry, thrust_n: float, density_kgpm3: float) -> Tail:
    """Return the tail of a ring with the propeller inside."""
    lift = density_kgpm3 / 2 * ring.area_m2 * ring.lift_slope_per_rad
    return (
        Tail(x_m=ring.x_m, lift_kgpm=lift, steer_kgpm=lift, thrust_n=thrust_n)
        if ring.vectored
        else Tail(x_m=ring.x_m, lift_kgpm=lift, steer_kgpm=0.0, thrust_n=0.0)
    )


def fin_tail(fins: FinGeometry, density_kgpm3: float) -> Tail:
    """Return the tail of four fins.

    In one plane, two cruciform fins carry lift, or four X fins carry their component, which is the
    same. Steering has the additional factor ``command_gain``.
    """
    two_fins = 2 * density_kgpm3 / 2 * fins.area_m2 * fins.lift_slope_per_rad
    return Tail(
        x_m=fins.x_m, lift_kgpm=two_fins, steer_kgpm=two_fins * fins.command_gain, thrust_n=0.0
    )


class Flow(NamedTuple):
    """Inputs of the linear yaw plane."""

    speed_mps: float
    density_kgpm3: float
    length_m: float
    diameter_m: float
    X_udot_kg: float
    lift_per_rad: float
    """C_L' of the hull, on length times diameter."""
    moment_per_rad: float
    """C_M' of the hull, on length squared times diameter; includes the Munk moment."""
    lift_at_m: float
    """Position x_h, forward of mid-length, at which the hull's lift takes its incidence in a turn.

    0 takes the incidence from sway alone."""
    tails: tuple[Tail, ...]
    hull_source: str
    """Source of ``lift_per_rad``."""
    moment_source: str
    """Source of ``moment_per_rad``."""


def size(shape: HullGeometry) -> str:
    """Return length and diameter of the hull as text."""
    return f"l {hull.length_m(shape):.4g} m, d {shape.diameter_m:.4g} m"


def added_mass(
    shape: HullGeometry, fins: FinGeometry | None, density_kgpm3: float
) -> list[Derivation]:
    """Return X_udot of the spheroid, and Y_vdot and N_rdot (about mid-length) by strips."""
    # Strips: Y_vdot = -rho int pi R^2 dx - m_f, N_rdot = -rho int pi R^2 x^2 dx - x_f^2 m_f, with R
    # hull radius (m) and m_f (kg) what the fins at x_f (m) add: section times mean chord (Newman
    # 1977; Blevins 1979). Spheroid: X_udot = -k_1 rho pi/6 l d^2 (Lamb 1932, sec. 114).
    hull_integrals, rho, inputs = hull.integrals(shape), density_kgpm3, size(shape)
    X_udot = -empirical.axial_added_mass_kg(hull.length_m(shape), shape.diameter_m, rho)
    fin_mass = x = 0.0
    fin_term = fin_turning_term = ""
    if fins is not None:
        section = empirical.finned_section_kgpm(fins.hull_radius_m, fins.tip_radius_m, rho)
        fin_mass, x = section * (fins.root_chord_m + fins.tip_chord_m) / 2, fins.x_m
        fin_term, fin_turning_term = (
            " - rho pi (s^2 - R^2)^2/s^2 c",
            " - x^2 rho pi (s^2 - R^2)^2/s^2 c",
        )
        inputs += f", fins s {fins.tip_radius_m:.4g} m at {x:.4g} m"
    source = "strips, Newman 1977" + (", finned section, Blevins 1979" if fins is not None else "")
    return [
        Derivation(
            symbol="X_udot",
            unit="kg",
            formula="-k_1 rho pi/6 l d^2",
            inputs=size(shape),
            value=X_udot,
            source="spheroid, Lamb 1932 sec. 114",
        ),
        Derivation(
            symbol="Y_vdot",
            unit="kg",
            formula=f"-rho int pi R^2 dx{fin_term}",
            inputs=inputs,
            value=-rho * hull_integrals.volume_m3 - fin_mass,
            source=source,
        ),
        Derivation(
            symbol="N_rdot",
            unit="kg m2",
            formula=f"-rho int pi R^2 x^2 dx{fin_turning_term}",
            inputs=inputs,
            value=-rho * hull_integrals.section_moment_m5 - x**2 * fin_mass,
            source=source,
        ),
    ]


def yaw_inertia(shape: HullGeometry, mass_kg: float) -> Derivation:
    """Return I_zz about mid-length of a mass that is distributed evenly over the hull."""
    hull_integrals: Integrals = hull.integrals(shape)
    inertia = mass_kg / hull_integrals.volume_m3 * hull_integrals.pitch_inertia_m5
    inputs = f"{size(shape)}, m {mass_kg:.4g} kg"
    return Derivation(
        symbol="I_zz",
        unit="kg m2",
        formula="m/V int (pi R^2 x^2 + pi R^4/4) dx",
        inputs=inputs,
        value=inertia,
        source="homogeneous hull",
    )


def hull_moment_per_rad(
    length_m: float, diameter_m: float, density_kgpm3: float, munk_kg: float
) -> float:
    """Return C_M' of the Munk moment plus that of the hull's lift, per radian.

    ``munk_kg`` is X_udot - Y_vdot. The reference is 1/2 rho l^2 d.
    """
    munk = munk_kg / (density_kgpm3 / 2 * length_m**2 * diameter_m)
    return munk + empirical.HULL_LIFT_AT * empirical.hull_lift_slope_per_rad()


def yaw_plane(flow: Flow) -> list[Derivation]:
    """Return steering, damping and turning coefficients at ``flow.speed_mps``.

    Tail and hull lift are forces at a position x, proportional to the local crossflow v + x r.
    """
    # Equations: module docstring. k, k_x, k_xx: sums of k_i, x_i k_i and x_i^2 k_i.
    U, tails = flow.speed_mps, flow.tails
    planform = flow.length_m * flow.diameter_m
    pressure = flow.density_kgpm3 / 2 * planform * U
    side, moment = pressure * flow.lift_per_rad, pressure * flow.length_m * flow.moment_per_rad
    k, k_x, k_xx = (sum(tail.lift_kgpm * U * tail.x_m**n for tail in tails) for n in (0, 1, 2))
    Y_dr, N_dr = (
        sum((tail.steer_kgpm * U**2 + tail.thrust_n) * tail.x_m**n for tail in tails)
        for n in (0, 1)
    )
    positions = f"x {' and '.join(f'{tail.x_m:.5g}' for tail in tails)} m"
    tail, body = f"k {k:.4g} kg/s, {positions}", f"A_p {planform:.4g} m2, U {U:.4g} m/s"
    return [
        Derivation(
            symbol="Y_dr",
            unit="N/rad",
            formula="k_d U + T, k_d = 1/2 rho A dC_L/dd U",
            inputs=f"{positions}, U {U:.4g} m/s",
            value=Y_dr,
            source="tail and the thrust that it turns",
        ),
        Derivation(
            symbol="N_dr",
            unit="N m/rad",
            formula="x Y_dr",
            inputs=positions,
            value=N_dr,
            source="tail",
        ),
        Derivation(
            symbol="Y_v",
            unit="kg/s",
            formula="-k - 1/2 rho A_p C_L' U",
            inputs=f"{body}, C_L' {flow.lift_per_rad:.3g}",
            value=-k - side,
            source=f"tail and hull: {flow.hull_source}",
        ),
        Derivation(
            symbol="N_v",
            unit="kg m/s",
            formula="-x k - 1/2 rho A_p l C_M' U",
            inputs=f"{body}, C_M' {flow.moment_per_rad:.3g}",
            value=-k_x - moment,
            source=f"tail and hull: {flow.moment_source}",
        ),
        *_turning(flow, side, (k_x, k_xx), tail),
    ]


def _turning(
    flow: Flow, side_kgps: float, tail: tuple[float, float], inputs: str
) -> list[Derivation]:
    """Return Y_r and N_r from the tail's sums (x k, x^2 k) and from the hull's lift at x_h."""
    (k_x, k_xx), x_h, U, X_udot = tail, flow.lift_at_m, flow.speed_mps, flow.X_udot_kg
    lift_term, lift_squared_term, source = "", "", "tail"
    if x_h:
        inputs += f", h = 1/2 rho A_p C_L' U {side_kgps:.4g} kg/s at x_h {x_h:.4g} m"
        lift_term, lift_squared_term, source = " - x_h h", " - x_h^2 h", "tail and hull"
    return [
        Derivation(
            symbol="Y_r",
            unit="kg m/s",
            formula=f"-x k{lift_term} + X_udot U",
            inputs=f"{inputs}, X_udot {X_udot:.4g} kg",
            value=-k_x - x_h * side_kgps + X_udot * U,
            source=f"{source}, and axial added mass",
        ),
        Derivation(
            symbol="N_r",
            unit="kg m2/s",
            formula=f"-x^2 k{lift_squared_term}",
            inputs=inputs,
            value=-k_xx - x_h**2 * side_kgps,
            source=source,
        ),
    ]


TWINS = (
    ("Z_w", "Y_v", 1),
    ("M_w", "N_v", -1),
    ("Z_q", "Y_r", -1),
    ("M_q", "N_r", 1),
    ("Z_de", "Y_dr", -1),
    ("M_de", "N_dr", 1),
    ("Z_wdot", "Y_vdot", 1),
    ("M_qdot", "N_rdot", 1),
    ("I_yy", "I_zz", 1),
)
"""Pitch coefficient, the equal yaw coefficient and their relative sign in axes with y port, z up.

They are equal because the hull is a body of revolution."""


def pitch_twins(yaw: list[Derivation]) -> list[Derivation]:
    """Return the pitch plane that equals the yaw plane rotated by 90 degrees about x."""
    by_symbol = {step.symbol: step for step in yaw}
    return [
        _mirrored(name, by_symbol[twin], sign) for name, twin, sign in TWINS if twin in by_symbol
    ]


def _mirrored(name: str, twin: Derivation, sign: int) -> Derivation:
    """Return pitch coefficient ``name`` as ``sign`` times the yaw coefficient ``twin``."""
    formula = f"{'-' if sign < 0 else ''}{twin.symbol}"
    inputs = f"{twin.symbol} {twin.value:.4g}"
    return Derivation(
        symbol=name,
        unit=twin.unit,
        formula=formula,
        inputs=inputs,
        value=sign * twin.value,
        source="symmetry of revolution",
    )
