"""What a vehicle file leaves out, derived from what it gives: every number with its formula, inputs
and source.

A key that the file gives is never touched, so each may be replaced by a better one from a tank or
from the sea."""

from __future__ import annotations

from collections.abc import Iterable
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
"""Key in the ``linear`` table by the symbol."""


class Completed(NamedTuple):
    """A vehicle file with nothing left out."""

    tables: Tables
    steps: dict[tuple[str, str], Derivation]
    """What was derived, by table and key."""


class _Draft(NamedTuple):
    """A vehicle on its way to being complete."""

    tables: Tables
    steps: dict[tuple[str, str], Derivation]
    hull: HullGeometry

    def fill(self, name: str, derived: Iterable[Derivation]) -> SimpleNamespace:
        """The table ``name`` after the steps that it needs; each step may use those before it."""
        table = self.tables.setdefault(name, {})
        for step in derived:
            if step.symbol not in table:
                table[step.symbol] = step.value
                self.steps[name, step.symbol] = step
        return SimpleNamespace(**table)


def complete(given: Tables, shape: HullGeometry) -> Completed:
    """``given`` with every missing number filled in; the tables come checked, ``shape`` is their
    hull."""
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
    draft.fill("tailcone", _tailcone(ring))
    return Completed(tables, draft.steps)


def _water() -> list[Derivation]:
    return [
        Derivation("density_kgpm3", "kg/m3", "1025", "", 1025.0, "sea water"),
        Derivation("gravity_mps2", "m/s2", "9.80665", "", 9.80665, "standard"),
    ]


NET_BUOYANCY = 0.005
"""Of the displacement: enough to come up by itself. Caribou's 22 N is 0.35 %, a REMUS 100's 3.3 N
is 1.1 %."""


def _ballast(draft: _Draft, water: Any) -> SimpleNamespace:
    """Mass from displacement and net buoyancy, or net buoyancy from the mass."""
    whole, size = hull.integrals(draft.hull), slender_body.size(draft.hull)
    displaced, given = water.density_kgpm3 * whole.volume_m3, draft.tables.get("ballast", {})
    g = water.gravity_mps2
    net = (
        Derivation(
            "net_buoyancy_n",
            "N",
            "g (rho int pi R^2 dx - m)",
            f"{size}, m {given['mass_kg']:.4g} kg",
            g * (displaced - given["mass_kg"]),
            "Archimedes",
        )
        if "mass_kg" in given
        else Derivation(
            "net_buoyancy_n",
            "N",
            "0.005 rho g V",
            size,
            NET_BUOYANCY * displaced * g,
            "assumed: enough to surface by itself",
        )
    )
    ballast = draft.fill("ballast", [net])
    return draft.fill(
        "ballast",
        [
            Derivation(
                "mass_kg",
                "kg",
                "rho int pi R^2 dx - B_net/g",
                f"{size}, B_net {ballast.net_buoyancy_n:.4g} N",
                displaced - ballast.net_buoyancy_n / g,
                "Archimedes, water inside the hull counted",
            ),
            *_centres(given, whole.centroid_m, size),
        ],
    )


def _centres(given: Tables, centroid_m: float, size: str) -> list[Derivation]:
    x_cb = given.get("x_cb_m", centroid_m)
    return [
        Derivation("x_cb_m", "m", "int pi R^2 x dx / V", size, centroid_m, "centroid of the hull"),
        Derivation("z_cb_m", "m", "0", "", 0.0, "on the axis: a body of revolution"),
        Derivation("x_cm_m", "m", "x_cb", f"x_cb {x_cb:.4g} m", x_cb, "ballasted level"),
        Derivation("y_cm_m", "m", "0", "", 0.0, "symmetry"),
    ]


STALL = (
    Derivation(
        "stall_deg",
        "deg",
        "20",
        "",
        20.0,
        "assumed; low aspect ratios stall late (Whicker and Fehlner 1958)",
    ),
    Derivation("separated_deg", "deg", "30", "", 30.0, "assumed"),
)


def _duct(draft: _Draft) -> DuctGeometry:
    tail_m = -hull.length_m(draft.hull) / 2
    given = draft.tables["duct"]
    aspect = given["diameter_m"] / given["chord_m"]
    slope = duct.ring_wing_lift_slope_per_rad(aspect)
    draft.fill(
        "duct",
        [
            Derivation(
                "x_m", "m", "-l/2", slender_body.size(draft.hull), tail_m, "tail end of the hull"
            ),
            Derivation(
                "lift_slope_per_rad",
                "1/rad",
                "2 pi r/(1 + 2/sAR + 16/(pi (sAR)^2) ln(1 + pi e^(-9/8) sAR))",
                f"AR {aspect:.4g}",
                slope,
                "ring wing, van Dyke's form (the paper)",
            ),
            Derivation(
                "lift_quadratic_per_rad2", "1/rad2", "0.81", "", 0.81, "C_Dc of the paper's ring"
            ),
            Derivation("drag_zero_lift", "-", "0.010", "", 0.010, "C_do of the paper's ring"),
            Derivation("oswald", "-", "0.90", "", 0.90, "e of the paper's ring"),
            *STALL,
            Derivation(
                "separated_normal",
                "-",
                "1.8",
                "",
                1.8,
                "assumed: two walls broadside, each 0.9 (Hoerner 1965, ch. 3)",
            ),
        ],
    )
    return DuctGeometry(**draft.tables["duct"])


FINS_AT = 0.08
"""Quarter chord forward of the tail end, in hull lengths; a REMUS 100's stand at 0.05, SUBOFF's at
0.09."""


def _fins(draft: _Draft) -> FinGeometry:
    given, length = draft.tables["fins"], hull.length_m(draft.hull)
    fins = draft.fill(
        "fins",
        [
            Derivation(
                "x_m",
                "m",
                "0.08 l - l/2",
                slender_body.size(draft.hull),
                (FINS_AT - 0.5) * length,
                "assumed place",
            ),
            Derivation(
                "tip_chord_m", "m", "root chord", "", given["root_chord_m"], "assumed untapered"
            ),
        ],
    )
    radius = float(hull.radius_m(draft.hull, fins.x_m))
    draft.fill(
        "fins",
        [
            Derivation(
                "hull_radius_m", "m", "R(x)", f"x {fins.x_m:.4g} m", radius, "profile of the hull"
            )
        ],
    )
    aspect = 4 * fins.span_m / (fins.root_chord_m + fins.tip_chord_m)
    inputs = f"AR_e {aspect:.4g}, twice the fin's: the hull mirrors it"
    draft.fill(
        "fins",
        [
            Derivation(
                "lift_slope_per_rad",
                "1/rad",
                "0.9 2 pi AR_e/(sqrt(AR_e^2 + 4) + 1.8)",
                inputs,
                empirical.fin_lift_slope_per_rad(aspect),
                "Whicker and Fehlner 1958; downwash of the hull left out",
            ),
            Derivation(
                "lift_quadratic_per_rad2",
                "1/rad2",
                "0.8/AR_e",
                inputs,
                empirical.fin_crossflow_per_rad2(aspect),
                "Whicker and Fehlner 1958, squared tips",
            ),
            Derivation(
                "drag_zero_lift",
                "-",
                "0.010",
                "",
                0.010,
                "assumed: NACA 0012 to 0015 has 0.0065 smooth",
            ),
            Derivation("oswald", "-", "0.90", "", 0.90, "Whicker and Fehlner 1958"),
            *STALL,
            Derivation(
                "separated_normal",
                "-",
                "1.2",
                "",
                1.2,
                "flat plate broadside (Hoerner 1965, ch. 3)",
            ),
        ],
    )
    return FinGeometry(**draft.tables["fins"])


def _operating_point(
    draft: _Draft, water: Any, ring: DuctGeometry | None, fins: FinGeometry | None
) -> SimpleNamespace:
    """Thrust is drag: friction of the hull with form and roughness, and the tail's own."""
    point = draft.fill(
        "operating_point",
        [
            Derivation("speed_mps", "m/s", "1.5", "", 1.5, "assumed cruise"),
            Derivation(
                "thrust_fraction",
                "-",
                "0.6",
                "",
                0.6,
                "assumed: top speed is about 1.6 times cruise",
            ),
        ],
    )
    length, whole = hull.length_m(draft.hull), hull.integrals(draft.hull)
    pressure, wetted = water.density_kgpm3 / 2 * point.speed_mps**2, pi * whole.planform_m2
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
                "thrust_n",
                "N",
                "1/2 rho U^2 (2 C_f form S + C_D A)",
                inputs,
                pressure * (empirical.ROUGHNESS * friction * form * wetted + tail),
                "ITTC 1957 line, Hoerner 1965 form factor; twice for holes, joints and instruments",
            ),
        ],
    )


CM_BELOW = 0.05
"""Centre of mass below the axis, in diameters; Caribou's 0.04, a REMUS 100's 0.10."""


def _linear(
    draft: _Draft,
    water: Any,
    ballast: Any,
    point: Any,
    ring: DuctGeometry | None,
    fins: FinGeometry | None,
) -> SimpleNamespace:
    """Table 1's column: added mass, inertia, hull and tail, and the pitch plane as the yaw plane
    turned."""
    shape, rho = draft.hull, water.density_kgpm3
    length, diameter = hull.length_m(shape), shape.diameter_m
    X_udot, Y_vdot, N_rdot = slender_body.added_mass(shape, fins, rho)
    flow = Flow(
        point.speed_mps,
        rho,
        length,
        diameter,
        X_udot.value,
        empirical.hull_lift_slope_per_rad(),
        slender_body.hull_moment_per_rad(length, diameter, rho, X_udot.value - Y_vdot.value),
        empirical.HULL_LIFT_AT * length,
        _tails(ring, fins, point.thrust_n, rho),
        "Hoerner and Borst 1975, ch. 19",
        "Munk moment, and hull lift at 0.65 l from the nose",
    )
    yaw = [
        *slender_body.yaw_plane(flow),
        Y_vdot,
        slender_body.yaw_inertia(shape, ballast.mass_kg),
        N_rdot,
    ]
    z_cm = Derivation(
        "z_CM",
        "m",
        "z_cb - 0.05 d",
        f"d {diameter:.4g} m",
        ballast.z_cb_m - CM_BELOW * diameter,
        "assumed",
    )
    steps = {step.symbol: step for step in [*yaw, *slender_body.pitch_twins(yaw), z_cm]}
    return draft.fill(
        "linear", [steps[symbol]._replace(symbol=key) for symbol, key in COEFFICIENT_KEYS.items()]
    )


def _tails(
    ring: DuctGeometry | None, fins: FinGeometry | None, thrust_n: float, density_kgpm3: float
) -> tuple[Tail, ...]:
    rings = (slender_body.duct_tail(ring, thrust_n, density_kgpm3),) if ring is not None else ()
    return (*rings, slender_body.fin_tail(fins, density_kgpm3)) if fins is not None else rings


def _propeller(shape: HullGeometry, ring: DuctGeometry | None) -> list[Derivation]:
    wake = Derivation("wake_fraction", "-", "0.20", "", 0.20, "assumed, slender body of revolution")
    if ring is not None:
        return [
            Derivation(
                "diameter_m", "m", "0.92 duct diameter", "", 0.92 * ring.diameter_m, "fits the duct"
            ),
            Derivation(
                "kt_bollard",
                "-",
                "0.50",
                "",
                0.50,
                "assumed, about Ka 4-70 in nozzle 19A (Oosterveld 1970)",
            ),
            Derivation("kt_slope", "-", "0.55", "", 0.55, "as above: no thrust at J of about 0.9"),
            wake,
        ]
    return [
        Derivation(
            "diameter_m",
            "m",
            "0.7 d",
            slender_body.size(shape),
            0.7 * shape.diameter_m,
            "assumed, behind a slender tail",
        ),
        Derivation(
            "kt_bollard",
            "-",
            "0.40",
            "",
            0.40,
            "assumed, about B 3-50 of pitch ratio 0.9 (Oosterveld 1975)",
        ),
        Derivation("kt_slope", "-", "0.42", "", 0.42, "as above: no thrust at J of about 0.95"),
        wake,
    ]


ROLL_DAMPING = 0.1
"""Of critical, at rest; what fins add with speed comes on top."""


def _damping(shape: HullGeometry, water: Any, ballast: Any, linear: Any) -> list[Derivation]:
    whole = hull.integrals(shape)
    below = max(0.0, ballast.z_cb_m - linear.z_CM_m)
    I_xx = ballast.mass_kg * whole.roll_inertia_m5 / whole.volume_m3
    roll = 2 * ROLL_DAMPING * sqrt(I_xx * ballast.mass_kg * water.gravity_mps2 * below)
    inputs = f"I_xx {I_xx:.4g} kg m2, BG {below:.4g} m"
    return [
        Derivation(
            "crossflow_cd",
            "-",
            "1.1",
            "",
            1.1,
            "circular cylinder below the drag crisis (Hoerner 1965, ch. 3)",
        ),
        Derivation(
            "roll_linear_nms",
            "N m s",
            "0.1 2 sqrt(I_xx m g BG)",
            inputs,
            roll,
            "assumed: a tenth of critical",
        ),
        Derivation(
            "roll_quadratic_nms2", "N m s2", "K_p 0.5 s", inputs, roll / 2, "assumed, small"
        ),
    ]


def _tailcone(ring: DuctGeometry | None) -> list[Derivation]:
    """Caribou's stepper motors where a duct is turned, common servos where fins are."""
    if ring is not None and ring.vectored:
        values, source = (3.0, 0.6, 0.3, 15.0, 15.0), "as Caribou's"
    else:
        values, source = (8.0, 0.8, 0.1, 15.0, 30.0), "assumed, a geared servo"
    keys = ("natural_frequency_radps", "damping_ratio", "delay_s", "travel_deg", "rate_degps")
    units = ("rad/s", "-", "s", "deg", "deg/s")
    biases = [
        Derivation(f"{name}_bias_deg", "deg", "0", "", 0.0, "none known")
        for name in ("rudder", "elevator")
    ]
    rows = zip(keys, units, values, strict=True)
    return [
        *(Derivation(key, unit, f"{value:g}", "", value, source) for key, unit, value in rows),
        *biases,
    ]
