"""Noise filters of runs, linearised about the motion of each run.

In a turn crossflow drag damps a disturbance much more than on a straight course. A vehicle that is
nearly neutral on course integrates a disturbance there, and in a turn it does not. With the filter
about level flight the residuals of `remus100` have twice the power that the filter assumes at the
low frequencies of a slip: clean runs look anomalous, and the intervals of the fit are too narrow.
"""

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np

from sysid.data.runs import RATE_HZ
from sysid.estimation.map import sensitivity
from sysid.estimation.map.datasets import STEP_S, STRIDE, Dataset, cruise_speeds_mps
from sysid.estimation.map.sensitivity import Trajectory
from sysid.estimation.map.steady_state import linear_plane
from sysid.models import greybox, noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane

HOLD_S = 0.5
"""Duration of a segment with one linear model: short against the turns of a test, s."""


def manoeuvre_filters(
    vehicle: CandidateVehicle,
    datasets: Mapping[Plane, Sequence[Dataset]],
    levels: Mapping[Plane, Noise],
) -> dict[Plane, tuple[Filter, ...]]:
    """Build the noise filter of every run, linearised about its simulated motion.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Fitted vehicle.
    datasets : mapping of Plane to sequence of Dataset
        Runs of each plane.
    levels : mapping of Plane to Noise
        Noise levels of each plane.

    Returns
    -------
    dict
        Filters of each plane, in the order of its runs.
    """
    hold = round(HOLD_S * RATE_HZ / STRIDE)
    speeds_mps = cruise_speeds_mps(vehicle, chain.from_iterable(datasets.values()))
    filters = {}
    for plane, group in datasets.items():
        trajectories = sensitivity.simulate(vehicle, plane, group, STRIDE, speeds_mps)
        level = linear_plane(vehicle, plane)
        filters[plane] = tuple(
            noise.build_along(
                _planes_along(vehicle, plane, level, trajectory, hold),
                levels[plane],
                STEP_S,
                len(trajectory.track),
                hold,
            )
            for trajectory in trajectories
        )
    return filters


def _planes_along(
    vehicle: CandidateVehicle, plane: Plane, level: LinearPlane, trajectory: Trajectory, hold: int
) -> list[LinearPlane]:
    """Return the linear model in the middle of every segment of ``hold`` rows.

    Forward speed is an input here, as in level flight.
    """
    is_yaw, inverse = PLANES[plane].is_yaw, greybox.constraint(vehicle.model, plane)
    rows = len(trajectory.track)
    planes = []
    for first in range(0, rows, hold):
        row = min(first + hold // 2, rows - 1)
        inputs = np.concatenate(
            [[trajectory.duct_rad[row * STRIDE]], trajectory.cross_plane_inputs[row]]
        )
        rps = float(trajectory.thrust[row]) * vehicle.model.propeller.full_rps
        slopes = greybox.slopes_about(
            trajectory.track[row], inputs, rps, is_yaw, inverse, vehicle.model
        )[1]
        # States (u, v|w, rate, angle, z) without u. From FLU to FRD all of them change their sign.
        size = len(level.A)
        planes.append(level._replace(A=np.ascontiguousarray(slopes[1 : 1 + size, 1 : 1 + size])))
    return planes
