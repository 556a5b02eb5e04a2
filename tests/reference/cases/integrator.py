"""Order and step of the integrator.

Verifies: that the error of a manoeuvre falls with the fourth power of the step, every force on;
that results do not depend on the step the simulator takes. Leaves out: kinks. Drag in |v| v and
stall have one, so the motion keeps the sign of each speed and stays below stall where the order is
measured. Reference: order four of the classical Runge-Kutta method (Kutta 1901); the same manoeuvre
at a sixteenth of the step. Tolerance: 0.1 of the fitted order; a micrometre and a microdegree after
a minute of turning and diving.
"""

from collections.abc import Iterator

import numpy as np

from sitl.core.timestep import SUBSTEP_S
from sitl.vehicle import config
from tests.reference import fossen
from tests.reference.check import Check, worst
from tests.sitl.vehicle import flight

SECONDS = 0.5
STEPS = (8, 16, 32, 64)
FINEST = 2048
MANOEUVRE = flight.Inputs(rudder_rad=0.1, elevator_rad=0.05, thrust_fraction=0.6)


def checks() -> Iterator[Check]:
    """Order by Richardson's halvings, then the step as flown."""
    for name in config.SHIPPED:
        yield Check(f"{name}, order", "-", _order(name), 4.0, 0.1, "Kutta 1901")
        model, start = flight.model(name), flight.cruising()
        coarse, fine = (
            flight.fly(model, start, 60.0, dt_s=dt, **MANOEUVRE)[-1]
            for dt in (SUBSTEP_S, SUBSTEP_S / 16)
        )
        a, b = fossen.from_state(coarse), fossen.from_state(fine)
        yield worst(f"{name}, place after 60 s", "m", a[:3], b[:3], 1e-6, "a sixteenth of the step")
        yield worst(
            f"{name}, attitude after 60 s",
            "deg",
            np.degrees(a[3:6]),
            np.degrees(b[3:6]),
            1e-6,
            "the same",
        )


def _order(name: str) -> float:
    """Slope of log error over log step."""
    model, start = flight.model(name), flight.cruising(0.0)
    start[7:13] = 1.3, 0.2, 0.15, 0.4, 0.02, -0.02
    finest = flight.fly(model, start, SECONDS, dt_s=SECONDS / FINEST, **MANOEUVRE)[-1]
    steps = [SECONDS / n for n in STEPS]
    errors = [
        np.linalg.norm(flight.fly(model, start, SECONDS, dt_s=dt, **MANOEUVRE)[-1] - finest)
        for dt in steps
    ]
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
