"""What bounds the water: ice above and the sea floor below. FLU axes."""

from __future__ import annotations

from sitl.vehicle.kernel import Vector, Vector3, Wrench, kernel
from sitl.vehicle.model import Hydrostatics
from sitl.vehicle.water import Water

CONTACT_STIFFNESS_PER_S2 = 100.0
"""Of each end of the hull, per kilogram of vehicle: ten radians a second, stiff to a vehicle and slow to a step."""
CONTACT_DAMPING_PER_S = 10.0


@kernel
def wrench(state: Vector, up: Vector3, water: Water, hydrostatics: Hydrostatics) -> Wrench:
    """Push of ice or floor on nose and tail where they touch, N and N m: a damped spring that never pulls."""
    reach = abs(up[0]) * hydrostatics.half_length_m + hydrostatics.radius_m
    if state[2] + reach < water.ceiling_m and state[2] - reach > water.floor_m:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    force = moment = 0.0
    mass_kg = hydrostatics.weight_n / hydrostatics.gravity_mps2
    for end in (1.0, -1.0):
        x = end * hydrostatics.half_length_m
        height = state[2] + up[0] * x
        climbing = up[0] * state[7] + up[1] * (state[8] + x * state[12]) + up[2] * (state[9] - x * state[11])
        above = height + hydrostatics.radius_m - water.ceiling_m
        below = water.floor_m - (height - hydrostatics.radius_m)
        push = 0.0
        if above > 0.0:
            push = -max(0.0, CONTACT_STIFFNESS_PER_S2 * above + CONTACT_DAMPING_PER_S * climbing)
        if below > 0.0:
            push += max(0.0, CONTACT_STIFFNESS_PER_S2 * below - CONTACT_DAMPING_PER_S * climbing)
        force += 0.5 * mass_kg * push
        moment += 0.5 * mass_kg * push * x
    return force * up[0], force * up[1], force * up[2], 0.0, -moment * up[2], moment * up[1]
