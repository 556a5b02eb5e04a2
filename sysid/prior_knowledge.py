"""Knowledge of a vehicle before its tests: a vehicle file, or the model of earlier tests."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mavlink_io.errors import ErrorCode, InputError
from sitl import vehicle_check
from sitl.vehicle import build_model
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig, VehicleFileError
from sysid.data.runs import Run
from sysid.estimation.map import steady_state
from sysid.estimation.map.problem import Prior
from sysid.models import model_file as models
from sysid.models import parameters, prediction
from sysid.models.bench_priors import BenchMeasurement
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES

FORBIDDEN_PRIOR = "caribou_truth"
"""Vehicle file of the simulated truth.

It is refused as a prior: no such file exists for a real vehicle.
"""
TRUTH_SUFFIX = "_truth"
"""End of the name of a simulated vehicle, whose file is refused as a prior."""


class RefitError(InputError):
    """The logs or the prior cannot be used; the message names the cause and the correction."""

    code = ErrorCode.REFIT_DATA


class PriorKnowledge(NamedTuple):
    """Knowledge of a vehicle before its tests: vehicle file, earlier model, bench measurements."""

    config: VehicleConfig
    name: str
    earlier: IdentifiedModel | None
    bench_measurements: tuple[BenchMeasurement, ...] = ()
    """Results of the bench test of the tailcone and of the inclining test."""


def prior_of(
    runs: Sequence[Run], prior: VehicleConfig, earlier: IdentifiedModel | None = None
) -> Prior:
    """Return the normal distribution of the parameters before the data.

    Parameters
    ----------
    runs : sequence of Run
        Runs whose mean commands before the tests give the actuator biases of the prior vehicle.
    prior : VehicleConfig
        First-principles vehicle.
    earlier : IdentifiedModel, optional
        Earlier model; its estimate and covariance are used, and ``runs`` is ignored.

    Returns
    -------
    Prior
        Mean and covariance of z, in prior standard deviations, and actuator biases (rad).
    """
    if earlier is None:
        biases = steady_state.trim_biases(prior, build_model.build(prior), runs)
        return Prior(
            config=prior,
            biases_rad=biases,
            mean=np.zeros(len(NAMES)),
            covariance=parameters.prior_covariance(),
        )
    return Prior(
        config=prior,
        biases_rad=earlier.vehicle.prior_biases_rad,
        mean=np.array(earlier.joint.z),
        covariance=np.array(earlier.joint.covariance),
    )


def prior_knowledge(prior: str | Path) -> PriorKnowledge:
    """Read the prior of an identification.

    Parameters
    ----------
    prior : str or Path
        Name of a shipped vehicle, path of a vehicle file, or path of a ``model.json`` of method
        ``map``.

    Returns
    -------
    PriorKnowledge
        Vehicle file, its name and, for a ``model.json``, the earlier model.

    Raises
    ------
    VehicleFileError, ModelError
        The file is missing or invalid.
    RefitError
        The model is of another method than ``map``, or has other parameters than this version.
    """
    if str(prior).endswith(".json"):
        earlier = models.read(prior)
        if earlier.method != "map":
            raise RefitError(
                f"{prior}: method = {earlier.method!r}; a prior must be a model of method 'map'"
            )
        if earlier.joint.names != NAMES:
            raise RefitError(
                f"{prior}: joint.names are not this version's parameters; refit its logs"
            )
        return PriorKnowledge(prediction.prior_vehicle(earlier), earlier.vehicle.prior, earlier)
    return PriorKnowledge(
        vehicle_file(prior), str(prior) if prior == "caribou_nominal" else Path(prior).name, None
    )


def vehicle_file(prior: str | Path) -> VehicleConfig:
    """Load the vehicle file of a prior.

    Parameters
    ----------
    prior : str or Path
        Name of a shipped vehicle or path of a vehicle file (TOML).

    Returns
    -------
    VehicleConfig
        The decoded vehicle file.

    Raises
    ------
    VehicleFileError
        The file is missing or invalid, the vehicle is physically impossible, or it is the simulated
        truth, `FORBIDDEN_PRIOR`.
    """
    is_truth = str(prior) == FORBIDDEN_PRIOR
    config = None if is_truth else vehicle_files.load(prior)
    if config is None or config.name.endswith(TRUTH_SUFFIX):
        raise VehicleFileError(
            f"prior {str(prior)!r}: is the simulated truth; "
            "give 'caribou_nominal', a vehicle file or a model.json"
        )
    if str(prior) not in vehicle_files.SHIPPED:
        vehicle_check.check_config(config, str(prior))
    return config


def check_vehicle(vehicle: str | Path) -> None:
    """Check a vehicle file as ``ground vehicle check`` does.

    Parameters
    ----------
    vehicle : str or Path
        Name of a shipped vehicle or path of a vehicle file (TOML).

    Raises
    ------
    VehicleFileError
        The file is missing or invalid, or the vehicle is physically impossible.
    """
    if str(vehicle) not in vehicle_files.SHIPPED:
        vehicle_check.check(vehicle)


def check_flown_vehicle(vehicle: str | Path) -> tuple[str, ...]:
    """Check the vehicle file of a simulated flight with Caribou's autopilot.

    Parameters
    ----------
    vehicle : str or Path
        Name of a shipped vehicle or path of a vehicle file (TOML).

    Returns
    -------
    tuple of str
        Warnings about unusual values; empty for a shipped vehicle.

    Raises
    ------
    VehicleFileError
        The file is missing or invalid, the vehicle is physically impossible, or an instrument is
        missing without which the autopilot does not arm.
    """
    if str(vehicle) in vehicle_files.SHIPPED:
        return ()
    return tuple(vehicle_check.check_flight(vehicle).warnings)
