"""The catalogue of instruments: ``datasheets.toml``, strictly decoded."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated, TypeVar

from msgspec import Meta, Struct

from sitl.vehicle import toml_io
from sitl.vehicle.config import Instruments, VehicleFileError

NONE = "none"
"""The name of an instrument that is not carried."""

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Probability = Annotated[float, Meta(ge=0, lt=1)]
Angle = Annotated[float, Meta(gt=0, lt=90)]


class CatalogueError(ValueError):
    """The catalogue cannot be read; the message names table, key, value and what would be right."""


class Sheet(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every instrument's table tells."""

    rate_hz: Positive
    latency_s: NotNegative = 0.0
    dropout: Probability = 0.0
    """Probability that a reading never arrives."""


class ImuSheet(Sheet, frozen=True):
    gyro_density_degps_rthz: NotNegative
    gyro_turn_on_degph: NotNegative
    gyro_stability_degph: NotNegative
    accelerometer_density_ug_rthz: NotNegative
    accelerometer_turn_on_ug: NotNegative
    accelerometer_stability_ug: NotNegative
    wander_time_s: Positive
    scale_ppm: NotNegative
    misalignment_deg: NotNegative


class MagnetometerSheet(Sheet, frozen=True):
    density_mgauss_rthz: NotNegative
    hard_iron_mgauss: NotNegative
    soft_iron: NotNegative


class PressureSheet(Sheet, frozen=True):
    noise_hpa: NotNegative
    offset_hpa: NotNegative
    resolution_hpa: NotNegative
    temperature_noise_degc: NotNegative


class GpsSheet(Sheet, frozen=True):
    horizontal_noise_m: NotNegative
    vertical_noise_m: NotNegative
    velocity_noise_mps: NotNegative
    satellites: Annotated[int, Meta(ge=4, le=254)]
    hot_start_s: NotNegative
    warm_start_s: NotNegative
    hot_within_s: Positive


class DvlSheet(Sheet, frozen=True):
    beam_angle_deg: Angle
    min_altitude_m: Positive
    max_altitude_m: Positive
    max_tilt_deg: Angle
    noise_mps: NotNegative
    scale_error: NotNegative
    misalignment_deg: NotNegative
    outlier_chance: Probability
    outlier_mps: NotNegative
    water_rate_hz: Positive
    water_layer_m: Positive
    water_noise_mps: NotNegative


class AltimeterSheet(Sheet, frozen=True):
    min_range_m: Positive
    max_range_m: Positive
    noise_m: NotNegative
    beam_width_deg: NotNegative
    max_tilt_deg: Angle
    outlier_chance: Probability


class BatterySheet(Sheet, frozen=True):
    capacity_ah: Positive
    cells: Annotated[int, Meta(ge=1)]
    charge_points: tuple[float, ...]
    open_circuit_cell_v: tuple[float, ...]
    resistance_ohm: Positive
    voltage_noise_v: NotNegative
    current_noise_a: NotNegative
    gauge_error: NotNegative


class EncoderSheet(Sheet, frozen=True):
    resolution_deg: Positive
    noise_deg: NotNegative
    offset_deg: NotNegative


class Catalogue(Struct, frozen=True, forbid_unknown_fields=True):
    """Instruments by kind and name."""

    imu: dict[str, ImuSheet]
    magnetometer: dict[str, MagnetometerSheet]
    pressure: dict[str, PressureSheet]
    gps: dict[str, GpsSheet]
    dvl: dict[str, DvlSheet]
    altimeter: dict[str, AltimeterSheet]
    battery: dict[str, BatterySheet]
    leak: dict[str, Sheet]
    encoder: dict[str, EncoderSheet]


Kind = TypeVar("Kind", bound=Sheet)


@cache
def catalogue() -> Catalogue:
    """The instruments that come with the simulator."""
    path = Path(__file__).with_name("datasheets.toml")
    return toml_io.decode(path.read_text(encoding="utf-8"), Catalogue, path.name, CatalogueError)


def find(kind: str, sheets: dict[str, Kind], carried: Instruments, vehicle: str) -> Kind | None:
    """The sheet of what a vehicle carries of a kind, None where she carries none. Raises
    VehicleError."""
    name: str = getattr(carried, kind)
    if name == NONE:
        return None
    if name not in sheets:
        known = ", ".join((*sheets, NONE))
        raise VehicleFileError(
            f"vehicle {vehicle}: instruments.{kind} = {name!r}: unknown; known here: {known}"
        )
    return sheets[name]
