"""Table 1's initial column from first principles, each number with its formula, inputs and source.

``python -m sitl.vehicle.derive`` prints the trace beside the table.
"""

from __future__ import annotations

from math import exp, log, pi

from sitl.vehicle import duct, hull, slender_body
from sitl.vehicle.config import load
from sitl.vehicle.file_schema import DuctGeometry, VehicleConfig
from sitl.vehicle.slender_body import Derivation, Flow

HULL_LIFT_PER_RAD = 0.131
"""C_L' of the paper's body lift, on the rectangular planform l d."""
HULL_MOMENT_PER_RAD = 0.123
"""C_M' of the paper's combined Munk and lift moment."""
SCHOENHERR_FRICTION = 0.0040
"""Leading coefficient of the paper's axial drag formula."""


def trace(config: VehicleConfig) -> list[Derivation]:
    """Every step from geometry to coefficients for a ducted vehicle whose ``linear`` table is to be
    compared with."""
    ring = config.duct
    if ring is None:
        raise ValueError(f"{config.name}: has no duct; the paper's derivation is of one")
    added = slender_body.added_mass(config.hull, None, config.water.density_kgpm3)
    yaw = _yaw_plane(config, ring, X_udot=added[0].value)
    steps = [*_geometry(config), *added, *_duct(config, ring), *yaw, *slender_body.pitch_twins(yaw)]
    printed = {
        name.rpartition("_")[0]: getattr(config.linear, name)
        for name in config.linear.__struct_fields__
    }
    return [step._replace(table=printed.get(step.symbol, step.table)) for step in steps]


def _geometry(config: VehicleConfig) -> list[Derivation]:
    shape, rho = hull.integrals(config.hull), config.water.density_kgpm3
    mass, friction = rho * shape.volume_m3, _printed_drag_coefficient(config)
    T, U = config.operating_point.thrust_n, config.operating_point.speed_mps
    balance = T / (rho / 2 * shape.frontal_m2 * U**2)
    size = slender_body.size(config.hull)
    return [
        Derivation(
            "m",
            "kg",
            "rho int pi R^2 dx",
            size,
            mass,
            "Gertler profile with mid-body, of water's density",
            config.ballast.mass_kg,
        ),
        slender_body.yaw_inertia(config.hull, mass),
        Derivation(
            "C_D",
            "-",
            "0.0040 pi A_p/A_f [1 + 60(d/l)^3 + 0.0025 l/d]",
            size,
            friction,
            "Hydat, as printed; its printed value does not follow",
            0.023,
        ),
        Derivation(
            "C_D balance",
            "-",
            "T / (1/2 rho A_f U^2)",
            f"T {T:.4g} N, U {U:.4g} m/s",
            balance,
            "thrust balance; the model's drag",
        ),
    ]


def _duct(config: VehicleConfig, ring: DuctGeometry) -> list[Derivation]:
    aspect = f"AR {ring.aspect_ratio:.4g}"
    slope, slipped = (
        duct.ring_wing_lift_slope_per_rad(ring.aspect_ratio),
        _slipped_slope_per_rad(ring.aspect_ratio),
    )
    lift = slender_body.duct_tail(ring, 0.0, config.water.density_kgpm3).lift_kgpm
    area = f"rho {config.water.density_kgpm3:.4g} kg/m3, A_eff {ring.area_m2:.4g} m2"
    return [
        Derivation(
            "dC_L/da",
            "1/rad",
            "2 pi r/(1 + 2/sAR + 16/(pi (sAR)^2) ln(1 + pi e^(-9/8) sAR))",
            aspect,
            slope,
            "van Dyke's form, as printed",
            5.1,
        ),
        Derivation(
            "dC_L/da slip",
            "1/rad",
            "the same with 16/(pi sAR)^2",
            aspect,
            slipped,
            "behind the paper's 5.1 and 131; the model's",
            5.1,
        ),
        Derivation(
            "duct lift", "kg/m", "1/2 rho A_eff dC_L/da", area, lift, "times U^2 alpha", 131.0
        ),
    ]


def _yaw_plane(config: VehicleConfig, ring: DuctGeometry, X_udot: float) -> list[Derivation]:
    """With the paper's own body coefficients, and the slip that explains the table's Y_v."""
    T, U, rho = (
        config.operating_point.thrust_n,
        config.operating_point.speed_mps,
        config.water.density_kgpm3,
    )
    length, diameter = hull.length_m(config.hull), config.hull.diameter_m
    steps = slender_body.yaw_plane(
        Flow(
            U,
            rho,
            length,
            diameter,
            X_udot,
            HULL_LIFT_PER_RAD,
            HULL_MOMENT_PER_RAD,
            0.0,
            (slender_body.duct_tail(ring, T, rho),),
            "the paper",
            "the paper; C_M' holds the Munk moment",
        )
    )
    side = rho / 2 * length * diameter * HULL_LIFT_PER_RAD * U
    at = [step.symbol for step in steps].index("Y_v")
    Y_v = steps[at]
    slip = Derivation(
        "Y_v slip",
        "kg/s",
        "-k - 1/2 rho A_p C_L' U x U^2",
        "the same",
        Y_v.value + side - side * U**2,
        "hull term multiplied by U^2 a second time",
        config.linear.Y_v_kgps,
    )
    fitted = {
        "Y_dr": "duct and thrust; T is fitted to this row",
        "N_dr": f"x is fitted to this row; the hull ends at {-length / 2:.4g} m",
    }
    named = [step._replace(source=fitted.get(step.symbol, step.source)) for step in steps]
    return [*named[: at + 1], slip, *named[at + 1 :]]


def _printed_drag_coefficient(config: VehicleConfig) -> float:
    """On frontal area, with the rectangular planform A_p = l d."""
    slenderness = hull.length_m(config.hull) / config.hull.diameter_m
    planform_by_frontal = slenderness * 4 / pi
    return (
        SCHOENHERR_FRICTION
        * pi
        * planform_by_frontal
        * (1 + 60 / slenderness**3 + 0.0025 * slenderness)
    )


def _slipped_slope_per_rad(aspect_ratio: float) -> float:
    """The ring-wing slope with pi inside the square: the paper's own 5.1, and with sea water
    exactly its 131."""
    a = duct.ASPECT_SCALE * aspect_ratio
    return duct.SLOPE_SCALE_PER_RAD / (
        1 + 2 / a + 16 / (pi * a) ** 2 * log(1 + pi * exp(-9 / 8) * a)
    )


def report(config: VehicleConfig) -> str:
    """The trace as a plain-text table, then what stands out."""
    steps = trace(config)
    Y_v, slip = (
        next(step for step in steps if step.symbol == symbol) for symbol in ("Y_v", "Y_v slip")
    )
    header = _line("", "derived", "table", "diff %", "unit", "formula", "inputs", "source")
    return f"""{header}
{chr(10).join(_row(step) for step in steps)}

Y_v: the formula gives {Y_v.value:.0f}, {Y_v.difference_pct:.0f} % off the table's \
{Y_v.table:.0f}. With the hull term multiplied by U^2 a \
second time it gives {slip.value:.0f}: the table applies U^2 twice.
The paper's controllers were designed on the table, so the vehicle is calibrated to the table."""


def _row(step: Derivation) -> str:
    table = "" if step.table is None else f"{step.table:.5g}"
    difference = "" if step.difference_pct is None else f"{step.difference_pct:+.1f}"
    value = f"{step.value:.5g}"
    return _line(
        step.symbol, value, table, difference, step.unit, step.formula, step.inputs, step.source
    )


def _line(*columns: str) -> str:
    symbol, value, table, difference, unit, formula, inputs, source = columns
    return (
        f"{symbol:13}{value:>9}{table:>7}{difference:>8}  {unit:8}{formula:64} {inputs:44} {source}"
    )


if __name__ == "__main__":
    print(report(load("caribou_nominal")))
