"""What was measured ashore, as belief before the first dive: the tailcone's bench test and the
inclining test.

Both come as the JSON that ``ground bench`` and ``ground incline`` print. Each number enters as a
measurement of one parameter, so that a prior that already knows it better is not spoilt."""

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

SENSING_S = 0.03
"""What sensors and computing may add to the tailcone's own delay, one standard deviation: no bench
test sees it."""
LEAST_SHARE = 0.005
"""No bench test is believed better than to half a per cent."""
LEAST_PLAY_DEG = 0.02
"""Play that cannot be told from none."""


class AshoreError(ValueError):
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


class Reading(NamedTuple):
    """One parameter as measured ashore, in the unit of the vehicle file."""

    parameter: str
    value: float
    sd: float


def read(tailcone: Path | None = None, inclining: Path | None = None) -> tuple[Reading, ...]:
    """What the two tests tell; nothing of either that is None. Raises AshoreError."""
    found: list[Reading] = []
    if tailcone is not None:
        axes = _decode(tailcone, dict[AxisName, _Bench], "ground bench --json")
        for name, axis in axes.items():
            found += _readings(_PLANE_OF_AXIS[name], axis.model)
    if inclining is not None:
        found += _told("z_CM", _decode(inclining, _Incline, "ground incline --json").z_cm_m)
    return tuple(found)


def believed(prior: Prior, readings: Sequence[Reading]) -> Prior:
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


def _readings(plane: Plane, axis: _Axis) -> list[Reading]:
    play = axis.backlash_deg
    return [
        *_told("natural_frequency", axis.natural_frequency_radps),
        *_told("damping_ratio", axis.damping_ratio),
        *_told("rate_limit", axis.rate_degps),
        *_told("backlash", _Value(max(play.value, LEAST_PLAY_DEG), play.sd)),
        *_told(f"delay_{plane}", axis.delay_s),
    ]


def _told(parameter: str, value: _Value) -> list[Reading]:
    """Nothing, where the test did not show it."""
    return [] if value.sd is None else [Reading(parameter, value.value, value.sd)]


def _in_prior_deviations(config: VehicleConfig, reading: Reading) -> tuple[float, float]:
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
        "backlash": parameters.play_deg(config),
        "delay_yaw": tail.delay_s,
        "delay_pitch": tail.delay_s,
        "z_CM": config.linear.z_CM_m,
    }[reading.parameter]
    if parameter.kind == "offset":
        return (value - nominal) / parameter.prior_sd, math.hypot(
            sd, SENSING_S
        ) / parameter.prior_sd
    if not value / nominal > 0.0:
        raise AshoreError(
            f"{reading.parameter} = {value:g} as measured ashore: expected the sign of the vehicle"
            f" file's {nominal:g}"
        )
    share = max(sd / abs(value), LEAST_SHARE)
    return math.log(value / nominal) / parameter.prior_sd, share / parameter.prior_sd


def _decode(path: Path, kind: type[T], source: str) -> T:
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except OSError as error:
        raise AshoreError(
            f"{path}: {error.strerror}; give the JSON that `{source}` prints"
        ) from None
    except msgspec.MsgspecError as error:
        raise AshoreError(f"{path}: {error}; give the JSON that `{source}` prints") from None
