"""Magnetic declination of a vehicle, compared with that of the place where it is."""

import math
from collections.abc import Mapping

from pymavlink import mavextra

from mavlink_io.frames import wrap_pi

PARAMETER = "MAG_DECL_DEG"
MAX_ERROR_DEG = 3.0
"""Error of the declination from which on it is remarked.

The table of the earth's field is right within a degree, except near the poles."""


def remark(parameters: Mapping[str, float], latitude_deg: float, longitude_deg: float) -> str:
    """Return what to change if the declination is that of another place.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the vehicle.
    latitude_deg, longitude_deg : float
        Where the vehicle is.

    Returns
    -------
    str
        Remark; empty if the declination fits, or if the vehicle has no such parameter.
    """
    field = mavextra.get_mag_field_ef(latitude_deg, longitude_deg)
    if PARAMETER not in parameters or field is None:
        return ""
    set_deg, local_deg = parameters[PARAMETER], float(field[0])
    error_deg = math.degrees(wrap_pi(math.radians(set_deg - local_deg)))
    if abs(error_deg) < MAX_ERROR_DEG:
        return ""
    return (
        f"headings are {abs(error_deg):.0f} deg too {'large' if error_deg > 0.0 else 'small'}:"
        f" {PARAMETER} = {set_deg:.1f}, and the declination is {local_deg:.1f} deg at"
        f" {latitude_deg:.1f}, {longitude_deg:.1f}: ground params set {PARAMETER} {local_deg:.1f}"
    )
