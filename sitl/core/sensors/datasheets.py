"""Catalogue of sensors: typed access to ``datasheets.toml``."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated, TypeVar

from msgspec import Meta, Struct

from mavlink_io import toml_io
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.suggestions import did_you_mean
from sitl.vehicle.config import Instruments, VehicleFileError

NONE = "none"
"""Name for a sensor that is not fitted."""

Positive = Annotated[float, Meta(gt=0.0)]
NotNegative = Annotated[float, Meta(ge=0.0)]
Probability = Annotated[float, Meta(ge=0.0, lt=1.0)]
Angle = Annotated[float, Meta(gt=0.0, lt=90.0)]


class CatalogueError(InputError):
    """The catalogue cannot be read; the message names table, key, value and the expected value."""

    code = ErrorCode.SENSOR_CATALOGUE


class Sheet(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Keys that all sensors have in common."""

    rate_hz: Positive
    latency_s: NotNegative = 0.0
    dropout: Probability = 0.0
    """Probability that a reading never arrives."""


class ImuSheet(Sheet, frozen=True):
    """Gyroscopes and accelerometers: white noise, biases, scale and misalignment (rms)."""

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
    """Magnetometer: white noise, and rms hard- and soft-iron errors after compensation."""

    density_mgauss_rthz: NotNegative
    hard_iron_mgauss: NotNegative
    soft_iron: NotNegative


class PressureSheet(Sheet, frozen=True):
    """Pressure sensor: white noise, rms offset and resolution."""

    noise_hpa: NotNegative
    offset_hpa: NotNegative
    resolution_hpa: NotNegative
    temperature_noise_degc: NotNegative


class GpsSheet(Sheet, frozen=True):
    """Satellite receiver: rms errors per axis and start-up times."""

    horizontal_noise_m: NotNegative
    vertical_noise_m: NotNegative
    velocity_noise_mps: NotNegative
    satellites: Annotated[int, Meta(ge=4, le=254)]
    hot_start_s: NotNegative
    warm_start_s: NotNegative
    hot_within_s: Positive
    """Longest time under water after which the receiver still makes a hot start."""


class DvlSheet(Sheet, frozen=True):
    """Doppler velocity log: beam geometry, ranges, rms errors and outliers."""

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
    """Far end of the layer used for water track, distance below the vehicle."""
    water_noise_mps: NotNegative


class AltimeterSheet(Sheet, frozen=True):
    """Altimeter: range, white noise, beam and outliers."""

    min_range_m: Positive
    max_range_m: Positive
    noise_m: NotNegative
    beam_width_deg: NotNegative
    max_tilt_deg: Angle
    outlier_chance: Probability


class BatterySheet(Sheet, frozen=True):
    """Battery and gauge."""

    capacity_ah: Positive
    cells: Annotated[int, Meta(ge=1)]
    charge_points: tuple[float, ...]
    """Charge fractions at which ``open_circuit_cell_v`` is given."""
    open_circuit_cell_v: tuple[float, ...]
    resistance_ohm: Positive
    """Series resistance of the whole pack."""
    voltage_noise_v: NotNegative
    current_noise_a: NotNegative
    gauge_error: NotNegative
    """Rms scale error of the measured current."""


class EncoderSheet(Sheet, frozen=True):
    """Duct encoder."""

    resolution_deg: Positive
    noise_deg: NotNegative
    offset_deg: NotNegative


class Catalogue(Struct, frozen=True, forbid_unknown_fields=True):
    """Sensors by kind and name."""

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
    """Return the sensors that are supplied with the simulator."""
    path = Path(__file__).with_name("datasheets.toml")
    return toml_io.decode(path.read_text(encoding="utf-8"), Catalogue, path.name, CatalogueError)


def find(kind: str, sheets: dict[str, Kind], carried: Instruments, source: str) -> Kind | None:
    """Return the data sheet of a vehicle's sensor, or None.

    Raises VehicleFileError, which begins with ``source``, for an unknown name.
    """
    name: str = getattr(carried, kind)
    if name == NONE:
        return None
    if name not in sheets:
        known = ", ".join((*sheets, NONE))
        raise VehicleFileError(
            f"{source}: instruments.{kind} = {name!r}: unknown; known here: {known}"
            f"{did_you_mean(name, sheets)}"
        )
    return sheets[name]


def check(carried: Instruments, source: str) -> None:
    """Check that the catalogue has all instruments of a vehicle.

    Parameters
    ----------
    carried : Instruments
        Names of the instruments.
    source : str
        Name of the vehicle file in error messages.

    Raises
    ------
    VehicleFileError
        The catalogue does not have one of the names.
    """
    for kind in Instruments.__struct_fields__:
        find(kind, getattr(catalogue(), kind), carried, source)
