"""Update of the prior with bench measurements: the tailcone bench test and the inclining test.

Both are the JSON output of ``ground bench-test`` and ``ground inclining-test``. Each number is a
measurement y with standard deviation s of h^T z, and updates the normal prior (mean m, covariance
P):

    K = P h / (h^T P h + s^2),   m <- m + K (y - h^T m),   P <- P - K h^T P.

h holds the prior standard deviation of the measured parameter. Frequency and damping of the
elevator are products of two ratios, so that h has two entries.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import msgspec
import numpy as np

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.text_files import MAX_TEXT_BYTES, read_limited
from sitl.vehicle.config import VehicleConfig
from sysid.estimation.map.problem import Prior
from sysid.models import parameters
from sysid.models.json_record import decode
from sysid.models.parameters import ELEVATOR_RATIOS, NAMES, PARAMETERS
from sysid.planes import PLANE_OF_SURFACE, PLANES, Plane

T = TypeVar("T")
AxisName = Literal["rudder", "elevator"]

SENSOR_DELAY_S = 0.03
"""Standard deviation of the delay of sensors and computing, which a bench test does not measure."""
MIN_RELATIVE_SD = 0.005
"""Minimum relative standard deviation of a bench measurement."""
MIN_BACKLASH_DEG = 0.02
"""Minimum backlash, because the parameter is a ratio and cannot be zero."""


class BenchResultError(InputError):
    """File is not a bench or inclining result, or not of this vehicle; a message of one line."""

    code = ErrorCode.BENCH_RESULT


class _Value(msgspec.Struct, frozen=True):
    """Value with its standard deviation; None for an unidentifiable value."""

    value: float
    sd: float | None


class _Axis(msgspec.Struct, frozen=True):
    """Model of one tailcone axis in the JSON of ``ground bench-test``."""

    natural_frequency_radps: _Value
    damping_ratio: _Value
    delay_s: _Value
    rate_degps: _Value
    backlash_deg: _Value


class _Bench(msgspec.Struct, frozen=True):
    """Entry of one axis in the JSON of ``ground bench-test``."""

    model: _Axis


class _Incline(msgspec.Struct, frozen=True):
    """JSON of ``ground inclining-test``."""

    z_cm_m: _Value


class BenchMeasurement(NamedTuple):
    """Measurement, in the unit of the vehicle file."""

    parameter: str
    value: float
    sd: float
    ratio: str | None = None
    """Second parameter, where the measured value is a product of two."""


def read(
    tailcone: Path | None = None, inclining: Path | None = None
) -> tuple[BenchMeasurement, ...]:
    """Read the results of the bench test and the inclining test.

    Parameters
    ----------
    tailcone : Path, optional
        JSON file of ``ground bench-test``.
    inclining : Path, optional
        JSON file of ``ground inclining-test``.

    Returns
    -------
    tuple of BenchMeasurement
        Measured parameters; unidentifiable values are left out.

    Raises
    ------
    BenchResultError
        A file cannot be read or has another format.
    """
    measurements: list[BenchMeasurement] = []
    if tailcone is not None:
        axes = _decode(tailcone, dict[AxisName, _Bench], "ground bench-test --json")
        for name, axis in axes.items():
            measurements += _readings(PLANE_OF_SURFACE[name], axis.model)
    if inclining is not None:
        measurements += _measurements_of(
            "z_CM", _decode(inclining, _Incline, "ground inclining-test --json").z_cm_m
        )
    return tuple(measurements)


def update_prior(prior: Prior, readings: Sequence[BenchMeasurement]) -> Prior:
    """Return the prior updated with measurements, one after the other.

    Parameters
    ----------
    prior : Prior
        Normal prior of z.
    readings : sequence of BenchMeasurement
        Measurements of single parameters.

    Returns
    -------
    Prior
        Prior with the new mean and covariance.

    Raises
    ------
    BenchResultError
        A measurement has the opposite sign of the value in the vehicle file.
    """
    for reading in readings:
        value, sd = _distance_from_prior(prior.config, reading)
        scale = np.zeros(len(PARAMETERS))
        for name in filter(None, (reading.parameter, reading.ratio)):
            scale[NAMES.index(name)] = parameters.prior_sd(prior.config, name)
        gain = prior.covariance @ scale / (scale @ prior.covariance @ scale + sd**2)
        prior = prior._replace(
            mean=prior.mean + gain * (value - scale @ prior.mean),
            covariance=prior.covariance - np.outer(gain, scale @ prior.covariance),
        )
    return prior


def _readings(plane: Plane, axis: _Axis) -> list[BenchMeasurement]:
    """Return the measurements of one tailcone axis."""
    play = axis.backlash_deg
    lag = [
        *_measurements_of("natural_frequency", axis.natural_frequency_radps),
        *_measurements_of("damping_ratio", axis.damping_ratio),
    ]
    if not PLANES[plane].is_yaw:
        lag = [reading._replace(ratio=ELEVATOR_RATIOS[reading.parameter]) for reading in lag]
    return [
        *lag,
        *_measurements_of("rate_limit", axis.rate_degps),
        *_measurements_of("backlash", _Value(max(play.value, MIN_BACKLASH_DEG), play.sd)),
        *_measurements_of(f"delay_{plane}", axis.delay_s),
    ]


def _measurements_of(parameter: str, value: _Value) -> list[BenchMeasurement]:
    """Return the measurement in a list, which is empty for an unidentifiable value."""
    return [] if value.sd is None else [BenchMeasurement(parameter, value.value, value.sd)]


def _distance_from_prior(config: VehicleConfig, reading: BenchMeasurement) -> tuple[float, float]:
    """Return the distance of a measurement from the vehicle file, and its standard deviation.

    It is ln(value / nominal) for a ratio and value - nominal for an offset.
    """
    tail, value, sd = config.tailcone, reading.value, reading.sd
    nominal = {
        "natural_frequency": tail.natural_frequency_radps,
        "damping_ratio": tail.damping_ratio,
        "rate_limit": tail.rate_degps,
        "backlash": parameters.backlash_deg(config),
        "delay_yaw": tail.delay_s,
        "delay_pitch": tail.delay_s,
        "z_CM": config.linear.z_CM_m,
    }[reading.parameter]
    if PARAMETERS[NAMES.index(reading.parameter)].kind == "offset":
        return value - nominal, math.hypot(sd, SENSOR_DELAY_S)
    if not value / nominal > 0.0:
        raise BenchResultError(
            f"{reading.parameter} = {value:g} in the bench result: expected the sign of"
            f" {nominal:g} in the vehicle file"
        )
    return math.log(value / nominal), max(sd / abs(value), MIN_RELATIVE_SD)


def _decode(path: Path, kind: type[T], source: str) -> T:
    """Decode a JSON file; ``source`` names the command that writes it."""
    try:
        return decode(read_limited(path, MAX_TEXT_BYTES), kind)
    except OSError as error:
        raise BenchResultError(
            f"{path}: {error.strerror}; give the JSON that `{source}` prints"
        ) from None
    except msgspec.MsgspecError as error:
        raise BenchResultError(f"{path}: {error}; give the JSON that `{source}` prints") from None
