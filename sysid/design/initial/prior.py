"""Vehicles sampled from the prior before the first dive, and the margins of a loop on them."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.linearise import linearise
from sysid.control_analysis import loop_state_space, loop_transfer, root_locus
from sysid.control_analysis.loop_transfer import Gains
from sysid.control_analysis.margins import Planes
from sysid.design.design_model import DEFAULT_DISTURBANCE, DesignModel, build, lag_with_sampling
from sysid.design.initial.loop_structure import LoopStructure
from sysid.models import parameters
from sysid.models.linear_planes import LinearPlane
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import Plane

UNBIASED: dict[Plane, float] = {Plane.YAW: 0.0, Plane.PITCH: 0.0}
"""Assumed actuator bias of each plane (rad)."""
VEHICLES = 120
"""Number of vehicles sampled from the prior."""
SEED = 1957
"""Seed of these samples."""
MIN_GM_DB, MIN_PM_DEG = 3.0, 20.0
"""Minimum gain margin (dB) and phase margin (deg) on a stable sampled vehicle."""
STABLE_FRACTION, MIN_STABLE_FRACTION = 0.9, 0.8
"""Share of sampled vehicles with these margins, and the smallest one that is accepted.

The smaller one is for a vehicle on which no gains reach the larger one with any limits.
"""
LOW_QUANTILE = 0.05
"""Quantile that is reported as the low end."""


def nominal_model(config: VehicleConfig) -> DesignModel:
    """Return the nominal design model with the default disturbance. Raises VehicleError."""
    return _design_model(parameters.candidate_vehicle(config, UNBIASED, np.zeros(len(NAMES))))


def sample_models(config: VehicleConfig, count: int = VEHICLES) -> Iterator[DesignModel]:
    """Yield up to `count` vehicles from the prior of identification, without impossible ones."""
    draws = np.random.default_rng(SEED).standard_normal((count, len(NAMES)))
    mean, covariance = np.zeros(len(NAMES)), parameters.prior_covariance()
    for sample in parameters.feasible_samples(
        lambda z: parameters.candidate_vehicle(config, UNBIASED, z), mean, covariance, draws
    ):
        yield _design_model(sample.vehicle)


def _design_model(vehicle: CandidateVehicle) -> DesignModel:
    """Return linear planes of the full equations of motion in FRD axes, with the tailcone."""
    linear = linearise(vehicle.model, vehicle.config.operating_point.speed_mps)
    flu_to_frd = np.diag([-1.0, -1.0, -1.0, 1.0])
    yaw = LinearPlane(
        A=linear.yaw.A,
        B=-linear.yaw.B[:, 0],
        states=("v", "r", "psi"),
        moment=np.array([0.0, 1.0, 0.0]),
    )
    pitch = LinearPlane(
        A=flu_to_frd @ linear.pitch.A @ flu_to_frd,
        B=flu_to_frd @ linear.pitch.B[:, 0],
        states=("w", "q", "theta", "depth"),
        moment=np.array([0.0, 1.0, 0.0, 0.0]),
    )
    lags = {plane: lag_with_sampling(tail) for plane, tail in vehicle.actuators.items()}
    return build(
        Planes(yaw, pitch),
        lags[Plane.YAW],
        lags[Plane.PITCH],
        {Plane.YAW: DEFAULT_DISTURBANCE, Plane.PITCH: DEFAULT_DISTURBANCE},
    )


def is_robust(
    shape: LoopStructure, gains: Gains, vehicles: Sequence[DesignModel], fraction: float
) -> bool:
    """Return whether at least this fraction of the vehicles has the minimum margins."""
    allowed_failures = (1.0 - fraction) * len(vehicles)
    for vehicle in vehicles:
        achieved = loop_margins(shape, gains, vehicle)
        if achieved.gm_db < MIN_GM_DB or achieved.pm_deg < MIN_PM_DEG:
            allowed_failures -= 1.0
            if allowed_failures < 0.0:
                return False
    return True


class LoopMargins(NamedTuple):
    """Margins of a loop on one vehicle, at the cut where they are smallest."""

    damping: float
    """Smallest damping ratio of the oscillatory poles."""
    gm_db: float
    pm_deg: float


def loop_margins(shape: LoopStructure, gains: Gains, vehicle: DesignModel) -> LoopMargins:
    """Return the margins of a loop on one vehicle; zero if the loop is unstable."""
    margins = [loop_transfer.margins(cut) for cut in shape.cuts(vehicle, gains).values()]
    damping = float(
        root_locus.damping(loop_state_space.poles(shape.closed(vehicle, gains))[None, :])[0]
    )
    if damping <= 0.0:
        return LoopMargins(damping, 0.0, 0.0)
    return LoopMargins(damping, min(m.gm_db for m in margins), min(m.pm_deg for m in margins))


class LoopRobustness(NamedTuple):
    """Margins of a loop over the prior: the `LOW_QUANTILE` quantile of each figure."""

    damping: float
    gm_db: float
    pm_deg: float
    stable: float
    """Share of vehicles on which the loop is stable."""
    vehicles: int


def loop_robustness(
    shape: LoopStructure, gains: Gains, vehicles: Sequence[DesignModel]
) -> LoopRobustness:
    """Return the margins of a loop over the sampled vehicles."""
    achieved = [loop_margins(shape, gains, vehicle) for vehicle in vehicles]
    damping, gm_db, pm_deg = np.quantile(np.array(achieved), LOW_QUANTILE, axis=0).tolist()
    stable = float(np.mean([loop.damping > 0.0 for loop in achieved]))
    return LoopRobustness(
        damping=damping, gm_db=gm_db, pm_deg=pm_deg, stable=stable, vehicles=len(achieved)
    )
