"""What a model says a run should have looked like, and how far off it was."""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid.data.segments import Plane, Run
from sysid.estimation.map.fit import cruise_speed_mps
from sysid.models import greybox, parameters
from sysid.models.model_file import IdentifiedModel, RunQuality
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.reproduction import paper_method

Array = NDArray[np.float64]


LEAD_S = 1.0
"""Simulations start this long before the test: late enough that the sea has not yet parted them
from the vehicle."""

OPENING_S = 10.0
"""The longest window in which the paper's two models differ by no more than the figures of its
Table 2."""


class Prediction(NamedTuple):
    """Simulated from the motion measured LEAD_S before the test, under the run's own commands.

    Arrays stand on the run's grid; before the simulation starts they repeat what was measured.
    """

    rate_radps: Array
    """By the identified model."""
    prior_rate_radps: Array
    """By the first-principles vehicle, trimmed as the measured one was."""
    angle_rad: Array
    prior_angle_rad: Array
    depth_m: Array
    prior_depth_m: Array


def predict(model: IdentifiedModel, run: Run, prior: VehicleConfig | None = None) -> Prediction:
    """Both models' run. ``prior`` is needed when the model was refitted from a vehicle file that is
    not shipped."""
    vehicle, first = vehicles(model, prior)
    return predict_with(vehicle, first, run, model)


def predict_with(
    vehicle: CandidateVehicle, first: CandidateVehicle, run: Run, model: IdentifiedModel
) -> Prediction:
    """As ``predict``, the two vehicles already at hand."""
    flown = run.since(-LEAD_S)
    before = simulate(first, flown)
    after = simulate_model(model, vehicle, flown)
    angle = run.heading_rad if run.plane == "yaw" else run.pitch_rad

    def whole(measured: Array, simulated: Array) -> Array:
        return np.concatenate([measured[: measured.size - simulated.size], simulated])

    return Prediction(
        rate_radps=whole(run.rate_radps, after.rate_radps),
        prior_rate_radps=whole(run.rate_radps, before.rate_radps),
        angle_rad=whole(angle, after.angle_rad),
        prior_angle_rad=whole(angle, before.angle_rad),
        depth_m=whole(run.depth_m, after.depth_m),
        prior_depth_m=whole(run.depth_m, before.depth_m),
    )


def vehicles(
    model: IdentifiedModel, prior: VehicleConfig | None = None
) -> tuple[CandidateVehicle, CandidateVehicle]:
    """The identified vehicle and its prior."""
    return perturb(model, np.array(model.joint.z), prior), perturb(
        model, np.zeros(len(model.joint.z)), prior
    )


def perturb(
    model: IdentifiedModel, z: Array, prior: VehicleConfig | None = None
) -> CandidateVehicle:
    """The prior vehicle of a model moved by ``z``, which has the model's own names."""
    name = model.vehicle.prior
    config = prior or (
        _shipped(name) if name in vehicle_files.SHIPPED else vehicle_files.load(name)
    )
    biases: dict[Plane, float] = {
        plane: math.radians(b) for plane, b in model.vehicle.prior_biases_deg.items()
    }
    known = dict(zip(model.joint.names, z.tolist(), strict=True))
    return parameters.candidate_vehicle(
        config, biases, np.array([known.get(name, 0.0) for name in NAMES])
    )


@cache
def _shipped(name: str) -> VehicleConfig:
    """A shipped vehicle, read once for the hundreds that are drawn from a model."""
    return vehicle_files.load(name)


def simulate_model(
    model: IdentifiedModel, vehicle: CandidateVehicle, run: Run
) -> greybox.PlaneTrajectory:
    """The run by a model, whose identified vehicle is at hand: other methods know linear planes
    only."""
    return (
        simulate(vehicle, run)
        if model.method == "map"
        else paper_method.motion(model, vehicle.actuators[run.plane], run)
    )


def simulate(vehicle: CandidateVehicle, run: Run) -> greybox.PlaneTrajectory:
    """The run as ``vehicle`` would have flown it from its first sample on, on its grid."""
    speed = cruise_speed_mps(vehicle, float(run.thrust[0]))
    return greybox.simulate(
        vehicle.model, vehicle.actuators[run.plane], run, greybox.initial_motion(run), 1, speed
    )


def quality(
    model: IdentifiedModel, runs: Sequence[Run], prior: VehicleConfig | None = None
) -> tuple[RunQuality, ...]:
    """Rate errors of each run once its test has begun."""
    vehicle, first = vehicles(model, prior)
    return tuple(_quality(run, predict_with(vehicle, first, run, model)) for run in runs)


def with_held_out_errors(
    model: IdentifiedModel, runs: Sequence[Run], prior: VehicleConfig | None = None
) -> IdentifiedModel:
    """The model with its errors on runs it was not fitted to."""
    return msgspec.structs.replace(model, held_out=quality(model, runs, prior))


def mean_rate_errors(qualities: Sequence[RunQuality], plane: Plane) -> tuple[float, float] | None:
    """(prior, model) mean squared rate error over the runs of a plane, (deg/s)^2; None without
    runs."""
    return _means(
        [(q.prior_mse_deg2ps2, q.model_mse_deg2ps2) for q in qualities if q.plane == plane]
    )


def opening_rate_errors(
    qualities: Sequence[RunQuality], plane: Plane
) -> tuple[float, float] | None:
    """The same over the first OPENING_S of each run."""
    return _means(
        [
            (q.opening_prior_mse_deg2ps2, q.opening_model_mse_deg2ps2)
            for q in qualities
            if q.plane == plane
        ]
    )


def _means(pairs: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    if not pairs:
        return None
    prior, model = np.mean(pairs, axis=0)
    return float(prior), float(model)


def _quality(run: Run, prediction: Prediction) -> RunQuality:
    after = ~run.preroll
    measured = np.degrees(run.rate_radps[after])
    model_error = measured - np.degrees(prediction.rate_radps[after])
    prior_error = measured - np.degrees(prediction.prior_rate_radps[after])
    opening = run.time_s[after] < OPENING_S
    return RunQuality(
        run=run.name,
        plane=run.plane,
        prior_mse_deg2ps2=float(np.mean(prior_error**2)),
        model_mse_deg2ps2=float(np.mean(model_error**2)),
        opening_prior_mse_deg2ps2=float(np.mean(prior_error[opening] ** 2)),
        opening_model_mse_deg2ps2=float(np.mean(model_error[opening] ** 2)),
        variance_accounted_for=1.0 - float(np.var(model_error) / max(np.var(measured), 1e-12)),
    )
