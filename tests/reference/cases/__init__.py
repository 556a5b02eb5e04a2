"""The check-cases, in the order in which the table shows them."""

from tests.reference.cases import (
    ascent,
    coriolis,
    crossflow,
    current,
    energy,
    equilibrium,
    hydrostatics,
    impulse,
    integrator,
    manoeuvres,
    munk,
    ring_wing,
    small_motion,
    straight_run,
    symmetry,
    tumble,
)

CASES = (
    tumble,
    impulse,
    munk,
    coriolis,
    equilibrium,
    hydrostatics,
    ascent,
    crossflow,
    ring_wing,
    current,
    energy,
    symmetry,
    straight_run,
    small_motion,
    manoeuvres,
    integrator,
)
