"""Vehicles of the study: the prior of each, and the true vehicle that only the simulator uses.

Caribou's true vehicle is the supplied ``caribou_truth``. The others differ in hull, speed and
actuator. Their true vehicles are their files changed by one draw from the prior of identification,
with backlash and biases that the file does not contain. The motor steps are in the prior, too: the
maker of a motor states them.
"""

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from sitl.vehicle import config
from sitl.vehicle.config import VehicleConfig
from sysid.estimation.map import steady_state
from sysid.models import linear_planes, parameters
from sysid.models.parameters import NAMES
from sysid.planes import Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2
from tests.sysid.sea import Hold

MY_VEHICLE = str(Path(__file__).parents[2] / "docs" / "my_vehicle.toml")
STRAY = 0.7
"""Rms difference of true vehicles from their files, in prior standard deviations."""
MOTOR_STEP_DEG = 0.05
"""Duct angle per motor step, as on Caribou's true vehicle."""


class Case(NamedTuple):
    """One vehicle of the study."""

    name: str
    prior_file: str
    """Value for `ground refit --prior`."""
    prior: VehicleConfig
    truth: VehicleConfig
    hold: Hold
    """Gains of the first dive: the result of `ground vehicle gains` for the prior file."""

    def scale(self, plane: Plane) -> float:
        """Return the ratio of this vehicle's test size to Caribou's, inverse to effectiveness."""
        linear = steady_state.linear_plane(nominal(self.prior), plane)
        return CARIBOU_TURN_PER_S2 / abs(linear_planes.small_signal(linear).b1_per_s2)

    @property
    def trim_rad(self) -> tuple[float, float]:
        """Trims that a trim dive would measure, rounded to half a degree."""
        half = math.radians(0.5)
        level = steady_state.level_elevator_rad(self.truth, nominal(self.truth).model)
        wanted = (
            -math.radians(self.truth.tailcone.rudder_bias_deg),
            level - math.radians(self.truth.tailcone.elevator_bias_deg),
        )
        return round(wanted[0] / half) * half, round(wanted[1] / half) * half


def nominal(vehicle: VehicleConfig) -> parameters.CandidateVehicle:
    """Return a vehicle file as identification simulates it, without biases."""
    return parameters.candidate_vehicle(
        vehicle, {Plane.YAW: 0.0, Plane.PITCH: 0.0}, np.zeros(len(NAMES))
    )


@cache
def cases() -> tuple[Case, ...]:
    """Return all vehicles of the study."""
    return (
        Case(
            "caribou",
            "caribou_nominal",
            config.load("caribou_nominal"),
            config.load("caribou_truth"),
            Hold(),
        ),
        _strayed("remus100", "remus100", Hold(0.49, 0.76, 0.04, 0.54, 0.67, 0.2, 0.01), seed=1),
        _strayed("xfin_auv", "xfin_auv", Hold(0.75, 1.79, 0.04, 0.77, 1.3, 0.2, 0.008), seed=2),
        _strayed("my_vehicle", MY_VEHICLE, Hold(0.75, 0.93, 0.05, 0.86, 0.78, 0.2, 0.01), seed=3),
    )


def case(name: str) -> Case:
    """Return a vehicle of the study.

    Raises KeyError.
    """
    return {case.name: case for case in cases()}[name]


def _strayed(name: str, prior_file: str, hold: Hold, seed: int) -> Case:
    """Return a case whose true vehicle differs from its file by a random draw."""
    prior = _with_tailcone(
        config.load(prior_file),
        step_deg=MOTOR_STEP_DEG,
        lag_relative_sd=parameters.BENCH_TEST_SD,  # the tailcones of the study were on the bench
    )
    rng = np.random.default_rng(seed)
    away = np.linalg.cholesky(parameters.prior_covariance()) @ rng.standard_normal(len(NAMES))
    moved = parameters.candidate_vehicle(prior, {Plane.YAW: 0.0, Plane.PITCH: 0.0}, STRAY * away)
    lag = moved.actuators[Plane.YAW]
    true = _with_tailcone(
        moved.config,
        natural_frequency_radps=lag.natural_frequency_radps,
        damping_ratio=lag.damping_ratio,
        delay_s=lag.delay_s,
        rudder_bias_deg=-3.0,
        elevator_bias_deg=1.0,
        backlash_deg=0.1,
    )
    return Case(name, prior_file, prior, true, hold)


def _with_tailcone(vehicle: config.VehicleConfig, **values: float) -> config.VehicleConfig:
    """Return a vehicle with other values of its tailcone."""
    tailcone = msgspec.structs.replace(vehicle.tailcone, **values)
    return msgspec.structs.replace(vehicle, tailcone=tailcone)
