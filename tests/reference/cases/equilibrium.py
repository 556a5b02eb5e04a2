"""Fall, hover and balance.

Verifies: weight alone, weight with buoyancy and added mass, a body that hovers, and thrust against
drag at the speed that the vehicle file names. Leaves out: the surface; trim in pitch under way.
Reference: Newton; 29.61 N of thrust at 1.3 m/s, which the paper's Table 1 holds (Y_dr = 131 U^2 +
T). Tolerance: rounding; a thousandth of the thrust.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle import config
from sitl.vehicle.propeller import thrust_n
from tests.reference import bodies
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight


def checks() -> Iterator[Check]:
    """Yield the checks of simple bodies, then of shipped vehicles."""
    stone = bodies.rigid_body(12.0, np.zeros(3), np.eye(3))
    stone = stone._replace(
        hydrostatics=stone.hydrostatics._replace(weight_n=12.0 * bodies.GRAVITY_MPS2, z_cm_m=0.0)
    )
    rest = flight.tumbling()
    rest[7:13] = 0.0
    fall = flight.rotation(rest) @ flight.rate(stone, rest)[7:10]
    yield worst(
        "free fall in empty space", "m/s2", fall, [0.0, 0.0, -bodies.GRAVITY_MPS2], 1e-12, "-g"
    )
    hovering = flight.fly(bodies.spheroid(2.0, 0.4), rest, 600.0)[-1]
    yield worst("neutral spheroid, after ten minutes", "SI", hovering, rest, 1e-12, "rest")
    sinker = bodies.spheroid(1.0, 1.0, mass_ratio=2.0)
    sinking = flight.rotation(rest) @ flight.rate(sinker, rest)[7:10]
    yield relative(
        "sphere of twice the density",
        "m/s2",
        sinking[2],
        -0.4 * bodies.GRAVITY_MPS2,
        1e-12,
        "-g / 2.5",
    )
    for name in config.SHIPPED:
        model, point = flight.model(name), config.load(name).operating_point
        state = flight.cruising(point.speed_mps)
        shaft_rps = point.thrust_fraction * model.propeller.full_rps
        thrust = thrust_n(shaft_rps, point.speed_mps, model.propeller)
        surge = flight.rate(model, state, shaft_rps=shaft_rps)[7] * model.inertia.M[0, 0]
        yield Check(
            f"{name}, thrust less drag at {point.speed_mps} m/s",
            "N",
            surge,
            0.0,
            1e-3 * thrust,
            "balance",
        )
        yield relative(
            f"{name}, thrust at {point.speed_mps} m/s",
            "N",
            thrust,
            point.thrust_n,
            1e-9,
            "vehicle file",
        )
