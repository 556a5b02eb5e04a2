"""Vehicle files: TOML, strictly decoded. Keys carry their units; an unknown or impossible value is refused by name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from sitl.vehicle import strict_toml

SHIPPED = ("bench", "field")
"""Vehicles that need no path."""

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Negative = Annotated[float, Meta(lt=0)]
Fraction = Annotated[float, Meta(gt=0, lt=1)]
FullFraction = Annotated[float, Meta(gt=0, le=1)]


class VehicleError(ValueError):
    """A vehicle file that cannot be used; the message is one line naming file, key, value and what would be right."""


class Table(Struct, frozen=True, forbid_unknown_fields=True):
    """A TOML table whose every key is known."""


class Water(Table, frozen=True):
    density_kgpm3: Positive
    gravity_mps2: Positive


class HullGeometry(Table, frozen=True):
    """Series 58 body of revolution, cut at its maximum section for a cylindrical mid-body."""

    base_length_m: Positive
    diameter_m: Positive
    midbody_length_m: NonNegative
    nose_radius: Positive
    tail_radius: NonNegative
    prismatic: Fraction
    max_section: Fraction


class Ballast(Table, frozen=True):
    """Mass and where it sits; positions in FLU axes from mid-length."""

    mass_kg: Positive
    net_buoyancy_n: float
    x_cm_m: float
    y_cm_m: float
    x_cb_m: float
    z_cb_m: float


class OperatingPoint(Table, frozen=True):
    """Where ``linear`` holds."""

    speed_mps: Positive
    thrust_fraction: FullFraction
    thrust_n: Positive


class Coefficients(Table, frozen=True):
    """Linear model at the operating point in the paper's axes: Table 1's column, under its own symbols."""

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


class DuctGeometry(Table, frozen=True):
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

    @property
    def aspect_ratio(self) -> float:
        """Diameter over chord."""
        return self.diameter_m / self.chord_m

    @property
    def area_m2(self) -> float:
        """Effective area, diameter times chord (the paper's A_eff)."""
        return self.diameter_m * self.chord_m


class PropellerCurve(Table, frozen=True):
    """K_T = kt_bollard - kt_slope J, with J on the inflow after the wake."""

    diameter_m: Positive
    kt_bollard: Positive
    kt_slope: Positive
    wake_fraction: Annotated[float, Meta(ge=0, lt=1)]


class Damping(Table, frozen=True):
    crossflow_cd: NonNegative
    roll_linear_nms: NonNegative
    roll_quadratic_nms2: NonNegative


class Tailcone(Table, frozen=True):
    """Actuator of the duct, alike in rudder and elevator but for the bias."""

    natural_frequency_radps: Positive
    damping_ratio: Positive
    delay_s: NonNegative
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


class Power(Table, frozen=True):
    """What empties the battery."""

    hotel_w: NonNegative = 60.0
    """Computers, instruments and radio, whatever the propeller does; typical of a vehicle of this size."""
    drive_efficiency: FullFraction = 0.45
    """Thrust times speed over electric power at the operating point; typical of propeller, motor and drive together."""


class Instruments(Table, frozen=True):
    """What the vehicle carries of each kind: a name of the simulator's catalogue of data sheets, or "none"."""

    imu: str = "mti-300"
    magnetometer: str = "mti-300"
    pressure: str = "transmitter-10bar"
    gps: str = "neo-m8"
    dvl: str = "a50"
    altimeter: str = "echo-30m"
    battery: str = "lipo-1500wh"
    leak: str = "probe"
    encoder: str = "none"


class VehicleConfig(Table, frozen=True):
    """One vehicle file."""

    name: Annotated[str, Meta(min_length=1)]
    water: Water
    hull: HullGeometry
    ballast: Ballast
    operating_point: OperatingPoint
    linear: Coefficients
    duct: DuctGeometry
    propeller: PropellerCurve
    damping: Damping
    tailcone: Tailcone
    power: Power = Power()
    instruments: Instruments = Instruments()


def load(name_or_path: str | Path) -> VehicleConfig:
    """Read a shipped vehicle by name, or a vehicle file by path.

    Raises ``VehicleError`` for a missing file, bad TOML, an unknown or missing key, or a value out of range.
    """
    path = Path(__file__).with_name(f"{name_or_path}.toml") if name_or_path in SHIPPED else Path(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise VehicleError(f"{path}: cannot be read ({reason}); give {' or '.join(SHIPPED)}, or a TOML file") from None
    return parse(text, path.name if name_or_path in SHIPPED else str(path))


def parse(text: str, source: str) -> VehicleConfig:
    """Decode a vehicle file's ``text``; ``source`` names it in errors. Raises ``VehicleError``."""
    config = strict_toml.decode(text, VehicleConfig, source, VehicleError)
    _refuse_contradictions(config, source)
    return config


def _refuse_contradictions(config: VehicleConfig, source: str) -> None:
    """Values that are each in range but cannot stand together."""
    duct, propeller, tail = config.duct, config.propeller, config.tailcone
    if tail.lost_step_chance > 0.0 and tail.step_deg == 0.0:
        raise VehicleError(
            f"{source}: tailcone.lost_step_chance = {tail.lost_step_chance}: "
            "expected tailcone.step_deg above 0 with it, or there is no step to lose"
        )
    if duct.separated_deg <= duct.stall_deg:
        raise VehicleError(
            f"{source}: duct.separated_deg = {duct.separated_deg}: expected more than duct.stall_deg = {duct.stall_deg}"
        )
    if propeller.diameter_m >= duct.diameter_m:
        raise VehicleError(
            f"{source}: propeller.diameter_m = {propeller.diameter_m}: "
            f"expected less than duct.diameter_m = {duct.diameter_m}, it turns inside"
        )
    if config.ballast.net_buoyancy_n <= -config.ballast.mass_kg * config.water.gravity_mps2:
        raise VehicleError(
            f"{source}: ballast.net_buoyancy_n = {config.ballast.net_buoyancy_n}: expected more than minus the weight"
        )
