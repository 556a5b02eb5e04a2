"""The vehicles to reckon with before a first dive, and how many of them a loop keeps hold of."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.linearise import linearise
from sysid.control_analysis import loop_transfer, root_locus
from sysid.control_analysis.loop_transfer import Gains
from sysid.control_analysis.margins import Planes
from sysid.data.segments import Plane
from sysid.design.design_model import DEFAULT_DISTURBANCE, DesignModel, build, lag_with_sampling
from sysid.design.initial.loop_structure import LoopStructure
from sysid.models import parameters
from sysid.models.linear_planes import LinearPlane
from sysid.models.parameters import NAMES, CandidateVehicle

Array = NDArray[np.float64]

UNBIASED: dict[Plane, float] = {"yaw": 0.0, "pitch": 0.0}
VEHICLES = 120
SEED = 1957
MIN_GM_DB, MIN_PM_DEG = 3.0, 20.0
"""What a vehicle that is not the nominal one must keep, and be stable."""
MIN_STABLE_FRACTION = 0.9
"""Of the vehicles, at least."""
LOW_QUANTILE = 0.05
"""Quantile that stands for a bad one."""


def nominal_model(config: VehicleConfig) -> DesignModel:
    """As the file gives her, in an assumed sea. Raises VehicleError."""
    return _design_model(parameters.candidate_vehicle(config, UNBIASED, np.zeros(len(NAMES))))


def sample_models(config: VehicleConfig, count: int = VEHICLES) -> Iterator[DesignModel]:
    """Up to ``count`` vehicles by the prior of identification, without those that cannot be."""
    draws = np.random.default_rng(SEED).standard_normal((count, len(NAMES)))
    mean, covariance = np.zeros(len(NAMES)), parameters.prior_covariance()
    for each in parameters.feasible_samples(
        lambda z: parameters.candidate_vehicle(config, UNBIASED, z), mean, covariance, draws
    ):
        yield _design_model(each.vehicle)


def _design_model(vehicle: CandidateVehicle) -> DesignModel:
    """Linear planes of the whole equations of motion, in FRD axes, behind her tailcone and its
    sampling."""
    found = linearise(vehicle.model, vehicle.config.operating_point.speed_mps)
    turned = np.diag([-1.0, -1.0, -1.0, 1.0])
    yaw = LinearPlane(found.yaw.A, -found.yaw.B[:, 0], ("v", "r", "psi"), np.array([0.0, 1.0, 0.0]))
    pitch = LinearPlane(
        turned @ found.pitch.A @ turned,
        turned @ found.pitch.B[:, 0],
        ("w", "q", "theta", "depth"),
        np.array([0.0, 1.0, 0.0, 0.0]),
    )
    lags = {plane: lag_with_sampling(tail) for plane, tail in vehicle.actuators.items()}
    return build(
        Planes(yaw, pitch),
        lags["yaw"],
        lags["pitch"],
        {"yaw": DEFAULT_DISTURBANCE, "pitch": DEFAULT_DISTURBANCE},
    )


def is_robust(shape: LoopStructure, gains: Gains, vehicles: Sequence[DesignModel]) -> bool:
    """Whether at least ``MIN_STABLE_FRACTION`` of the vehicles keep the least margins; ends where
    too many have not."""
    spare = (1.0 - MIN_STABLE_FRACTION) * len(vehicles)
    for vehicle in vehicles:
        found = loop_margins(shape, gains, vehicle)
        if found.gm_db < MIN_GM_DB or found.pm_deg < MIN_PM_DEG:
            spare -= 1.0
            if spare < 0.0:
                return False
    return True


class LoopMargins(NamedTuple):
    """A loop on one vehicle; margins at the cut where they are least."""

    damping: float
    """Least of the oscillating poles."""
    gm_db: float
    pm_deg: float


def loop_margins(shape: LoopStructure, gains: Gains, vehicle: DesignModel) -> LoopMargins:
    """Margins of an unstable loop count as nothing."""
    margins = [loop_transfer.margins(cut) for cut in shape.cuts(vehicle, gains).values()]
    damping = float(
        root_locus.damping(loop_transfer.poles(shape.closed(vehicle, gains))[None, :])[0]
    )
    if damping <= 0.0:
        return LoopMargins(damping, 0.0, 0.0)
    return LoopMargins(damping, min(m.gm_db for m in margins), min(m.pm_deg for m in margins))


class LoopRobustness(NamedTuple):
    """A loop over the prior: the ``LOW_QUANTILE`` quantile of each figure."""

    damping: float
    gm_db: float
    pm_deg: float
    stable: float
    """Share of the vehicles."""
    vehicles: int


def loop_robustness(
    shape: LoopStructure, gains: Gains, vehicles: Sequence[DesignModel]
) -> LoopRobustness:
    found = [loop_margins(shape, gains, vehicle) for vehicle in vehicles]
    damping, gm_db, pm_deg = np.quantile(np.array(found), LOW_QUANTILE, axis=0).tolist()
    stable = float(np.mean([each.damping > 0.0 for each in found]))
    return LoopRobustness(damping, gm_db, pm_deg, stable, len(found))
