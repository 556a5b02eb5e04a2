"""Table 1's column for any slender vehicle, each number with its formula, inputs and source.

What a vehicle file leaves out is filled by these steps, and ``derive`` prints them beside the
paper's table: there is one derivation. Axes and symbols are the paper's."""

from __future__ import annotations

from typing import NamedTuple

from sitl.vehicle import empirical, hull
from sitl.vehicle.file_schema import DuctGeometry, FinGeometry, HullGeometry
from sitl.vehicle.hull import Integrals


class Derivation(NamedTuple):
    """One derived quantity."""

    symbol: str
    unit: str
    formula: str
    inputs: str
    value: float
    source: str
    table: float | None = None
    """What Table 1 or the paper's text prints; None where it prints nothing."""

    @property
    def difference_pct(self) -> float | None:
        """Derived less printed, in percent of the printed value."""
        return None if self.table is None else 100 * (self.value - self.table) / abs(self.table)


class Tail(NamedTuple):
    """What a ring duct or a set of fins does in one plane, small angles."""

    x_m: float
    lift_kgpm: float
    """Side force per speed and m/s of sway: 1/2 rho A dC_L/dalpha."""
    steer_kgpm: float
    """Side force per speed squared and radian of command."""
    thrust_n: float
    """That turns with the command."""


def duct_tail(ring: DuctGeometry, thrust_n: float, density_kgpm3: float) -> Tail:
    """A ring with the propeller in it."""
    lift = density_kgpm3 / 2 * ring.area_m2 * ring.lift_slope_per_rad
    return Tail(ring.x_m, lift, lift, thrust_n) if ring.vectored else Tail(ring.x_m, lift, 0.0, 0.0)


def fin_tail(fins: FinGeometry, density_kgpm3: float) -> Tail:
    """Four fins: two carry lift in a plane, or four their component in it; so too when turned, but
    for the gain."""
    two = 2 * density_kgpm3 / 2 * fins.area_m2 * fins.lift_slope_per_rad
    return Tail(fins.x_m, two, two * fins.command_gain, 0.0)


class Flow(NamedTuple):
    """What the linear planes rest on."""

    speed_mps: float
    density_kgpm3: float
    length_m: float
    diameter_m: float
    X_udot_kg: float
    lift_per_rad: float
    """C_L' of the hull, on length times diameter."""
    moment_per_rad: float
    """C_M' of the hull, on length squared times diameter; holds the Munk moment."""
    lift_at_m: float
    """Where the hull's lift meets the cross flow of a turn, forward of mid-length; 0 counts its
    sway alone."""
    tails: tuple[Tail, ...]
    hull_source: str
    moment_source: str


def size(shape: HullGeometry) -> str:
    """The hull's size, in words."""
    return f"l {hull.length_m(shape):.4g} m, d {shape.diameter_m:.4g} m"


def added_mass(
    shape: HullGeometry, fins: FinGeometry | None, density_kgpm3: float
) -> list[Derivation]:
    """X_udot of the spheroid, Y_vdot and N_rdot by strips; N_rdot about mid-length."""
    whole, rho, of_size = hull.integrals(shape), density_kgpm3, size(shape)
    X_udot = -empirical.axial_added_mass_kg(hull.length_m(shape), shape.diameter_m, rho)
    finned = x = 0.0
    by_fins = turning_by_fins = ""
    if fins is not None:
        section = empirical.finned_section_kgpm(fins.hull_radius_m, fins.tip_radius_m, rho)
        finned, x = section * (fins.root_chord_m + fins.tip_chord_m) / 2, fins.x_m
        by_fins, turning_by_fins = (
            " - rho pi (s^2 - R^2)^2/s^2 c",
            " - x^2 rho pi (s^2 - R^2)^2/s^2 c",
        )
        of_size += f", fins s {fins.tip_radius_m:.4g} m at {x:.4g} m"
    source = "strips, Newman 1977" + (", finned section, Blevins 1979" if fins is not None else "")
    return [
        Derivation(
            "X_udot",
            "kg",
            "-k_1 rho pi/6 l d^2",
            size(shape),
            X_udot,
            "spheroid, Lamb 1932 sec. 114",
        ),
        Derivation(
            "Y_vdot",
            "kg",
            f"-rho int pi R^2 dx{by_fins}",
            of_size,
            -rho * whole.volume_m3 - finned,
            source,
        ),
        Derivation(
            "N_rdot",
            "kg m2",
            f"-rho int pi R^2 x^2 dx{turning_by_fins}",
            of_size,
            -rho * whole.section_moment_m5 - x**2 * finned,
            source,
        ),
    ]


def yaw_inertia(shape: HullGeometry, mass_kg: float) -> Derivation:
    """Of the mass spread evenly over the hull, about mid-length."""
    whole: Integrals = hull.integrals(shape)
    inertia = mass_kg / whole.volume_m3 * whole.pitch_inertia_m5
    inputs = f"{size(shape)}, m {mass_kg:.4g} kg"
    return Derivation(
        "I_zz", "kg m2", "m/V int (pi R^2 x^2 + pi R^4/4) dx", inputs, inertia, "homogeneous hull"
    )


def hull_moment_per_rad(
    length_m: float, diameter_m: float, density_kgpm3: float, munk_kg: float
) -> float:
    """C_M' of the Munk moment (``munk_kg`` = X_udot - Y_vdot) and of the hull's lift behind
    mid-length."""
    munk = munk_kg / (density_kgpm3 / 2 * length_m**2 * diameter_m)
    return munk + empirical.HULL_LIFT_AT * empirical.hull_lift_slope_per_rad()


def yaw_plane(flow: Flow) -> list[Derivation]:
    """Steering, damping and turning coefficients at ``flow.speed_mps``.

    Tail and hull lift are forces at a place on the cross flow met there, v + x r: they damp
    whatever the motion."""
    U, tails = flow.speed_mps, flow.tails
    planform = flow.length_m * flow.diameter_m
    pressure = flow.density_kgpm3 / 2 * planform * U
    side, moment = pressure * flow.lift_per_rad, pressure * flow.length_m * flow.moment_per_rad
    k, k_x, k_xx = (sum(tail.lift_kgpm * U * tail.x_m**n for tail in tails) for n in (0, 1, 2))
    Y_dr, N_dr = (
        sum((tail.steer_kgpm * U**2 + tail.thrust_n) * tail.x_m**n for tail in tails)
        for n in (0, 1)
    )
    at = f"x {' and '.join(f'{tail.x_m:.5g}' for tail in tails)} m"
    tail, body = f"k {k:.4g} kg/s, {at}", f"A_p {planform:.4g} m2, U {U:.4g} m/s"
    return [
        Derivation(
            "Y_dr",
            "N/rad",
            "k_d U + T, k_d = 1/2 rho A dC_L/dd U",
            f"{at}, U {U:.4g} m/s",
            Y_dr,
            "tail and the thrust that it turns",
        ),
        Derivation("N_dr", "N m/rad", "x Y_dr", at, N_dr, "tail"),
        Derivation(
            "Y_v",
            "kg/s",
            "-k - 1/2 rho A_p C_L' U",
            f"{body}, C_L' {flow.lift_per_rad:.3g}",
            -k - side,
            f"tail and hull: {flow.hull_source}",
        ),
        Derivation(
            "N_v",
            "kg m/s",
            "-x k - 1/2 rho A_p l C_M' U",
            f"{body}, C_M' {flow.moment_per_rad:.3g}",
            -k_x - moment,
            f"tail and hull: {flow.moment_source}",
        ),
        *_turning(flow, side, (k_x, k_xx), tail),
    ]


def _turning(
    flow: Flow, side_kgps: float, tail: tuple[float, float], inputs: str
) -> list[Derivation]:
    """Y_r and N_r of the tail's moments of place (x k, x^2 k) and of the hull's lift at its own."""
    (k_x, k_xx), x_h, U, X_udot = tail, flow.lift_at_m, flow.speed_mps, flow.X_udot_kg
    also, also_squared, source = "", "", "tail"
    if x_h:
        inputs += f", h = 1/2 rho A_p C_L' U {side_kgps:.4g} kg/s at x_h {x_h:.4g} m"
        also, also_squared, source = " - x_h h", " - x_h^2 h", "tail and hull"
    return [
        Derivation(
            "Y_r",
            "kg m/s",
            f"-x k{also} + X_udot U",
            f"{inputs}, X_udot {X_udot:.4g} kg",
            -k_x - x_h * side_kgps + X_udot * U,
            f"{source}, and axial added mass",
        ),
        Derivation(
            "N_r", "kg m2/s", f"-x^2 k{also_squared}", inputs, -k_xx - x_h**2 * side_kgps, source
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
"""Pitch coefficient, its yaw twin and their relative sign: the hull is a body of revolution, z up
and y to port."""


def pitch_twins(yaw: list[Derivation]) -> list[Derivation]:
    """The pitch plane of ``yaw``'s steps: the same, a quarter turn about x."""
    by_symbol = {step.symbol: step for step in yaw}
    return [
        _mirrored(name, by_symbol[twin], sign) for name, twin, sign in TWINS if twin in by_symbol
    ]


def _mirrored(name: str, twin: Derivation, sign: int) -> Derivation:
    formula = f"{'-' if sign < 0 else ''}{twin.symbol}"
    inputs = f"{twin.symbol} {twin.value:.4g}"
    return Derivation(name, twin.unit, formula, inputs, sign * twin.value, "symmetry of revolution")
