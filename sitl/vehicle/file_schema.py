"""Tables of a vehicle file. Keys carry their units; errors name the unknown or impossible value.

Axes are body x forward, y port, z up, with the origin on the hull axis at mid-length.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any, Literal, get_args

from msgspec import UNSET, Meta, Struct, UnsetType, defstruct
from msgspec.structs import fields

from mavlink_io.errors import ErrorCode, InputError

# The upper bounds are far beyond any vehicle of this kind: they find a wrong unit.
Length = Annotated[float, Meta(gt=0.0, le=30.0)]
"""Length of a hull, a duct or a fin (m)."""
LengthOrZero = Annotated[float, Meta(ge=0.0, le=30.0)]
"""Length that may be zero (m)."""
Position = Annotated[float, Meta(ge=-30.0, le=30.0)]
"""Coordinate in body axes (m)."""
Aft = Annotated[float, Meta(ge=-30.0, lt=0.0)]
"""Position aft of mid-length (m)."""
Mass = Annotated[float, Meta(gt=0.0, le=1e6)]
"""Mass (kg)."""
Force = Annotated[float, Meta(gt=0.0, le=1e6)]
"""Force (N)."""
Speed = Annotated[float, Meta(gt=0.0, le=15.0)]
"""Speed through the water (m/s)."""
Coefficient = Annotated[float, Meta(ge=-1e9, le=1e9)]
"""Coefficient of the linear model, SI units."""
PositiveCoefficient = Annotated[float, Meta(gt=0.0, le=1e9)]
NegativeCoefficient = Annotated[float, Meta(ge=-1e9, lt=0.0)]
Ratio = Annotated[float, Meta(ge=0.0, le=100.0)]
"""Dimensionless coefficient of lift, drag or shape that may be zero."""
PositiveRatio = Annotated[float, Meta(gt=0.0, le=100.0)]
RollDamping = Annotated[float, Meta(ge=0.0, le=1e6)]
"""Roll damping, SI units."""
Angle = Annotated[float, Meta(ge=0.0, le=90.0)]
"""Angle of a surface (deg)."""
Bias = Annotated[float, Meta(ge=-45.0, le=45.0)]
"""Angle of a surface at zero command (deg)."""
Fraction = Annotated[float, Meta(gt=0.0, lt=1.0)]
FullFraction = Annotated[float, Meta(gt=0.0, le=1.0)]


class VehicleFileError(InputError):
    """Invalid vehicle file; the message is one line with file, key, value and what is expected."""

    code = ErrorCode.VEHICLE_FILE


class VehicleTable(Struct, frozen=True, forbid_unknown_fields=True):
    """TOML table that accepts only known keys."""


class WaterProperties(VehicleTable, frozen=True):
    """Water in which the vehicle was ballasted."""

    density_kgpm3: Annotated[float, Meta(ge=900.0, le=1100.0)]
    gravity_mps2: Annotated[float, Meta(ge=9.0, le=10.0)]


class HullShape(VehicleTable, frozen=True, tag_field="shape"):
    """Body of revolution, with an optional cylindrical payload section at its widest section."""


class Series58(HullShape, frozen=True, tag="series58"):
    """Series 58 body of revolution (Gertler 1950)."""

    base_length_m: Length
    """Length without the parallel mid-body."""
    diameter_m: Length
    midbody_length_m: LengthOrZero
    nose_radius: PositiveRatio
    """Nose radius times l/D^2, dimensionless."""
    tail_radius: Ratio
    """Tail radius times l/D^2, dimensionless."""
    prismatic: Fraction
    """Prismatic coefficient: volume over that of the enclosing cylinder."""
    max_section: Fraction
    """Position of the largest section, as a fraction of the base length from the nose."""


class Myring(HullShape, frozen=True, tag="myring"):
    """Myring (1976) body: rounded nose, cylinder, pointed tail.

    The offsets cut off the tips of nose and tail.
    """

    nose_length_m: Length
    mid_length_m: LengthOrZero
    tail_length_m: Length
    diameter_m: Length
    nose_exponent: Annotated[float, Meta(ge=1.0, le=100.0)] = 2.0
    tail_angle_deg: Annotated[float, Meta(gt=0.0, lt=60.0)] = 25.0
    nose_offset_m: LengthOrZero = 0.0
    tail_offset_m: LengthOrZero = 0.0
    midbody_length_m: LengthOrZero = 0.0


class Cylinder(HullShape, frozen=True, tag="cylinder"):
    """Cylinder with half-ellipsoid caps; a cap as long as the radius is a hemisphere."""

    length_m: Length
    """Overall length with caps."""
    diameter_m: Length
    nose_cap_m: LengthOrZero | None = None
    """Length of the nose cap; default is a hemisphere, 0 is flat."""
    tail_cap_m: LengthOrZero | None = None
    """Length of the tail cap; default is a hemisphere, 0 is flat."""
    midbody_length_m: LengthOrZero = 0.0


class ProfileHull(HullShape, frozen=True, tag="profile"):
    """Hull given by points of its profile, with straight lines between the points."""

    points_m: Annotated[tuple[tuple[LengthOrZero, LengthOrZero], ...], Meta(min_length=3)]
    """(distance from the nose, radius) in m, nose first."""
    midbody_length_m: LengthOrZero = 0.0

    @property
    def diameter_m(self) -> float:
        """Return the diameter at the widest point, m."""
        return 2 * max(radius for _, radius in self.points_m)


HullGeometry = Series58 | Myring | Cylinder | ProfileHull


class Ballast(VehicleTable, frozen=True):
    """Mass, net buoyancy and their centres; positions in FLU axes from mid-length.

    ``cm`` is the centre of mass, ``cb`` the centre of buoyancy; z of ``cm`` is ``linear.z_CM_m``.
    """

    mass_kg: Mass
    net_buoyancy_n: Annotated[float, Meta(ge=-1e6, le=1e6)]
    """Buoyancy minus weight, positive upwards."""
    x_cm_m: Position
    y_cm_m: Position
    x_cb_m: Position
    z_cb_m: Position


class OperatingPoint(VehicleTable, frozen=True):
    """Steady motion at which the ``linear`` table is valid."""

    speed_mps: Speed
    thrust_fraction: FullFraction
    """Thrust command, 0 to 1."""
    thrust_n: Force
    """Thrust, which equals the drag."""


class Coefficients(VehicleTable, frozen=True):
    """Linear model at the operating point: Table 1's column with its symbols, in the paper's axes.

    ``linearise`` has the equations. ``dr`` and ``de`` are rudder and elevator angle.
    """

    Y_v_kgps: Coefficient
    N_v_kgmps: Coefficient
    Y_r_kgmps: Coefficient
    N_r_kgm2ps: Coefficient
    Y_dr_nprad: Coefficient
    N_dr_nmprad: Coefficient
    Y_vdot_kg: NegativeCoefficient
    I_zz_kgm2: PositiveCoefficient
    N_rdot_kgm2: NegativeCoefficient
    Z_w_kgps: Coefficient
    M_w_kgmps: Coefficient
    Z_q_kgmps: Coefficient
    M_q_kgm2ps: Coefficient
    Z_de_nprad: Coefficient
    M_de_nmprad: Coefficient
    Z_wdot_kg: NegativeCoefficient
    I_yy_kgm2: PositiveCoefficient
    M_qdot_kgm2: NegativeCoefficient
    z_CM_m: Position


class DuctGeometry(VehicleTable, frozen=True):
    """Ring duct at the tail; ``wing`` has the equations of lift and drag."""

    x_m: Aft
    """Position forward of mid-length."""
    diameter_m: Length
    chord_m: Length
    lift_slope_per_rad: PositiveRatio
    lift_quadratic_per_rad2: Ratio
    drag_zero_lift: Ratio
    oswald: FullFraction
    stall_deg: Annotated[float, Meta(gt=0.0, lt=90.0)]
    separated_deg: Annotated[float, Meta(gt=0.0, lt=90.0)]
    separated_normal: Ratio
    vectored: bool = True
    """True if ring and thrust turn with the commands, false for a fixed nozzle."""

    @property
    def aspect_ratio(self) -> float:
        """Return diameter over chord."""
        return self.diameter_m / self.chord_m

    @property
    def area_m2(self) -> float:
        """Return the effective area, diameter times chord (the paper's A_eff), m2."""
        return self.diameter_m * self.chord_m


class FinGeometry(VehicleTable, frozen=True):
    """Four equal all-moving fins at one station."""

    layout: Literal["cruciform", "x"]
    x_m: Aft
    """Position of the quarter chord, about which the fins turn, forward of mid-length."""
    span_m: Length
    """Span of one fin, from hull to tip."""
    root_chord_m: Length
    tip_chord_m: Length
    hull_radius_m: LengthOrZero
    """Radius of the hull at the fins."""
    lift_slope_per_rad: PositiveRatio
    lift_quadratic_per_rad2: Ratio
    drag_zero_lift: Ratio
    oswald: FullFraction
    stall_deg: Annotated[float, Meta(gt=0.0, lt=90.0)]
    separated_deg: Annotated[float, Meta(gt=0.0, lt=90.0)]
    separated_normal: Ratio

    @property
    def area_m2(self) -> float:
        """Return the planform area of one fin, m2."""
        return self.span_m * (self.root_chord_m + self.tip_chord_m) / 2

    @property
    def aspect_ratio(self) -> float:
        """Return the effective aspect ratio, with twice the span: the hull mirrors the fin."""
        return 2 * self.span_m**2 / self.area_m2

    @property
    def command_gain(self) -> float:
        """Return the fin angle per rudder or elevator angle.

        In the cruciform layout two fins follow each command. In the X layout all four fins follow
        both commands, and the sum is limited to the travel.
        """
        return 1.0 if self.layout == "cruciform" else sqrt(2.0)

    @property
    def tip_radius_m(self) -> float:
        """Return the distance of the tips from the hull axis, m."""
        return self.hull_radius_m + self.span_m

    @property
    def centre_radius_m(self) -> float:
        """Return the distance of a fin's centre of area from the hull axis, m."""
        taper = (self.root_chord_m + 2 * self.tip_chord_m) / (self.root_chord_m + self.tip_chord_m)
        return self.hull_radius_m + self.span_m * taper / 3


class PropellerCurve(VehicleTable, frozen=True):
    """Thrust coefficient K_T = kt_bollard - kt_slope J, with J from the inflow behind the hull."""

    diameter_m: Length
    kt_bollard: PositiveRatio
    kt_slope: PositiveRatio
    wake_fraction: Annotated[float, Meta(ge=0.0, lt=1.0)]


class Damping(VehicleTable, frozen=True):
    """Crossflow drag and roll damping."""

    crossflow_cd: Ratio
    """Drag coefficient of a hull section in crossflow, on its diameter."""
    roll_linear_nms: RollDamping
    roll_quadratic_nms2: RollDamping


class Tailcone(VehicleTable, frozen=True):
    """Actuator of rudder and elevator; both are equal except for the bias."""

    natural_frequency_radps: Annotated[float, Meta(gt=0.0, le=1e4)]
    damping_ratio: PositiveRatio
    delay_s: Annotated[float, Meta(ge=0.0, le=10.0)]
    travel_deg: Annotated[float, Meta(ge=1.0, le=45.0)]
    """Largest angle; the range is that of the autopilot's ACT_TRAVEL_DEG."""
    rate_degps: Annotated[float, Meta(gt=0.0, le=1e5)]
    rudder_bias_deg: Bias
    elevator_bias_deg: Bias
    step_deg: Angle = 0.0
    """Duct angle per motor step; 0 is continuous."""
    backlash_deg: Angle = 0.0
    """Backlash between motor and duct, full width."""
    lost_step_chance: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.0
    """Probability that a motor step is lost at a rate above ``lost_step_above_degps``."""
    lost_step_above_degps: Annotated[float, Meta(ge=0.0, le=1e5)] = 0.0
    """Duct rate above which motor steps can be lost."""
    lag_relative_sd: Annotated[float, Meta(ge=0.001, le=1.0)] = 0.05
    """Relative standard deviation of natural frequency and damping; 0.05 as by a bench test."""


class Power(VehicleTable, frozen=True):
    """Consumers of the battery."""

    hotel_w: Annotated[float, Meta(ge=0.0, le=1e6)] = 60.0
    """Constant power of computers, instruments and radio; typical of a vehicle of this size."""
    drive_efficiency: FullFraction = 0.45
    """Thrust times speed over electric power at the operating point; a typical value."""


class Instruments(VehicleTable, frozen=True):
    """Installed instrument of each kind: a name from the simulator's catalogue, or "none"."""

    imu: str = "mti-300"
    magnetometer: str = "mti-300"
    pressure: str = "transmitter-10bar"
    gps: str = "neo-m8"
    dvl: str = "a50"
    altimeter: str = "echo-30m"
    battery: str = "lipo-1500wh"
    leak: str = "probe"
    encoder: str = "none"


class DropWeight(VehicleTable, frozen=True):
    """Weight that output 4 of the autopilot releases once; part of ``ballast.mass_kg`` before."""

    mass_kg: Mass
    x_m: Position = 0.0
    """Position forward of mid-length, as y to port and z up."""
    y_m: Position = 0.0
    z_m: Position = 0.0


class VehicleConfig(VehicleTable, frozen=True):
    """Complete vehicle file. The vehicle steers by duct, by fins, or by both."""

    name: Annotated[str, Meta(min_length=1)]
    water: WaterProperties
    hull: HullGeometry
    """Shape of the hull; key ``shape`` names it."""
    ballast: Ballast
    operating_point: OperatingPoint
    linear: Coefficients
    propeller: PropellerCurve
    damping: Damping
    tailcone: Tailcone
    duct: DuctGeometry | None = None
    fins: FinGeometry | None = None
    effective: bool = False
    """True if the coefficients were identified together and need not be physical one by one."""
    power: Power = Power()
    instruments: Instruments = Instruments()
    drop_weight: DropWeight | None = None
    """None if none is fitted."""


_GEOMETRY: dict[type[VehicleTable], tuple[str, ...]] = {
    VehicleConfig: ("name", "hull"),
    DuctGeometry: ("diameter_m", "chord_m"),
    FinGeometry: ("layout", "span_m", "root_chord_m"),
}
"""Keys that cannot be derived, by table; a vehicle file may omit all others."""


def _with_optional_keys(kind: type[VehicleTable]) -> Any:
    """Return table type ``kind`` with all keys optional except those of ``_GEOMETRY``."""
    needed = _GEOMETRY.get(kind, ())
    keys = [
        (field.name, field.type)
        if field.name in needed
        else (field.name, _optional(field.type), UNSET)
        for field in fields(kind)
    ]
    return defstruct(kind.__name__, keys, frozen=True, forbid_unknown_fields=True, kw_only=True)


def _optional(annotation: Any) -> Any:
    """Return the type of an optional key; a table inside has optional keys too."""
    kinds = (annotation, *get_args(annotation))
    tables = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, VehicleTable)]
    return (_with_optional_keys(tables[0]) if tables else annotation) | UnsetType


Description = _with_optional_keys(VehicleConfig)
"""Vehicle file as a user writes it: the same tables with most keys optional."""
