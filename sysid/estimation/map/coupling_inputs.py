"""Motion of the other plane as a known input of the simulated plane, for tests of both surfaces.

In a test of both surfaces the planes are coupled: cross-flow drag turns with the direction of the
flow, both planes reduce the speed, and pitch changes the ratio of yaw rate to heading rate. Rates,
roll and pitch are measured. Sway or heave of the other plane is not measured; it follows from rate
and duct angle by the force equation of that plane.
"""

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import RATE_HZ, Run
from sysid.models import greybox
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane
from sysid.planes import PLANES
from sysid.signal_processing import filter_recursively

Array = NDArray[np.float64]


def cross_plane_inputs(run: Run, other: LinearPlane, actuator: Actuator, speed_mps: float) -> Array:
    """Compute the motion of the other plane during a test of both surfaces.

    Parameters
    ----------
    run : Run
        Half of the test that belongs to the simulated plane.
    other : LinearPlane
        Small-signal model of the plane that is not simulated.
    actuator : Actuator
        Actuator of the plane that is not simulated.
    speed_mps : float
        Steady speed, m/s.

    Returns
    -------
    ndarray, (samples, N_COUPLING)
        Sway or heave (m/s), rate (rad/s), pitch (rad), roll rate (rad/s), roll (rad), duct angle
        (rad) and measured speed (m/s) on the run's grid; signs as `greybox.integrate` expects them.

    Notes
    -----
    The mean of heave depends on buoyancy; it is computed from pitch and depth instead.
    """
    other_plane = PLANES[run.plane].other
    duct = greybox.duct_along(run, other_plane, actuator)
    rate = run.in_plane(other_plane).rate_radps
    across, pitch = cross_speed_mps(other, rate, duct), 0.0 * rate
    known = greybox.known_inputs(run, speed_mps)
    if PLANES[run.plane].is_yaw:
        across, pitch = across - np.mean(across) - np.mean(known[:, 0]), run.pitch_rad
    return np.column_stack(
        [-across, -rate, -pitch, run.p_radps, run.roll_rad, duct, known[:, greybox.SPEED]]
    )


def cross_speed_mps(plane: LinearPlane, rate_radps: Array, duct_rad: Array) -> Array:
    """Return sway or heave of a plane for a measured rate and duct angle, m/s, in MAVLink's axes.

    v' = A00 v + u with u = A01 r + B0 delta held over a sample h = 1 / RATE_HZ, from its
    equilibrium::

        v[k+1] = e^(A00 h) v[k] + (1 - e^(A00 h)) / (-A00) u[k],    v[0] = u[0] / (-A00)
    """
    forcing = plane.A[0, 1] * rate_radps + plane.B[0] * duct_rad
    decay = float(np.exp(plane.A[0, 0] / RATE_HZ))
    equilibrium = forcing[0] / -plane.A[0, 0]
    previous_forcing = np.concatenate(([forcing[0]], forcing[:-1]))
    return filter_recursively(
        numerator=np.array([(1.0 - decay) / -plane.A[0, 0], 0.0]),
        denominator=np.array([1.0, -decay]),
        values=previous_forcing,
        state=np.array([decay * equilibrium]),
    )
