"""Table 1's initial column from first principles: each number with formula, inputs and source.

``python -m sitl.vehicle.first_principles`` prints the derivation beside the paper's table. Axes and
symbols are the paper's; ``slender_body`` has the equations.
"""

from __future__ import annotations

from math import exp, log, pi

from sitl.vehicle import duct, hull, slender_body
from sitl.vehicle.config import load
from sitl.vehicle.file_schema import DuctGeometry, VehicleConfig
from sitl.vehicle.slender_body import Derivation, Flow

HULL_LIFT_PER_RAD = 0.131
"""C_L' of the paper's body lift, on the rectangular planform l d, per radian."""
HULL_MOMENT_PER_RAD = 0.123
"""C_M' of the paper's combined Munk and lift moment, on l^2 d, per radian."""
SCHOENHERR_FRICTION = 0.0040
"""Leading coefficient of the paper's axial drag formula, dimensionless."""


def trace(config: VehicleConfig) -> list[Derivation]:
    """Return all steps from geometry to coefficients, compared with the file's ``linear`` table.

    Parameters
    ----------
    config : VehicleConfig
        A vehicle with a duct.

    Returns
    -------
    list of Derivation
        ``table`` holds the value of the vehicle file or of the paper, where there is one.

    Raises
    ------
    ValueError
        The vehicle has no duct.
    """
    ring = config.duct
    if ring is None:
        raise ValueError(f"{config.name}: has no duct; the paper's derivation is for a duct")
    added = slender_body.added_mass(config.hull, None, config.water.density_kgpm3)
    yaw = _yaw_plane(config, ring, X_udot=added[0].value)
    steps = [*_geometry(config), *added, *_duct(config, ring), *yaw, *slender_body.pitch_twins(yaw)]
    printed = {
        name.rpartition("_")[0]: getattr(config.linear, name)
        for name in config.linear.__struct_fields__
    }
    return [step._replace(table=printed.get(step.symbol, step.table)) for step in steps]


def _geometry(config: VehicleConfig) -> list[Derivation]:
    """Return mass, inertia and drag coefficient of the hull."""
    shape, rho = hull.integrals(config.hull), config.water.density_kgpm3
    mass, friction = rho * shape.volume_m3, _printed_drag_coefficient(config)
    T, U = config.operating_point.thrust_n, config.operating_point.speed_mps
    balance = T / (rho / 2 * shape.frontal_m2 * U**2)
    size = slender_body.size(config.hull)
    return [
        Derivation(
            symbol="m",
            unit="kg",
            formula="rho int pi R^2 dx",
            inputs=size,
            value=mass,
            source="Gertler profile with mid-body, of water's density",
            table=config.ballast.mass_kg,
        ),
        slender_body.yaw_inertia(config.hull, mass),
        Derivation(
            symbol="C_D",
            unit="-",
            formula="0.0040 pi A_p/A_f [1 + 60(d/l)^3 + 0.0025 l/d]",
            inputs=size,
            value=friction,
            source="Hydat, as printed; its printed value does not follow",
            table=0.023,
        ),
        Derivation(
            symbol="C_D balance",
            unit="-",
            formula="T / (1/2 rho A_f U^2)",
            inputs=f"T {T:.4g} N, U {U:.4g} m/s",
            value=balance,
            source="thrust balance; the model's drag",
        ),
    ]


def _duct(config: VehicleConfig, ring: DuctGeometry) -> list[Derivation]:
    """Return the lift slope of the ring as printed, with the paper's slip, and the lift."""
    aspect = f"AR {ring.aspect_ratio:.4g}"
    slope, slope_with_slip = (
        duct.ring_wing_lift_slope_per_rad(ring.aspect_ratio),
        _slipped_slope_per_rad(ring.aspect_ratio),
    )
    lift = slender_body.duct_tail(ring, 0.0, config.water.density_kgpm3).lift_kgpm
    area = f"rho {config.water.density_kgpm3:.4g} kg/m3, A_eff {ring.area_m2:.4g} m2"
    return [
        Derivation(
            symbol="dC_L/da",
            unit="1/rad",
            formula="2 pi r/(1 + 2/sAR + 16/(pi (sAR)^2) ln(1 + pi e^(-9/8) sAR))",
            inputs=aspect,
            value=slope,
            source="van Dyke's form, as printed",
            table=5.1,
        ),
        Derivation(
            symbol="dC_L/da slip",
            unit="1/rad",
            formula="the same with 16/(pi sAR)^2",
            inputs=aspect,
            value=slope_with_slip,
            source="behind the paper's 5.1 and 131; the model's",
            table=5.1,
        ),
        Derivation(
            symbol="duct lift",
            unit="kg/m",
            formula="1/2 rho A_eff dC_L/da",
            inputs=area,
            value=lift,
            source="times U^2 alpha",
            table=131.0,
        ),
    ]


def _yaw_plane(config: VehicleConfig, ring: DuctGeometry, X_udot: float) -> list[Derivation]:
    """Return the yaw plane with the paper's body coefficients, plus the slip that explains Y_v."""
    # Equations: ``slender_body``, with C_L' and C_M' of the paper and one tail, the duct (axes FLU,
    # SI units). Table 1's Y_v follows if the hull term is multiplied by U^2 a second time:
    #     Y_v = -k - h U^2,   h = 1/2 rho l d C_L' U   (kg/s; the dimension is then wrong).
    T, U, rho = (
        config.operating_point.thrust_n,
        config.operating_point.speed_mps,
        config.water.density_kgpm3,
    )
    length, diameter = hull.length_m(config.hull), config.hull.diameter_m
    steps = slender_body.yaw_plane(
        Flow(
            speed_mps=U,
            density_kgpm3=rho,
            length_m=length,
            diameter_m=diameter,
            X_udot_kg=X_udot,
            lift_per_rad=HULL_LIFT_PER_RAD,
            moment_per_rad=HULL_MOMENT_PER_RAD,
            lift_at_m=0.0,
            tails=(slender_body.duct_tail(ring, T, rho),),
            hull_source="the paper",
            moment_source="the paper; C_M' holds the Munk moment",
        )
    )
    side = rho / 2 * length * diameter * HULL_LIFT_PER_RAD * U
    y_v_index = [step.symbol for step in steps].index("Y_v")
    Y_v = steps[y_v_index]
    slip = Derivation(
        symbol="Y_v slip",
        unit="kg/s",
        formula="-k - 1/2 rho A_p C_L' U x U^2",
        inputs="the same",
        value=Y_v.value + side - side * U**2,
        source="hull term multiplied by U^2 a second time",
        table=config.linear.Y_v_kgps,
    )
    fitted = {
        "Y_dr": "duct and thrust; T is fitted to this row",
        "N_dr": f"x is fitted to this row; the hull ends at {-length / 2:.4g} m",
    }
    steps_with_sources = [
        step._replace(source=fitted.get(step.symbol, step.source)) for step in steps
    ]
    return [*steps_with_sources[: y_v_index + 1], slip, *steps_with_sources[y_v_index + 1 :]]


def _printed_drag_coefficient(config: VehicleConfig) -> float:
    """Return the paper's printed C_D on frontal area, with the rectangular planform A_p = l d."""
    slenderness = hull.length_m(config.hull) / config.hull.diameter_m
    planform_by_frontal = slenderness * 4 / pi
    return (
        SCHOENHERR_FRICTION
        * pi
        * planform_by_frontal
        * (1 + 60 / slenderness**3 + 0.0025 * slenderness)
    )


def _slipped_slope_per_rad(aspect_ratio: float) -> float:
    """Return the ring-wing lift slope with pi inside the square, per radian.

    This reproduces the paper's value of 5.1 and, in sea water, its lift of 131 U^2 alpha.
    """
    a = duct.ASPECT_SCALE * aspect_ratio
    return duct.SLOPE_SCALE_PER_RAD / (
        1 + 2 / a + 16 / (pi * a) ** 2 * log(1 + pi * exp(-9 / 8) * a)
    )


def report(config: VehicleConfig) -> str:
    """Return the derivation as a plain-text table, followed by remarks.

    Parameters
    ----------
    config : VehicleConfig
        A vehicle with a duct.

    Returns
    -------
    str
        One line per step, then the remarks.

    Raises
    ------
    ValueError
        The vehicle has no duct.
    """
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
    """Return one step as a line of the table."""
    table = "" if step.table is None else f"{step.table:.5g}"
    difference = "" if step.difference_pct is None else f"{step.difference_pct:+.1f}"
    value = f"{step.value:.5g}"
    return _line(
        step.symbol, value, table, difference, step.unit, step.formula, step.inputs, step.source
    )


def _line(*columns: str) -> str:
    """Return the eight columns of the table as one line."""
    symbol, value, table, difference, unit, formula, inputs, source = columns
    return (
        f"{symbol:13}{value:>9}{table:>7}{difference:>8}  {unit:8}{formula:64} {inputs:44} {source}"
    )


if __name__ == "__main__":
    print(report(load("caribou_nominal")))
