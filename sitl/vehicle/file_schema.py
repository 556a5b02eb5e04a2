"""The tables of a vehicle file. Keys carry their units; an unknown or impossible value is refused
by name.

Axes are body x forward, y port, z up, from the hull's axis at mid-length.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Literal

from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Negative = Annotated[float, Meta(lt=0)]
Fraction = Annotated[float, Meta(gt=0, lt=1)]
FullFraction = Annotated[float, Meta(gt=0, le=1)]


class VehicleFileError(ValueError):
    """A vehicle file that cannot be used; the message is one line naming file, key, value and what
    would be right."""


class VehicleTable(Struct, frozen=True, forbid_unknown_fields=True):
    """A TOML table whose every key is known."""


class WaterProperties(VehicleTable, frozen=True):
    density_kgpm3: Positive
    gravity_mps2: Positive


class HullShape(VehicleTable, frozen=True, tag_field="shape"):
    """What every hull has: a body of revolution, cut at its widest section for a cylindrical
    payload section."""


class Series58(HullShape, frozen=True, tag="series58"):
    """Series 58 body of revolution (Gertler 1950)."""

    base_length_m: Positive
    diameter_m: Positive
    midbody_length_m: NonNegative
    nose_radius: Positive
    tail_radius: NonNegative
    prismatic: Fraction
    max_section: Fraction


class Myring(HullShape, frozen=True, tag="myring"):
    """Myring (1976) body: rounded nose, cylinder, pointed tail; the offsets cut off the tips of
    nose and tail."""

    nose_length_m: Positive
    mid_length_m: NonNegative
    tail_length_m: Positive
    diameter_m: Positive
    nose_exponent: Annotated[float, Meta(ge=1)] = 2.0
    tail_angle_deg: Annotated[float, Meta(gt=0, lt=60)] = 25.0
    nose_offset_m: NonNegative = 0.0
    tail_offset_m: NonNegative = 0.0
    midbody_length_m: NonNegative = 0.0


class Cylinder(HullShape, frozen=True, tag="cylinder"):
    """Cylinder with half-ellipsoid caps; ``length_m`` is overall, a cap as long as the radius is a
    hemisphere."""

    length_m: Positive
    diameter_m: Positive
    nose_cap_m: NonNegative | None = None
    """Length of the cap; left out, a hemisphere; 0, flat."""
    tail_cap_m: NonNegative | None = None
    midbody_length_m: NonNegative = 0.0


class ProfileHull(HullShape, frozen=True, tag="profile"):
    """Radius over distance from the nose, straight between the points."""

    points_m: Annotated[tuple[tuple[NonNegative, NonNegative], ...], Meta(min_length=3)]
    """(distance from the nose, radius) in m, nose first."""
    midbody_length_m: NonNegative = 0.0

    @property
    def diameter_m(self) -> float:
        """At the widest point."""
        return 2 * max(radius for _, radius in self.points_m)


HullGeometry = Series58 | Myring | Cylinder | ProfileHull


class Ballast(VehicleTable, frozen=True):
    """Mass and where it sits; positions in FLU axes from mid-length."""

    mass_kg: Positive
    net_buoyancy_n: float
    x_cm_m: float
    y_cm_m: float
    x_cb_m: float
    z_cb_m: float


class OperatingPoint(VehicleTable, frozen=True):
    """Where ``linear`` holds."""

    speed_mps: Positive
    thrust_fraction: FullFraction
    thrust_n: Positive


class Coefficients(VehicleTable, frozen=True):
    """Linear model at the operating point in the paper's axes: Table 1's column, under its own
    symbols."""

    Y_v_kgps: float
    N_v_kgmps: float
    Y_r_kgmps: float
    N_r_kgm2ps: float
    Y_dr_nprad: float
    N_dr_nmprad: float
    Y_vdot_kg: Negative
    I_zz_kgm2: Positive
    N_rdot_kgm2: Negative
    Z_w_kgps: float
    M_w_kgmps: float
    Z_q_kgmps: float
    M_q_kgm2ps: float
    Z_de_nprad: float
    M_de_nmprad: float
    Z_wdot_kg: Negative
    I_yy_kgm2: Positive
    M_qdot_kgm2: Negative
    z_CM_m: float


class DuctGeometry(VehicleTable, frozen=True):
    x_m: Negative
    diameter_m: Positive
    chord_m: Positive
    lift_slope_per_rad: Positive
    lift_quadratic_per_rad2: NonNegative
    drag_zero_lift: NonNegative
    oswald: FullFraction
    stall_deg: Annotated[float, Meta(gt=0, lt=90)]
    separated_deg: Annotated[float, Meta(gt=0, lt=90)]
    separated_normal: NonNegative
    vectored: bool = True
    """Whether ring and thrust turn with the commands; a fixed nozzle does not."""

    @property
    def aspect_ratio(self) -> float:
        """Diameter over chord."""
        return self.diameter_m / self.chord_m

    @property
    def area_m2(self) -> float:
        """Effective area, diameter times chord (the paper's A_eff)."""
        return self.diameter_m * self.chord_m


class FinGeometry(VehicleTable, frozen=True):
    """Four equal all-moving fins at one station."""

    layout: Literal["cruciform", "x"]
    x_m: Negative
    """Of the quarter chord, which the fins turn about."""
    span_m: Positive
    """Of one fin, from hull to tip."""
    root_chord_m: Positive
    tip_chord_m: Positive
    hull_radius_m: NonNegative
    """Of the hull where the fins stand."""
    lift_slope_per_rad: Positive
    lift_quadratic_per_rad2: NonNegative
    drag_zero_lift: NonNegative
    oswald: FullFraction
    stall_deg: Annotated[float, Meta(gt=0, lt=90)]
    separated_deg: Annotated[float, Meta(gt=0, lt=90)]
    separated_normal: NonNegative

    @property
    def area_m2(self) -> float:
        """Planform of one fin."""
        return self.span_m * (self.root_chord_m + self.tip_chord_m) / 2

    @property
    def aspect_ratio(self) -> float:
        """Effective: the hull mirrors the fin and so doubles its span."""
        return 2 * self.span_m**2 / self.area_m2

    @property
    def command_gain(self) -> float:
        """Turn of the fins that steer a plane, over its command: a full command turns a fin to its
        full travel.

        Upright, two fins obey each command; diagonal, all four obey both, and their sum ends at the
        travel."""
        return 1.0 if self.layout == "cruciform" else sqrt(2.0)

    @property
    def tip_radius_m(self) -> float:
        """Distance of the tips from the axis."""
        return self.hull_radius_m + self.span_m

    @property
    def centre_radius_m(self) -> float:
        """Distance of a fin's centre of area from the axis."""
        taper = (self.root_chord_m + 2 * self.tip_chord_m) / (self.root_chord_m + self.tip_chord_m)
        return self.hull_radius_m + self.span_m * taper / 3


class PropellerCurve(VehicleTable, frozen=True):
    """K_T = kt_bollard - kt_slope J, with J on the inflow after the wake."""

    diameter_m: Positive
    kt_bollard: Positive
    kt_slope: Positive
    wake_fraction: Annotated[float, Meta(ge=0, lt=1)]


class Damping(VehicleTable, frozen=True):
    crossflow_cd: NonNegative
    roll_linear_nms: NonNegative
    roll_quadratic_nms2: NonNegative


class Tailcone(VehicleTable, frozen=True):
    """Actuator of the duct, alike in rudder and elevator but for the bias."""

    natural_frequency_radps: Positive
    damping_ratio: Positive
    delay_s: Annotated[float, Meta(ge=0, le=10)]
    travel_deg: Annotated[float, Meta(gt=0, lt=90)]
    rate_degps: Positive
    rudder_bias_deg: float
    elevator_bias_deg: float
    step_deg: NonNegative = 0.0
    """Of the duct for a step of the motor; 0 turns smoothly."""
    backlash_deg: NonNegative = 0.0
    """Play between motor and duct, from flank to flank."""
    lost_step_chance: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    """Of each step, while the motor turns faster than ``lost_step_above_degps``."""
    lost_step_above_degps: NonNegative = 0.0


class Power(VehicleTable, frozen=True):
    """What empties the battery."""

    hotel_w: NonNegative = 60.0
    """Computers, instruments and radio, whatever the propeller does; typical of a vehicle of this
    size."""
    drive_efficiency: FullFraction = 0.45
    """Thrust times speed over electric power at the operating point; typical of propeller, motor
    and drive together."""


class Instruments(VehicleTable, frozen=True):
    """What the vehicle carries of each kind: a name of the simulator's catalogue of data sheets, or
    "none"."""

    imu: str = "mti-300"
    magnetometer: str = "mti-300"
    pressure: str = "transmitter-10bar"
    gps: str = "neo-m8"
    dvl: str = "a50"
    altimeter: str = "echo-30m"
    battery: str = "lipo-1500wh"
    leak: str = "probe"
    encoder: str = "none"


class VehicleConfig(VehicleTable, frozen=True):
    """One vehicle, nothing left out. It steers by duct, by fins, or by both."""

    name: Annotated[str, Meta(min_length=1)]
    water: WaterProperties
    hull: HullGeometry
    ballast: Ballast
    operating_point: OperatingPoint
    linear: Coefficients
    propeller: PropellerCurve
    damping: Damping
    tailcone: Tailcone
    duct: DuctGeometry | None = None
    fins: FinGeometry | None = None
    effective: bool = False
    """The coefficients were identified as they act together, and need not each be possible by
    itself."""
    power: Power = Power()
    instruments: Instruments = Instruments()
