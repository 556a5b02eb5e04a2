"""What the rest of the vehicle does while both surfaces are tested: a known input to the plane that
is simulated.

The planes are then no longer strangers: drag across the hull turns with the flow, speed is lost in
both, and pitch turns yaw rate into more heading. Rates, roll and pitch are measured; the speed
across the other plane, which nothing measures, follows from its rate and its surface by that
plane's own force equation."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from sysid.data.segments import RATE_HZ, Run
from sysid.models import greybox
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane

Array = NDArray[np.float64]


def cross_plane_inputs(run: Run, other: LinearPlane, actuator: Actuator, speed_mps: float) -> Array:
    """Surroundings (samples, greybox.AROUND) of one plane's half of a test of both, on the run's
    grid.

    ``other`` and ``actuator`` are of the plane that is not simulated. The mean of heave, which
    buoyancy has a hand in, comes from pitch and depth."""
    is_yaw = run.plane == "yaw"
    duct = greybox.duct_along(run, "pitch" if is_yaw else "yaw", actuator)
    rate = run.q_radps if is_yaw else run.r_radps
    across, pitch = cross_speed_mps(other, rate, duct), 0.0 * rate
    if (standing := greybox.heave_coupling(run, speed_mps)) is not None:
        across, pitch = across - np.mean(across) - np.mean(standing[:, 0]), run.pitch_rad
    return np.column_stack([-across, -rate, -pitch, run.p_radps, run.roll_rad, duct])


def cross_speed_mps(plane: LinearPlane, rate_radps: Array, duct_rad: Array) -> Array:
    """Sway or heave in MAVLink's axes under a measured rate and duct angle, from where it would
    settle under both."""
    pushed = plane.A[0, 1] * rate_radps + plane.B[0] * duct_rad
    decay = float(np.exp(plane.A[0, 0] / RATE_HZ))
    settled = pushed[0] / -plane.A[0, 0]
    late = np.concatenate(([pushed[0]], pushed[:-1]))
    across, _ = lfilter(
        [(1.0 - decay) / -plane.A[0, 0]], [1.0, -decay], late, zi=np.array([decay * settled])
    )
    return np.asarray(across)
