"""Simulated truth of a campaign: a seeded perturbation of a vehicle file within its uncertainty.

The perturbation is a sample of the prior of identification (``sysid.models.parameters``). Only the
simulator reads the file; ``sysid.refit`` refuses it as a prior by its name.
"""

import math
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from mavlink_io.errors import ErrorCode, InputError
from sitl.vehicle import export
from sitl.vehicle.config import VehicleConfig, VehicleFileError
from sitl.vehicle.fill_missing import Completed
from sysid.models import parameters
from sysid.models.parameters import NAMES, PARAMETERS, CandidateVehicle
from sysid.planes import Plane
from sysid.prior_knowledge import TRUTH_SUFFIX

Array = NDArray[np.float64]

MAX_SDS = 1.5
"""Largest deviation of a parameter, in prior standard deviations.

Caribou's truth differs from its prior by 1.0 in N_v, 1.1 in z_CM and less in other coefficients."""
MAX_OFFSET_SHARE = 1.0 / 3.0
"""Largest standard deviation of delay and net buoyancy, as a share of the file's value.

The prior deviations of 0.1 s and 5 N are those of Caribou, whose delay is 0.3 s."""
MAX_RATE_LIMIT_SD = 0.1
"""Largest standard deviation of the rate limit's logarithm: that of a drive with a data sheet.

The prior is wider, because a drive that sticks looks slower in the water."""
MAX_DRAWS = 1000
"""Number of samples after which no perturbation is assumed to be possible."""
HEAD = """\
# Simulated truth: {name} with a random change of its coefficients and its tailcone, seed {seed}.
# Only the simulator reads this file. Axes: x forward, y port, z up, origin at mid-length.
"""


class NoPerturbationError(InputError):
    """No sample of the prior is a possible vehicle."""

    code = ErrorCode.NO_PERTURBATION


def perturb(config: VehicleConfig, seed: int) -> VehicleConfig:
    """Return a possible vehicle that differs from a vehicle file within its prior uncertainty.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle file.
    seed : int
        Seed of the perturbation.

    Returns
    -------
    VehicleConfig
        Vehicle with other coefficients, tailcone, buoyancy and drag.

    Raises
    ------
    NoPerturbationError
        No sample of the prior is a possible vehicle.
    """
    rng = np.random.default_rng(seed)
    covariance = parameters.prior_covariance() + 1e-12 * np.eye(len(NAMES))
    spread = np.asarray(np.linalg.cholesky(covariance), np.float64)
    biases = dict.fromkeys(Plane, 0.0)
    for _ in range(MAX_DRAWS):
        z = _truncated_sample(rng, spread) * _shares(config)
        try:
            return _with_tailcone(parameters.candidate_vehicle(config, biases, z))
        except VehicleFileError:
            continue
    raise NoPerturbationError(
        f"{config.name}: no vehicle within the uncertainty of the file is possible"
    )


def write(config: VehicleConfig, seed: int) -> str:
    """Return a perturbed vehicle as the text of a vehicle file.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle file.
    seed : int
        Seed of the perturbation.

    Returns
    -------
    str
        TOML text.

    Raises
    ------
    NoPerturbationError
        As for `perturb`.
    """
    perturbed = replace(perturb(config, seed), name=f"{config.name}{TRUTH_SUFFIX}")
    text = export.write(Completed(_without_none(msgspec.to_builtins(perturbed)), {}))
    lines = [line.removesuffix("# given").rstrip() for line in text.splitlines()]
    body = [line for line in lines if not line.startswith("#")]
    return HEAD.format(name=config.name, seed=seed) + "\n".join(body) + "\n"


def _truncated_sample(rng: np.random.Generator, spread: Array) -> Array:
    """Return a sample of the prior with every parameter within `MAX_SDS`.

    With L the Cholesky factor of the covariance, z_i = sum_j L_ij n_j; n_i is drawn again until
    z_i is within the limit.
    """
    normals = np.zeros(len(NAMES))
    for i in range(normals.size):
        while True:
            normals[i] = rng.standard_normal()
            if abs(spread[i, : i + 1] @ normals[: i + 1]) <= MAX_SDS:
                break
    return np.asarray(spread @ normals)


def _shares(config: VehicleConfig) -> Array:
    """Return the factor on each z by which the deviations suit the vehicle."""
    largest_sds = {
        "delay_yaw": MAX_OFFSET_SHARE * config.tailcone.delay_s,
        "delay_pitch": MAX_OFFSET_SHARE * config.tailcone.delay_s,
        "net_buoyancy": MAX_OFFSET_SHARE * abs(config.ballast.net_buoyancy_n),
        "rate_limit": MAX_RATE_LIMIT_SD,
    }
    prior_sds = {p.name: p.prior_sd for p in PARAMETERS} | {
        "net_buoyancy": parameters.net_buoyancy_sd_n(config)
    }
    return np.array(
        [min(1.0, largest_sds.get(name, math.inf) / sd) for name, sd in prior_sds.items()]
    )


def _with_tailcone(vehicle: CandidateVehicle) -> VehicleConfig:
    """Return the vehicle file of a candidate: one tailcone, with the mean delay of its axes."""
    rudder, elevator = (vehicle.actuators[plane] for plane in Plane)
    config = vehicle.config
    wings = {
        name: replace(wing, lift_quadratic_per_rad2=max(0.0, wing.lift_quadratic_per_rad2))
        for name, wing in (("duct", config.duct), ("fins", config.fins))
        if wing is not None
    }
    return replace(
        config,
        effective=True,
        tailcone=replace(
            config.tailcone,
            natural_frequency_radps=rudder.natural_frequency_radps,
            damping_ratio=rudder.damping_ratio,
            delay_s=0.5 * (rudder.delay_s + elevator.delay_s),
            rate_degps=math.degrees(rudder.rate_radps),
            rudder_bias_deg=config.tailcone.rudder_bias_deg + math.degrees(rudder.bias_rad),
            elevator_bias_deg=config.tailcone.elevator_bias_deg + math.degrees(elevator.bias_rad),
            backlash_deg=math.degrees(rudder.backlash_rad),
        ),
        **wings,
    )


def _without_none(table: dict[str, Any]) -> dict[str, Any]:
    """Return nested tables without the keys whose value is None."""
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in table.items()
        if value is not None
    }
