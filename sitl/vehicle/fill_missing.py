"""Derive the keys that a vehicle file omits from those that it gives.

Every derived number carries its formula, inputs and source. A key that the file gives is never
changed, so a measured value replaces the derived one. Axes: x forward, y port, z up, origin on the
hull axis at mid-length.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import pi, sqrt
from types import SimpleNamespace
from typing import Any, NamedTuple

from sitl.vehicle import duct, empirical, hull, slender_body
from sitl.vehicle.file_schema import (
    Coefficients,
    DuctGeometry,
    FinGeometry,
    HullGeometry,
)
from sitl.vehicle.slender_body import Derivation, Flow, Tail

Tables = dict[str, Any]

COEFFICIENT_KEYS = {name.rpartition("_")[0]: name for name in Coefficients.__struct_fields__}
"""Key in the ``linear`` table by symbol."""


class Completed(NamedTuple):
    """Tables of a vehicle file with all keys filled in."""

    tables: Tables
    """Tables as in the TOML file, all keys present."""
    steps: dict[tuple[str, str], Derivation]
    """Derivation of each key that the file omits, by (table, key)."""


class _Draft(NamedTuple):
    """Vehicle file during completion."""

    tables: Tables
    steps: dict[tuple[str, str], Derivation]
    hull: HullGeometry

    def fill(self, name: str, derived: Iterable[Derivation]) -> SimpleNamespace:
        """Add the missing keys of table ``name`` and return the table as a namespace."""
        table = self.tables.setdefault(name, {})
        for step in derived:
            if step.symbol not in table:
                table[step.symbol] = step.value
                self.steps[name, step.symbol] = step
        return SimpleNamespace(**table)


def complete(given: Tables, shape: HullGeometry) -> Completed:
    """Return the tables with all missing keys derived.

    ``given`` are validated tables of a vehicle file; ``shape`` is their hull.
    """
    tables = {
        name: dict(value) if isinstance(value, dict) else value for name, value in given.items()
    }
    draft = _Draft(tables, {}, shape)
    water = draft.fill("water", _water())
    ballast = _ballast(draft, water)
    ring = _duct(draft) if "duct" in tables else None
    fins = _fins(draft) if "fins" in tables else None
    point = _operating_point(draft, water, ring, fins)
    linear = _linear(draft, water, ballast, point, ring, fins)
    draft.fill("propeller", _propeller(shape, ring))
    draft.fill("damping", _damping(shape, water, ballast, linear))
    draft.fill("tailcone", _tailcone(ring, tables.get("tailcone", {})))
    return Completed(tables, draft.steps)


def _water() -> list[Derivation]:
    """Return density and gravity."""
    return [
        Derivation(
            symbol="density_kgpm3",
            unit="kg/m3",
            formula="1025",
            inputs="",
            value=1025.0,
            source="sea water",
        ),
        Derivation(
            symbol="gravity_mps2",
            unit="m/s2",
            formula="9.80665",
            inputs="",
            value=9.80665,
            source="standard",
        ),
    ]


NET_BUOYANCY = 0.005
"""Net buoyancy over displacement, enough to surface without propulsion.

Caribou has 22 N or 0.35 %, a REMUS 100 has 3.3 N or 1.1 %."""


def _ballast(draft: _Draft, water: Any) -> SimpleNamespace:
    """Return the ballast: mass from displacement and net buoyancy, or net buoyancy from mass."""
    hull_integrals, size = hull.integrals(draft.hull), slender_body.size(draft.hull)
    displaced, given = (
        water.density_kgpm3 * hull_integrals.volume_m3,
        draft.tables.get("ballast", {}),
    )
    g = water.gravity_mps2
    net = (
        Derivation(
            symbol="net_buoyancy_n",
            unit="N",
            formula="g (rho int pi R^2 dx - m)",
            inputs=f"{size}, m {given['mass_kg']:.4g} kg",
            value=g * (displaced - given["mass_kg"]),
            source="Archimedes",
        )
        if "mass_kg" in given
        else Derivation(
            symbol="net_buoyancy_n",
            unit="N",
            formula="0.005 rho g V",
            inputs=size,
            value=NET_BUOYANCY * displaced * g,
            source="assumed: enough to surface by itself",
        )
    )
    ballast = draft.fill("ballast", [net])
    return draft.fill(
        "ballast",
        [
            Derivation(
                symbol="mass_kg",
                unit="kg",
                formula="rho int pi R^2 dx - B_net/g",
                inputs=f"{size}, B_net {ballast.net_buoyancy_n:.4g} N",
                value=displaced - ballast.net_buoyancy_n / g,
                source="Archimedes, water inside the hull counted",
            ),
            *_centres(given, hull_integrals.centroid_m, size),
        ],
    )


def _centres(given: Tables, centroid_m: float, size: str) -> list[Derivation]:
    """Return the centres of buoyancy and mass; the default is level trim."""
    x_cb = given.get("x_cb_m", centroid_m)
    return [
        Derivation(
            symbol="x_cb_m",
            unit="m",
            formula="int pi R^2 x dx / V",
            inputs=size,
            value=centroid_m,
            source="centroid of the hull",
        ),
        Derivation(
            symbol="z_cb_m",
            unit="m",
            formula="0",
            inputs="",
            value=0.0,
            source="on the axis: a body of revolution",
        ),
        Derivation(
            symbol="x_cm_m",
            unit="m",
            formula="x_cb",
            inputs=f"x_cb {x_cb:.4g} m",
            value=x_cb,
            source="ballasted level",
        ),
        Derivation(symbol="y_cm_m", unit="m", formula="0", inputs="", value=0.0, source="symmetry"),
    ]


STALL = (
    Derivation(
        symbol="stall_deg",
        unit="deg",
        formula="20",
        inputs="",
        value=20.0,
        source="assumed; low aspect ratios stall late (Whicker and Fehlner 1958)",
    ),
    Derivation(
        symbol="separated_deg", unit="deg", formula="30", inputs="", value=30.0, source="assumed"
    ),
)


def _duct(draft: _Draft) -> DuctGeometry:
    """Fill the table ``duct`` from diameter and chord."""
    tail_m = -hull.length_m(draft.hull) / 2
    given = draft.tables["duct"]
    aspect = given["diameter_m"] / given["chord_m"]
    slope = duct.ring_wing_lift_slope_per_rad(aspect)
    draft.fill(
        "duct",
        [
            Derivation(
                symbol="x_m",
                unit="m",
                formula="-l/2",
                inputs=slender_body.size(draft.hull),
                value=tail_m,
                source="tail end of the hull",
            ),
            Derivation(
                symbol="lift_slope_per_rad",
                unit="1/rad",
                formula="2 pi r/(1 + 2/sAR + 16/(pi (sAR)^2) ln(1 + pi e^(-9/8) sAR))",
                inputs=f"AR {aspect:.4g}",
                value=slope,
                source="ring wing, van Dyke's form (the paper)",
            ),
            Derivation(
                symbol="lift_quadratic_per_rad2",
                unit="1/rad2",
                formula="0.81",
                inputs="",
                value=0.81,
                source="C_Dc of the paper's ring",
            ),
            Derivation(
                symbol="drag_zero_lift",
                unit="-",
                formula="0.010",
                inputs="",
                value=0.010,
                source="C_do of the paper's ring",
            ),
            Derivation(
                symbol="oswald",
                unit="-",
                formula="0.90",
                inputs="",
                value=0.90,
                source="e of the paper's ring",
            ),
            *STALL,
            Derivation(
                symbol="separated_normal",
                unit="-",
                formula="1.8",
                inputs="",
                value=1.8,
                source="assumed: two walls broadside, each 0.9 (Hoerner 1965, ch. 3)",
            ),
        ],
    )
    return DuctGeometry(**draft.tables["duct"])


FINS_AT = 0.08
"""Distance of the fins' quarter chord forward of the tail end, in hull lengths.

It is 0.05 for a REMUS 100 and 0.09 for SUBOFF."""


def _fins(draft: _Draft) -> FinGeometry:
    """Fill the table ``fins`` from span and root chord."""
    given, length = draft.tables["fins"], hull.length_m(draft.hull)
    fins = draft.fill(
        "fins",
        [
            Derivation(
                symbol="x_m",
                unit="m",
                formula="0.08 l - l/2",
                inputs=slender_body.size(draft.hull),
                value=(FINS_AT - 0.5) * length,
                source="assumed place",
            ),
            Derivation(
                symbol="tip_chord_m",
                unit="m",
                formula="root chord",
                inputs="",
                value=given["root_chord_m"],
                source="assumed untapered",
            ),
        ],
    )
    radius = float(hull.radius_m(draft.hull, fins.x_m))
    draft.fill(
        "fins",
        [
            Derivation(
                symbol="hull_radius_m",
                unit="m",
                formula="R(x)",
                inputs=f"x {fins.x_m:.4g} m",
                value=radius,
                source="profile of the hull",
            )
        ],
    )
    aspect = 4 * fins.span_m / (fins.root_chord_m + fins.tip_chord_m)
    inputs = f"AR_e {aspect:.4g}, twice the fin's: the hull mirrors it"
    draft.fill(
        "fins",
        [
            Derivation(
                symbol="lift_slope_per_rad",
                unit="1/rad",
                formula="0.9 2 pi AR_e/(sqrt(AR_e^2 + 4) + 1.8)",
                inputs=inputs,
                value=empirical.fin_lift_slope_per_rad(aspect),
                source="Whicker and Fehlner 1958; downwash of the hull left out",
            ),
            Derivation(
                symbol="lift_quadratic_per_rad2",
                unit="1/rad2",
                formula="0.8/AR_e",
                inputs=inputs,
                value=empirical.fin_crossflow_per_rad2(aspect),
                source="Whicker and Fehlner 1958, squared tips",
            ),
            Derivation(
                symbol="drag_zero_lift",
                unit="-",
                formula="0.010",
                inputs="",
                value=0.010,
                source="assumed: NACA 0012 to 0015 has 0.0065 smooth",
            ),
            Derivation(
                symbol="oswald",
                unit="-",
                formula="0.90",
                inputs="",
                value=0.90,
                source="Whicker and Fehlner 1958",
            ),
            *STALL,
            Derivation(
                symbol="separated_normal",
                unit="-",
                formula="1.2",
                inputs="",
                value=1.2,
                source="flat plate broadside (Hoerner 1965, ch. 3)",
            ),
        ],
    )
    return FinGeometry(**draft.tables["fins"])


def _operating_point(
    draft: _Draft, water: Any, ring: DuctGeometry | None, fins: FinGeometry | None
) -> SimpleNamespace:
    """Fill the operating point; thrust equals the drag of hull and tail."""
    # T = 1/2 rho U^2 (ROUGHNESS C_f form S + sum C_do A): S wetted area, C_f ITTC 1957 line, form
    # factor of Hoerner 1965.
    point = draft.fill(
        "operating_point",
        [
            Derivation(
                symbol="speed_mps",
                unit="m/s",
                formula="1.5",
                inputs="",
                value=1.5,
                source="assumed cruise",
            ),
            Derivation(
                symbol="thrust_fraction",
                unit="-",
                formula="0.6",
                inputs="",
                value=0.6,
                source="assumed: top speed is about 1.6 times cruise",
            ),
        ],
    )
    length, hull_integrals = hull.length_m(draft.hull), hull.integrals(draft.hull)
    pressure, wetted = water.density_kgpm3 / 2 * point.speed_mps**2, pi * hull_integrals.planform_m2
    friction = empirical.friction_coefficient(point.speed_mps, length)
    form = empirical.form_factor(length / draft.hull.diameter_m)
    tail = sum(
        wing.drag_zero_lift * wing.area_m2 * n
        for wing, n in ((ring, 1), (fins, 4))
        if wing is not None
    )
    inputs = (
        f"S {wetted:.4g} m2, C_f {friction:.4g}, form {form:.4g}, C_D A {tail:.3g} m2, U"
        f" {point.speed_mps} m/s"
    )
    return draft.fill(
        "operating_point",
        [
            Derivation(
                symbol="thrust_n",
                unit="N",
                formula="1/2 rho U^2 (2 C_f form S + C_D A)",
                inputs=inputs,
                value=pressure * (empirical.ROUGHNESS * friction * form * wetted + tail),
                source=(
                    "ITTC 1957 line, Hoerner 1965 form factor; twice for holes, joints and"
                    " instruments"
                ),
            ),
        ],
    )


CM_BELOW = 0.05
"""Centre of mass below the centre of buoyancy, in diameters; Caribou 0.04, REMUS 100 0.10."""


def _linear(
    draft: _Draft,
    water: Any,
    ballast: Any,
    point: Any,
    ring: DuctGeometry | None,
    fins: FinGeometry | None,
) -> SimpleNamespace:
    """Fill Table 1's column; the pitch plane is the yaw plane rotated about x."""
    shape, rho = draft.hull, water.density_kgpm3
    length, diameter = hull.length_m(shape), shape.diameter_m
    X_udot, Y_vdot, N_rdot = slender_body.added_mass(shape, fins, rho)
    flow = Flow(
        speed_mps=point.speed_mps,
        density_kgpm3=rho,
        length_m=length,
        diameter_m=diameter,
        X_udot_kg=X_udot.value,
        lift_per_rad=empirical.hull_lift_slope_per_rad(),
        moment_per_rad=slender_body.hull_moment_per_rad(
            length, diameter, rho, X_udot.value - Y_vdot.value
        ),
        lift_at_m=empirical.HULL_LIFT_AT * length,
        tails=_tails(ring, fins, point.thrust_n, rho),
        hull_source="Hoerner and Borst 1975, ch. 19",
        moment_source="Munk moment, and hull lift at 0.65 l from the nose",
    )
    yaw = [
        *slender_body.yaw_plane(flow),
        Y_vdot,
        slender_body.yaw_inertia(shape, ballast.mass_kg),
        N_rdot,
    ]
    z_cm = Derivation(
        symbol="z_CM",
        unit="m",
        formula="z_cb - 0.05 d",
        inputs=f"d {diameter:.4g} m",
        value=ballast.z_cb_m - CM_BELOW * diameter,
        source="assumed",
    )
    steps = {step.symbol: step for step in [*yaw, *slender_body.pitch_twins(yaw), z_cm]}
    return draft.fill(
        "linear", [steps[symbol]._replace(symbol=key) for symbol, key in COEFFICIENT_KEYS.items()]
    )


def _tails(
    ring: DuctGeometry | None, fins: FinGeometry | None, thrust_n: float, density_kgpm3: float
) -> tuple[Tail, ...]:
    """Return the ring, if there is one, and the fins, if there are any."""
    rings = (slender_body.duct_tail(ring, thrust_n, density_kgpm3),) if ring is not None else ()
    return (*rings, slender_body.fin_tail(fins, density_kgpm3)) if fins is not None else rings


def _propeller(shape: HullGeometry, ring: DuctGeometry | None) -> list[Derivation]:
    """Return diameter, thrust coefficients and wake fraction of a ducted or open propeller."""
    wake = Derivation(
        symbol="wake_fraction",
        unit="-",
        formula="0.20",
        inputs="",
        value=0.20,
        source="assumed, slender body of revolution",
    )
    if ring is not None:
        return [
            Derivation(
                symbol="diameter_m",
                unit="m",
                formula="0.92 duct diameter",
                inputs="",
                value=0.92 * ring.diameter_m,
                source="fits the duct",
            ),
            Derivation(
                symbol="kt_bollard",
                unit="-",
                formula="0.50",
                inputs="",
                value=0.50,
                source="assumed, about Ka 4-70 in nozzle 19A (Oosterveld 1970)",
            ),
            Derivation(
                symbol="kt_slope",
                unit="-",
                formula="0.55",
                inputs="",
                value=0.55,
                source="as above: no thrust at J of about 0.9",
            ),
            wake,
        ]
    return [
        Derivation(
            symbol="diameter_m",
            unit="m",
            formula="0.7 d",
            inputs=slender_body.size(shape),
            value=0.7 * shape.diameter_m,
            source="assumed, behind a slender tail",
        ),
        Derivation(
            symbol="kt_bollard",
            unit="-",
            formula="0.40",
            inputs="",
            value=0.40,
            source="assumed, about B 3-50 of pitch ratio 0.9 (Oosterveld 1975)",
        ),
        Derivation(
            symbol="kt_slope",
            unit="-",
            formula="0.42",
            inputs="",
            value=0.42,
            source="as above: no thrust at J of about 0.95",
        ),
        wake,
    ]


ROLL_DAMPING = 0.1
"""Roll damping ratio at rest, without the part of the fins that increases with speed."""


def _damping(shape: HullGeometry, water: Any, ballast: Any, linear: Any) -> list[Derivation]:
    """Return crossflow drag and roll damping."""
    # Roll: I_xx phi'' + K_p phi' + m g BG phi = 0, so K_p = 2 zeta sqrt(I_xx m g BG) with
    # zeta = ROLL_DAMPING and BG the height of the centre of buoyancy over the centre of mass.
    hull_integrals = hull.integrals(shape)
    below = max(0.0, ballast.z_cb_m - linear.z_CM_m)
    I_xx = ballast.mass_kg * hull_integrals.roll_inertia_m5 / hull_integrals.volume_m3
    roll = 2 * ROLL_DAMPING * sqrt(I_xx * ballast.mass_kg * water.gravity_mps2 * below)
    inputs = f"I_xx {I_xx:.4g} kg m2, BG {below:.4g} m"
    return [
        Derivation(
            symbol="crossflow_cd",
            unit="-",
            formula="1.1",
            inputs="",
            value=1.1,
            source="circular cylinder below the drag crisis (Hoerner 1965, ch. 3)",
        ),
        Derivation(
            symbol="roll_linear_nms",
            unit="N m s",
            formula="0.1 2 sqrt(I_xx m g BG)",
            inputs=inputs,
            value=roll,
            source="assumed: a tenth of critical",
        ),
        Derivation(
            symbol="roll_quadratic_nms2",
            unit="N m s2",
            formula="K_p 0.5 s",
            inputs=inputs,
            value=roll / 2,
            source="assumed, small",
        ),
    ]


ASSUMED_LAG_SD = 0.3
"""Relative standard deviation of an assumed lag of the tailcone: servos differ by a factor of two.
"""


def _tailcone(ring: DuctGeometry | None, given: Mapping[str, Any]) -> list[Derivation]:
    """Return the actuators: Caribou's steppers for a vectored duct, geared servos for fins."""
    if ring is not None and ring.vectored:
        values, source = (3.0, 0.6, 0.3, 15.0, 15.0), "as Caribou's"
    else:
        values, source = (8.0, 0.8, 0.1, 15.0, 30.0), "assumed, a geared servo"
    keys = ("natural_frequency_radps", "damping_ratio", "delay_s", "travel_deg", "rate_degps")
    units = ("rad/s", "-", "s", "deg", "deg/s")
    biases = [
        Derivation(
            symbol=f"{name}_bias_deg",
            unit="deg",
            formula="0",
            inputs="",
            value=0.0,
            source="none known",
        )
        for name in ("rudder", "elevator")
    ]
    rows = zip(keys, units, values, strict=True)
    is_lag_assumed = not {"natural_frequency_radps", "damping_ratio"} & given.keys()
    uncertainty = Derivation(
        symbol="lag_relative_sd",
        unit="-",
        formula=f"{ASSUMED_LAG_SD:g}",
        inputs="",
        value=ASSUMED_LAG_SD,
        source="of frequency and damping, which are assumed",
    )
    return [
        *(
            Derivation(
                symbol=key, unit=unit, formula=f"{value:g}", inputs="", value=value, source=source
            )
            for key, unit, value in rows
        ),
        *biases,
        *([uncertainty] if is_lag_assumed else []),
    ]
