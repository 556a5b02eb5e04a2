"""Bounds of the peak filters.

A second-order filter with more gain about crossover's lower side has phase lead below its frequency
and phase lag above it, where the loop has phase to spare. At the same margins it permits more gain
where the disturbance of waves is largest.
"""

from sysid.control_analysis.loop_transfer import Gains
from sysid.design.constraints import ConstraintViolation
from sysid.planes import PLANES, Plane

MIN_RATIO, MAX_RATIO = 0.1, 1.0
"""Bounds of the filter's frequency as multiples of the tailcone's natural frequency."""
MIN_DAMPING = {Plane.YAW: 0.5, Plane.PITCH: 0.2}
"""Smallest damping ratio. A narrow filter of the rudder adds a mode of little damping, which is
visible on one sampled vehicle of ten, and gains 1 % of the heading error."""
MAX_DAMPING = 1.0
MIN_GAIN, MAX_GAIN = 0.8, 1.6
"""Bounds of the gain. It limits what the filter changes at other speeds than that of the design."""


def violations(plane: Plane, gains: Gains) -> ConstraintViolation:
    """Return the violations of the bounds of a plane's peak filter; empty without one.

    Parameters
    ----------
    plane : Plane
        Yaw or pitch.
    gains : Gains
        Parameters by name.

    Returns
    -------
    dict
        Relative violation by the name of the bound.
    """
    prefix = PLANES[plane].gain_prefix
    if not gains.get(f"{prefix}_PEAK_W"):
        return {}
    values = {
        "frequency": (gains[f"{prefix}_PEAK_W"] / gains["ACT_LAG_W"], MIN_RATIO, MAX_RATIO),
        "damping": (gains[f"{prefix}_PEAK_Z"], MIN_DAMPING[plane], MAX_DAMPING),
        "gain": (gains[f"{prefix}_PEAK_GAIN"], MIN_GAIN, MAX_GAIN),
    }
    return {
        f"bounds of the peak filter's {name} in {plane}": max(low / value, value / high) - 1.0
        for name, (value, low, high) in values.items()
    }
