"""Runs as the fit sees them, and what a candidate vehicle leaves unexplained of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import Plane, Run
from sysid.estimation.map.coupling_inputs import cross_plane_inputs
from sysid.estimation.map.steady_state import cruise_speed_mps
from sysid.models import greybox, linear_planes, parameters
from sysid.models.greybox import InitialMotion
from sysid.models.linear_planes import LinearPlane
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]

STRIDE = 5
"""Samples of the 50 Hz grid in one step of the fit: 10 Hz, five times above anything the vehicle
does."""

DUCT_SETTLING_S, MAX_START_S = 3.0, -1.0
"""Start of a run that only tells where the duct stands: the loops keep it moving, and it follows
late. Taken for standing where it was told to be, it pulled lag and effectiveness away by one
standard deviation, in every campaign."""


class Dataset(NamedTuple):
    """One run as the fit sees it."""

    run: Run
    start: InitialMotion
    measured: Array
    """(samples, outputs) at 10 Hz, each the mean of the samples around it: rate, angle, and depth
    in pitch."""
    around: Array | None = None
    """What the rest of the vehicle did meanwhile, as ``greybox.integrate`` takes it."""


def dataset(run: Run) -> Dataset:
    """A run as the fit takes it: from where the duct is known on."""
    run = run.since(max(run.time_s[0], min(run.time_s[0] + DUCT_SETTLING_S, MAX_START_S)))
    columns = [run.rate_radps, run.heading_rad if run.plane == "yaw" else run.pitch_rad]
    if run.plane == "pitch":
        columns.append(run.depth_m)
    return Dataset(
        run, greybox.initial_motion(run), np.column_stack([_decimate(c) for c in columns])
    )


def with_coupling_inputs(vehicle: CandidateVehicle, what: Dataset) -> Dataset:
    """The same with its surroundings, as ``vehicle`` tells them from what was measured."""
    run, speed_mps = what.run, cruise_speed_mps(vehicle, float(what.run.thrust[0]))
    if not run.both:
        return what._replace(around=greybox.heave_coupling(run, speed_mps))
    other: Plane = "pitch" if run.plane == "yaw" else "yaw"
    return what._replace(
        around=cross_plane_inputs(
            run, linear_plane(vehicle, other), vehicle.actuators[other], speed_mps
        )
    )


def _decimate(values: Array) -> Array:
    """Centred means of STRIDE samples at every STRIDE-th sample; the ends repeat what they have."""
    padded = np.pad(values, STRIDE // 2, mode="edge")
    return np.convolve(padded, np.full(STRIDE, 1.0 / STRIDE), mode="valid")[::STRIDE]


def linear_plane(vehicle: CandidateVehicle, plane: Plane) -> LinearPlane:
    """Small-signal plane of a candidate at its operating point."""
    config = vehicle.config
    c, speed, mass = (
        parameters.to_table_1_column(config.linear),
        config.operating_point.speed_mps,
        config.ballast.mass_kg,
    )
    if plane == "yaw":
        return linear_planes.yaw_plane(c, speed, mass)
    return linear_planes.pitch_plane(c, speed, mass, config.water.gravity_mps2)


def residuals(vehicle: CandidateVehicle, experiments: Sequence[Dataset]) -> list[Array]:
    """Measured less simulated of each run, (samples, outputs)."""
    thrusts = {float(e.run.thrust[0]) for e in experiments}
    speeds_mps = {thrust: cruise_speed_mps(vehicle, thrust) for thrust in thrusts}
    return [_residual(vehicle, e, speeds_mps[float(e.run.thrust[0])]) for e in experiments]


def _residual(vehicle: CandidateVehicle, what: Dataset, speed_mps: float) -> Array:
    actuator = vehicle.actuators[what.run.plane]
    motion = greybox.simulate(
        vehicle.model, actuator, what.run, what.start, STRIDE, speed_mps, what.around
    )
    columns = [motion.rate_radps, motion.angle_rad]
    if what.run.plane == "pitch":
        columns.append(motion.depth_m)
    return what.measured - np.column_stack(columns)
