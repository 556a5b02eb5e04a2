"""Table 1's initial column from first principles, each number with its formula, inputs and source.

``python -m sitl.vehicle.derive`` prints the trace beside the table.
"""

from __future__ import annotations

from math import exp, log, pi
from typing import NamedTuple

from sitl.vehicle import calibrate, duct, hull
from sitl.vehicle.config import VehicleConfig, load

HULL_LIFT_PER_RAD = 0.131
"""C_L' of the paper's body lift, on the rectangular planform l d."""
HULL_MOMENT_PER_RAD = 0.123
"""C_M' of the paper's combined Munk and lift moment."""
SCHOENHERR_FRICTION = 0.0040
"""Leading coefficient of the paper's axial drag formula."""


class Step(NamedTuple):
    """One derived quantity."""

    symbol: str
    unit: str
    formula: str
    inputs: str
    value: float
    table: float | None
    """What Table 1 or the paper's text prints; None where it prints nothing."""
    source: str

    @property
    def difference_pct(self) -> float | None:
        """Derived less printed, in percent of the printed value."""
        return None if self.table is None else 100 * (self.value - self.table) / abs(self.table)


def trace(config: VehicleConfig) -> list[Step]:
    """Every step from geometry to coefficients for a vehicle whose ``linear`` table is the column to compare with."""
    return [*_geometry(config), *_added_mass(config), *_duct(config), *_yaw_plane(config), *_pitch_plane(config)]


def _geometry(config: VehicleConfig) -> list[Step]:
    shape, rho = hull.integrals(config.hull), config.water.density_kgpm3
    mass, inertia = rho * shape.volume_m3, rho * shape.pitch_inertia_m5
    friction = _printed_drag_coefficient(config)
    T, U = config.operating_point.thrust_n, config.operating_point.speed_mps
    balance = T / (rho / 2 * shape.frontal_m2 * U**2)
    size = _size(config)
    return [
        Step("m", "kg", "rho int pi R^2 dx", size, mass, config.ballast.mass_kg,
             "Gertler profile with mid-body, of water's density"),
        Step("I_zz", "kg m2", "rho int (pi R^2 x^2 + pi R^4/4) dx", size, inertia, config.linear.I_zz_kgm2,
             "homogeneous hull"),
        Step("C_D", "-", "0.0040 pi A_p/A_f [1 + 60(d/l)^3 + 0.0025 l/d]", size, friction, 0.023,
             "Hydat, as printed; its printed value does not follow"),
        Step("C_D balance", "-", "T / (1/2 rho A_f U^2)", f"T {T:.4g} N, U {U:.4g} m/s", balance, None,
             "thrust balance; the model's drag"),
    ]  # fmt: skip


def _added_mass(config: VehicleConfig) -> list[Step]:
    shape, rho = hull.integrals(config.hull), config.water.density_kgpm3
    column, size = config.linear, _size(config)
    X_udot, Y_vdot = -calibrate.axial_added_mass_kg(config), -rho * shape.volume_m3
    N_rdot = -rho * shape.section_moment_m5
    return [
        Step("X_udot", "kg", "-k_1 rho pi/6 l d^2", size, X_udot, None, "spheroid, Lamb 1932 sec. 114"),
        Step("Y_vdot", "kg", "-rho int pi R^2 dx", size, Y_vdot, column.Y_vdot_kg, "strips, Newman 1977"),
        Step("N_rdot", "kg m2", "-rho int pi R^2 x^2 dx", size, N_rdot, column.N_rdot_kgm2, "strips, Newman 1977"),
    ]


def _duct(config: VehicleConfig) -> list[Step]:
    aspect = f"AR {config.duct.aspect_ratio:.4g}"
    slope = duct.ring_wing_lift_slope_per_rad(config.duct.aspect_ratio)
    slipped = _slipped_slope_per_rad(config.duct.aspect_ratio)
    area = f"rho {config.water.density_kgpm3:.4g} kg/m3, A_eff {config.duct.area_m2:.4g} m2"
    return [
        Step("dC_L/da", "1/rad", "2 pi r/(1 + 2/sAR + 16/(pi (sAR)^2) ln(1 + pi e^(-9/8) sAR))", aspect, slope, 5.1,
             "van Dyke's form, as printed"),
        Step("dC_L/da slip", "1/rad", "the same with 16/(pi sAR)^2", aspect, slipped, 5.1,
             "behind the paper's 5.1 and 131; the model's"),
        Step("duct lift", "kg/m", "1/2 rho A_eff dC_L/da", area, _duct_lift_kgpm(config), 131.0, "times U^2 alpha"),
    ]  # fmt: skip


def _yaw_plane(config: VehicleConfig) -> list[Step]:
    column, T, U, x = config.linear, config.operating_point.thrust_n, config.operating_point.speed_mps, config.duct.x_m
    length = hull.length_m(config.hull)
    planform = length * config.hull.diameter_m
    pressure = config.water.density_kgpm3 / 2 * planform * U
    k, X_udot = _duct_lift_kgpm(config) * U, -calibrate.axial_added_mass_kg(config)
    side, moment = pressure * HULL_LIFT_PER_RAD, pressure * length * HULL_MOMENT_PER_RAD
    tail, body = f"k {k:.4g} kg/s, x {x:.5g} m", f"A_p {planform:.4g} m2, U {U:.4g} m/s"
    return [
        Step("Y_dr", "N/rad", "k U + T, k = duct lift x U", f"{tail}, T {T:.4g} N", k * U + T, column.Y_dr_nprad,
             "duct and thrust; T is fitted to this row"),
        Step("N_dr", "N m/rad", "x Y_dr", tail, x * (k * U + T), column.N_dr_nmprad,
             f"x is fitted to this row; the hull ends at {-length / 2:.4g} m"),
        Step("Y_v", "kg/s", "-k - 1/2 rho A_p C_L' U", f"{body}, C_L' {HULL_LIFT_PER_RAD}", -k - side, column.Y_v_kgps,
             "hull and duct"),
        Step("Y_v slip", "kg/s", "-k - 1/2 rho A_p C_L' U x U^2", "the same", -k - side * U**2, column.Y_v_kgps,
             "hull term multiplied by U^2 a second time"),
        Step("N_v", "kg m/s", "-x k - 1/2 rho A_p l C_M' U", f"{body}, C_M' {HULL_MOMENT_PER_RAD}", -x * k - moment,
             column.N_v_kgmps, "hull and duct; C_M' holds the Munk moment"),
        Step("Y_r", "kg m/s", "-x k + X_udot U", f"{tail}, X_udot {X_udot:.4g} kg", -x * k + X_udot * U,
             column.Y_r_kgmps, "duct and axial added mass"),
        Step("N_r", "kg m2/s", "-x^2 k", tail, -(x**2) * k, column.N_r_kgm2ps, "duct"),
    ]  # fmt: skip


PITCH_TWINS = (
    ("Z_w", "Y_v", 1), ("M_w", "N_v", -1), ("Z_q", "Y_r", -1), ("M_q", "N_r", 1),
    ("Z_de", "Y_dr", -1), ("M_de", "N_dr", 1),
)  # fmt: skip
"""Pitch coefficient, its yaw twin and their relative sign: the hull is a body of revolution, z up and y to port."""


def _pitch_plane(config: VehicleConfig) -> list[Step]:
    yaw = {step.symbol: step for step in _yaw_plane(config)}
    column = config.linear
    printed = {
        "Z_w": column.Z_w_kgps, "M_w": column.M_w_kgmps, "Z_q": column.Z_q_kgmps, "M_q": column.M_q_kgm2ps,
        "Z_de": column.Z_de_nprad, "M_de": column.M_de_nmprad,
    }  # fmt: skip
    return [_mirrored(name, yaw[twin], sign, printed[name]) for name, twin, sign in PITCH_TWINS]


def _mirrored(name: str, twin: Step, sign: int, printed: float) -> Step:
    formula = f"{'-' if sign < 0 else ''}{twin.symbol}"
    inputs = f"{twin.symbol} {twin.value:.4g}"
    return Step(name, twin.unit, formula, inputs, sign * twin.value, printed, "symmetry of revolution")


def _size(config: VehicleConfig) -> str:
    return f"l {hull.length_m(config.hull):.4g} m, d {config.hull.diameter_m:.4g} m"


def _duct_lift_kgpm(config: VehicleConfig) -> float:
    return config.water.density_kgpm3 / 2 * config.duct.area_m2 * config.duct.lift_slope_per_rad


def _printed_drag_coefficient(config: VehicleConfig) -> float:
    """On frontal area, with the rectangular planform A_p = l d."""
    slenderness = hull.length_m(config.hull) / config.hull.diameter_m
    planform_by_frontal = slenderness * 4 / pi
    return SCHOENHERR_FRICTION * pi * planform_by_frontal * (1 + 60 / slenderness**3 + 0.0025 * slenderness)


def _slipped_slope_per_rad(aspect_ratio: float) -> float:
    """The ring-wing slope with pi inside the square: the paper's own 5.1, and with sea water exactly its 131."""
    a = duct.ASPECT_SCALE * aspect_ratio
    return duct.SLOPE_SCALE_PER_RAD / (1 + 2 / a + 16 / (pi * a) ** 2 * log(1 + pi * exp(-9 / 8) * a))


def report(config: VehicleConfig) -> str:
    """The trace as a plain-text table, then what stands out."""
    steps = trace(config)
    Y_v, slip = (next(step for step in steps if step.symbol == symbol) for symbol in ("Y_v", "Y_v slip"))
    header = _line("", "derived", "table", "diff %", "unit", "formula", "inputs", "source")
    return f"""{header}
{chr(10).join(_row(step) for step in steps)}

Y_v: the formula gives {Y_v.value:.0f}, {Y_v.difference_pct:.0f} % off the table's {Y_v.table:.0f}. With the hull term \
multiplied by U^2 a second time it gives {slip.value:.0f}: the table applies U^2 twice.
The paper's controllers were designed on the table, so the vehicle is calibrated to the table."""


def _row(step: Step) -> str:
    table = "" if step.table is None else f"{step.table:.5g}"
    difference = "" if step.difference_pct is None else f"{step.difference_pct:+.1f}"
    value = f"{step.value:.5g}"
    return _line(step.symbol, value, table, difference, step.unit, step.formula, step.inputs, step.source)


def _line(*columns: str) -> str:
    symbol, value, table, difference, unit, formula, inputs, source = columns
    return f"{symbol:13}{value:>9}{table:>7}{difference:>8}  {unit:8}{formula:64} {inputs:44} {source}"


if __name__ == "__main__":
    print(report(load("bench")))
