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
from sysid.design.design_model import ASSUMED_SEA, Plant, assembled, sampled
from sysid.design.initial.loop_structure import Shape
from sysid.models import parameters
from sysid.models.linear_planes import LinearPlane
from sysid.models.parameters import NAMES, Vehicle

Array = NDArray[np.float64]

UNBIASED: dict[Plane, float] = {"yaw": 0.0, "pitch": 0.0}
VEHICLES = 120
SEED = 1957
LEAST_GM_DB, LEAST_PM_DEG = 3.0, 20.0
"""What a vehicle that is not the nominal one must keep, and be stable."""
SHARE = 0.9
"""Of the vehicles, at least."""
LOW = 0.05
"""Quantile that stands for a bad one."""


def nominal(config: VehicleConfig) -> Plant:
    """As the file gives her, in an assumed sea. Raises VehicleError."""
    return _plant(parameters.vehicle(config, UNBIASED, np.zeros(len(NAMES))))


def drawn(config: VehicleConfig, count: int = VEHICLES) -> Iterator[Plant]:
    """Up to ``count`` vehicles by the prior of identification, without those that cannot be."""
    draws = np.random.default_rng(SEED).standard_normal((count, len(NAMES)))
    mean, covariance = np.zeros(len(NAMES)), parameters.prior_covariance()
    for each in parameters.possible(
        lambda z: parameters.vehicle(config, UNBIASED, z), mean, covariance, draws
    ):
        yield _plant(each.vehicle)


def _plant(vehicle: Vehicle) -> Plant:
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
    lags = {plane: sampled(tail) for plane, tail in vehicle.actuators.items()}
    return assembled(
        Planes(yaw, pitch), lags["yaw"], lags["pitch"], {"yaw": ASSUMED_SEA, "pitch": ASSUMED_SEA}
    )


def enough_hold(shape: Shape, gains: Gains, vehicles: Sequence[Plant]) -> bool:
    """Whether at least ``SHARE`` of the vehicles keep the least margins; ends where too many have
    not."""
    spare = (1.0 - SHARE) * len(vehicles)
    for vehicle in vehicles:
        found = stands(shape, gains, vehicle)
        if found.gm_db < LEAST_GM_DB or found.pm_deg < LEAST_PM_DEG:
            spare -= 1.0
            if spare < 0.0:
                return False
    return True


class Stands(NamedTuple):
    """A loop on one vehicle; margins at the cut where they are least."""

    damping: float
    """Least of the oscillating poles."""
    gm_db: float
    pm_deg: float


def stands(shape: Shape, gains: Gains, vehicle: Plant) -> Stands:
    """Margins of an unstable loop count as nothing."""
    margins = [loop_transfer.margins(cut) for cut in shape.cuts(vehicle, gains).values()]
    damping = float(
        root_locus.damping(loop_transfer.poles(shape.closed(vehicle, gains))[None, :])[0]
    )
    if damping <= 0.0:
        return Stands(damping, 0.0, 0.0)
    return Stands(damping, min(m.gm_db for m in margins), min(m.pm_deg for m in margins))


class Held(NamedTuple):
    """A loop over the prior: the ``LOW`` quantile of each figure."""

    damping: float
    gm_db: float
    pm_deg: float
    stable: float
    """Share of the vehicles."""
    vehicles: int


def held(shape: Shape, gains: Gains, vehicles: Sequence[Plant]) -> Held:
    found = [stands(shape, gains, vehicle) for vehicle in vehicles]
    damping, gm_db, pm_deg = np.quantile(np.array(found), LOW, axis=0).tolist()
    stable = float(np.mean([each.damping > 0.0 for each in found]))
    return Held(damping, gm_db, pm_deg, stable, len(found))
