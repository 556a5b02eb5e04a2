"""Linear against nonlinear for small motion.

Verifies: that the nonlinear vehicle follows the linear yaw and pitch planes, which control design
and identification use, for small duct angles. Leaves out: quadratic drag and lift, which vanish
with the motion; roll and surge, which the planes do not contain: weight equals buoyancy and the
centre of mass is coupled only to pitch. Reference: x(t) of x' = A x + B delta for a
step, by the matrix exponential, A and B differentiated from the equations of motion. Tolerance:
1e-4 of the largest response at a microradian over seven hull lengths, 1e-2 at a hundred: what is
left out grows with the angle.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sitl.vehicle import config
from sitl.vehicle.linearise import LinearisedPlane, linearise
from sitl.vehicle.model import VehicleModel
from tests.reference.check import Check
from tests.sitl.vehicle import flight

LENGTHS, STEP_S = 7.0, 0.005
ANGLES = ((1e-6, 1e-4), (1e-4, 1e-2))
"""Step of the duct in rad, and how near to linear it must be."""
SOURCE = "matrix exponential"


def checks() -> Iterator[Check]:
    """Each shipped vehicle, each plane."""
    for name in config.SHIPPED:
        model, point = flight.model(name), config.load(name).operating_point
        planes = linearise(model, point.speed_mps, point.thrust_fraction)
        for plane, label, columns in (
            (planes.yaw, "yaw", (8, 12)),
            (planes.pitch, "pitch", (9, 11)),
        ):
            seconds = LENGTHS * 2 * model.hydrostatics.half_length_m / point.speed_mps
            linear = _step_response(plane, seconds)[:, :2]
            for angle, tolerance in ANGLES:
                miss = _miss(model, point, label, columns, angle, linear)
                yield Check(
                    f"{name}, {label} step of {angle} rad", "part", miss, 0.0, tolerance, SOURCE
                )


def _miss(
    model: VehicleModel,
    point: config.OperatingPoint,
    label: str,
    columns: tuple[int, int],
    angle_rad: float,
    linear: NDArray[np.float64],
) -> float:
    """Largest difference of speed and rate, in parts of the largest linear response."""
    rudder_rad, elevator_rad = (angle_rad, 0.0) if label == "yaw" else (0.0, angle_rad)
    start = flight.cruising(point.speed_mps)
    track = flight.fly(
        _planar(model),
        start,
        (len(linear) - 1) * STEP_S,
        rudder_rad,
        elevator_rad,
        point.thrust_fraction,
        dt_s=STEP_S,
    )
    difference = track[:, columns] / angle_rad - linear
    return float(np.max(np.abs(difference) / np.abs(linear).max(axis=0)))


def _planar(model: VehicleModel) -> VehicleModel:
    """Neutrally buoyant, and nothing couples surge or roll with either plane."""
    h, M = model.hydrostatics, np.diag(np.diag(model.inertia.M))
    for pair in ([1, 5], [2, 4]):
        M[np.ix_(pair, pair)] = model.inertia.M[np.ix_(pair, pair)]
    inertia = model.inertia._replace(M=M, M_inverse=np.linalg.inv(M).astype(float))
    return model._replace(
        inertia=inertia, hydrostatics=h._replace(buoyancy_n=h.weight_n, x_cm_m=0.0, x_cb_m=0.0)
    )


def _step_response(plane: LinearisedPlane, seconds: float) -> NDArray[np.float64]:
    """States per radian after each step, shape (n + 1, states)."""
    n = len(plane.A)
    exact = expm(np.block([[plane.A, plane.B], [np.zeros((1, n + 1))]]) * STEP_S)
    x, out = np.append(np.zeros(n), 1.0), []
    for _ in range(round(seconds / STEP_S) + 1):
        out.append(x)
        x = exact @ x
    return np.array(out)[:, :n]
