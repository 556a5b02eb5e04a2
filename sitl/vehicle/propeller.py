"""Propeller in the duct: thrust from shaft speed and axial inflow."""

from __future__ import annotations

from mavlink_io.jit import kernel
from sitl.vehicle.model import Propeller, VehicleModel


@kernel
def rps(thrust_fraction: float, model: VehicleModel) -> float:
    """Return the shaft speed that the motor controller holds at a thrust command.

    Parameters
    ----------
    thrust_fraction : float
        Thrust command, -1 (full astern) to 1 (full ahead).
    model : VehicleModel
        The vehicle; its ``propeller.full_rps`` is used.

    Returns
    -------
    float
        Shaft speed, rev/s, linear in the command.
    """
    return thrust_fraction * model.propeller.full_rps


@kernel
def thrust_n(shaft_rps: float, axial_mps: float, propeller: Propeller) -> float:
    """Return the thrust along the ring axis, N, positive forward.

    Parameters
    ----------
    shaft_rps : float
        Shaft speed n, rev/s; negative is astern.
    axial_mps : float
        Speed of the ring through the water along its own axis, m/s, positive forward.
    propeller : Propeller
        Thrust coefficients of the vehicle.

    Returns
    -------
    float
        Thrust, N.

    Notes
    -----
    T = K_T rho n|n| D^4 with K_T = K_T0 + J dK_T/dJ and J = V_a/(n D) (the paper, "Overall Vehicle
    Modeling"). The product is multiplied out to T = (thrust_nn n - thrust_nv V) |n|, which is also
    defined for n = 0 and astern.
    """
    return (propeller.thrust_nn_kgm * shaft_rps - propeller.thrust_nv_kg * axial_mps) * abs(
        shaft_rps
    )
