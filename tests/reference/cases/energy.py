"""Energy.

Verifies: that mechanical energy of body and added mass is constant without damping, that the energy
of a vehicle without thrust in still water never increases, and that this holds for any vehicle.
Leaves out: thrust; the surface, where waves would carry energy away.
Reference: conservation; the second law. Sixty random vehicles, ring-ducted and finned, each at 40
random motions and through a minute of free flight. Tolerance: 1e-6 of the energy moved for
conservation; rounding for gains.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle import config
from sitl.vehicle.model import VehicleModel
from tests.reference import energy, vehicles
from tests.reference.check import Check, worst
from tests.sitl.vehicle import flight

MOTIONS, STEP_S = 40, 0.001


def checks() -> Iterator[Check]:
    """Yield the checks of conservation, then of loss."""
    start = flight.tumbling()
    for name in config.SHIPPED:
        model = flight.without_fluid_forces(flight.model(name))
        kept = energy.mechanical_j(model, flight.fly(model, start, 100.0, dt_s=STEP_S)[::500])
        yield worst(
            f"{name}, kept for 100 s undamped", "part", kept / kept[0], 1.0, 1e-6, "conservation"
        )
        yield from _lost(name, [flight.model(name)])
    yield from _lost(f"{vehicles.FLEET} random vehicles", vehicles.fleet())


def _lost(label: str, models: list[VehicleModel]) -> Iterator[Check]:
    """Return the largest gain of energy of all motions; zero is expected."""
    rng = np.random.default_rng(3)
    power, gain = 0.0, 0.0
    for model in models:
        for nu in rng.normal(size=(MOTIONS, 6)) * 10 ** rng.uniform(-3, 0.5, (MOTIONS, 1)):
            power = max(power, energy.power_w(model, nu) / energy.power_scale_w(model, nu))
        kept = energy.mechanical_j(model, flight.fly(model, flight.tumbling(), 60.0)[::20])
        gain = max(gain, float(np.diff(kept).max()) / kept[0])
    yield Check(f"{label}, largest power gained", "part", power, 0.0, 1e-12, "second law")
    yield Check(f"{label}, largest energy gained", "part", gain, 0.0, 1e-12, "second law")
