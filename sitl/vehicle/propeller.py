"""The propeller in the duct: thrust from shaft speed and axial inflow."""

from __future__ import annotations

from sitl.vehicle.jit import kernel
from sitl.vehicle.model import Propeller, VehicleModel


@kernel
def rps(thrust_fraction: float, model: VehicleModel) -> float:
    """Shaft speed in rev/s for a thrust command of -1..1; the motor controller holds speed, linear
    in the command."""
    return thrust_fraction * model.propeller.full_rps


@kernel
def thrust_n(shaft_rps: float, axial_mps: float, propeller: Propeller) -> float:
    """T = K_T rho n|n| D^4, K_T = K_T0 + J dK_T/dJ, J = V_a/(n D) (paper, "Overall Vehicle
    Modeling"), N.

    Multiplied out, so that it is defined at rest and backwards. ``axial_mps`` is the ring's speed
    along its own axis."""
    return (propeller.thrust_nn_kgm * shaft_rps - propeller.thrust_nv_kg * axial_mps) * abs(
        shaft_rps
    )
