"""What was measured ashore, as belief before the first dive: the tailcone's bench test and the
inclining test.

Both come as the JSON that ``ground bench-test`` and ``ground inclining-test`` print. Each number
enters as a measurement of one parameter, so that a prior that already knows it better is not
spoilt."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import msgspec
import numpy as np

from sitl.vehicle.config import VehicleConfig
from sysid.data.segments import Plane
from sysid.estimation.map.problem import Prior
from sysid.models import parameters
from sysid.models.parameters import NAMES, PARAMETERS

T = TypeVar("T")
AxisName = Literal["rudder", "elevator"]
_PLANE_OF_AXIS: dict[AxisName, Plane] = {"rudder": "yaw", "elevator": "pitch"}

SENSOR_DELAY_S = 0.03
"""What sensors and computing may add to the tailcone's own delay, one standard deviation: no bench
test sees it."""
MIN_RELATIVE_SD = 0.005
"""No bench test is believed better than to half a per cent."""
MIN_BACKLASH_DEG = 0.02
"""Play that cannot be told from none."""


class BenchResultError(ValueError):
    """A file that is no bench or inclining result, or none of this vehicle: one line."""


class _Value(msgspec.Struct, frozen=True):
    value: float
    sd: float | None


class _Axis(msgspec.Struct, frozen=True):
    natural_frequency_radps: _Value
    damping_ratio: _Value
    delay_s: _Value
    rate_degps: _Value
    backlash_deg: _Value


class _Bench(msgspec.Struct, frozen=True):
    model: _Axis


class _Incline(msgspec.Struct, frozen=True):
    z_cm_m: _Value


class BenchMeasurement(NamedTuple):
    """One parameter as measured ashore, in the unit of the vehicle file."""

    parameter: str
    value: float
    sd: float


def read(
    tailcone: Path | None = None, inclining: Path | None = None
) -> tuple[BenchMeasurement, ...]:
    """What the two tests tell; nothing of either that is None. Raises AshoreError."""
    found: list[BenchMeasurement] = []
    if tailcone is not None:
        axes = _decode(tailcone, dict[AxisName, _Bench], "ground bench-test --json")
        for name, axis in axes.items():
            found += _readings(_PLANE_OF_AXIS[name], axis.model)
    if inclining is not None:
        found += _measurements_of(
            "z_CM", _decode(inclining, _Incline, "ground inclining-test --json").z_cm_m
        )
    return tuple(found)


def update_prior(prior: Prior, readings: Sequence[BenchMeasurement]) -> Prior:
    """The prior after these measurements, each one update of a Gaussian. Raises AshoreError."""
    for reading in readings:
        i = NAMES.index(reading.parameter)
        z, sd = _in_prior_deviations(prior.config, reading)
        gain = prior.covariance[:, i] / (prior.covariance[i, i] + sd**2)
        prior = prior._replace(
            mean=prior.mean + gain * (z - prior.mean[i]),
            covariance=prior.covariance - np.outer(gain, prior.covariance[i]),
        )
    return prior


def _readings(plane: Plane, axis: _Axis) -> list[BenchMeasurement]:
    play = axis.backlash_deg
    return [
        *_measurements_of("natural_frequency", axis.natural_frequency_radps),
        *_measurements_of("damping_ratio", axis.damping_ratio),
        *_measurements_of("rate_limit", axis.rate_degps),
        *_measurements_of("backlash", _Value(max(play.value, MIN_BACKLASH_DEG), play.sd)),
        *_measurements_of(f"delay_{plane}", axis.delay_s),
    ]


def _measurements_of(parameter: str, value: _Value) -> list[BenchMeasurement]:
    """Nothing, where the test did not show it."""
    return [] if value.sd is None else [BenchMeasurement(parameter, value.value, value.sd)]


def _in_prior_deviations(config: VehicleConfig, reading: BenchMeasurement) -> tuple[float, float]:
    """(z, sd of z) of a reading."""
    parameter, (_, value, sd), tail = (
        PARAMETERS[NAMES.index(reading.parameter)],
        reading,
        config.tailcone,
    )
    nominal = {
        "natural_frequency": tail.natural_frequency_radps,
        "damping_ratio": tail.damping_ratio,
        "rate_limit": tail.rate_degps,
        "backlash": parameters.backlash_deg(config),
        "delay_yaw": tail.delay_s,
        "delay_pitch": tail.delay_s,
        "z_CM": config.linear.z_CM_m,
    }[reading.parameter]
    if parameter.kind == "offset":
        return (value - nominal) / parameter.prior_sd, math.hypot(
            sd, SENSOR_DELAY_S
        ) / parameter.prior_sd
    if not value / nominal > 0.0:
        raise BenchResultError(
            f"{reading.parameter} = {value:g} as measured ashore: expected the sign of the vehicle"
            f" file's {nominal:g}"
        )
    share = max(sd / abs(value), MIN_RELATIVE_SD)
    return math.log(value / nominal) / parameter.prior_sd, share / parameter.prior_sd


def _decode(path: Path, kind: type[T], source: str) -> T:
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except OSError as error:
        raise BenchResultError(
            f"{path}: {error.strerror}; give the JSON that `{source}` prints"
        ) from None
    except msgspec.MsgspecError as error:
        raise BenchResultError(f"{path}: {error}; give the JSON that `{source}` prints") from None
