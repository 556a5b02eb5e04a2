"""What an anomaly would add to a run's residuals: the run simulated with it, less the run without.

A slip is a step of the surface that the command does not know; a gust is told by the slip and the return 5 s later
that would push as hard. Both may come at any time, so there is one signature a second.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import propeller
from sysid import fit, greybox, noise, planes
from sysid.fit import Experiment
from sysid.noise import Filter
from sysid.parameters import Vehicle
from sysid.runs import RATE_HZ, Run

Array = NDArray[np.float64]
Kind = Literal["actuator slip", "actuator offset", "gain error", "gust", "speed off"]

EVERY_S = 1.0
"""Between the times at which a slip or a gust is looked for."""
MARGIN_S = 2.0
"""From the ends of a run: what happens there leaves no trace, or is the start itself."""
GUST_S = 5.0
SMALL_RAD, SMALL_SHARE = math.radians(0.1), 0.01
"""The anomalies simulated: small, so that the signature is a slope."""


class Signature(NamedTuple):
    """Of one kind of anomaly in one run."""

    kind: Kind
    times_s: Array
    """(k,) since the test began, when the duct first felt it; NaN for what lasts throughout."""
    white: Array
    """(k, samples x outputs): whitened residual per unit of ``size``."""
    unit: Literal["deg", "%", "deg/s2"]


def signatures(vehicle: Vehicle, what: Experiment, by: Filter) -> list[Signature]:
    """All that are looked for; angles at the duct in degrees, accelerations in deg/s^2, errors in percent."""
    run, actuator = what.run, vehicle.actuators[what.run.plane]
    speed_mps = fit.cruise_speed_mps(vehicle, float(run.thrust[0]))
    duct = greybox.duct_angles(run.command_rad, actuator, 1.0 / RATE_HZ)
    stretched = greybox.duct_angles(run.command_rad + SMALL_SHARE * _away_rad(run), actuator, 1.0 / RATE_HZ)
    times_s = np.arange(run.time_s[0] + MARGIN_S, run.time_s[-1] - MARGIN_S, EVERY_S)

    def flown(duct_rad: Array, faster: float = 1.0) -> Array:
        first = greybox.first_state(run, what.start, faster * speed_mps)
        return _outputs(vehicle, what, first, duct_rad, faster)

    before = flown(duct)
    slips = [flown(duct + SMALL_RAD * (run.time_s >= time_s - 1e-9)) for time_s in times_s]
    lasting = [flown(duct + SMALL_RAD), flown(stretched), flown(duct, 1.0 + SMALL_SHARE)]
    white = np.stack([noise.whitened(after - before, by).ravel() for after in (*slips, *lasting)])
    white[:-2] /= math.degrees(SMALL_RAD)
    white[-2:] /= 100.0 * SMALL_SHARE
    *slip, offset, gain, speed = white
    always = np.array([math.nan])
    return [
        Signature("actuator slip", times_s, np.array(slip), "deg"),
        Signature("gust", times_s, _pulses(np.array(slip)) / _push_per_s2(vehicle, run), "deg/s2"),
        Signature("actuator offset", always, offset[None], "deg"),
        Signature("gain error", always, gain[None], "%"),
        Signature("speed off", always, speed[None], "%"),
    ]


def _outputs(vehicle: Vehicle, what: Experiment, first: Array, duct_rad: Array, faster: float) -> Array:
    """Rate, angle and, in pitch, depth of the run, (samples, outputs); depth from anywhere, as only moves count."""
    run, model = what.run, vehicle.model
    rps, inverse = faster * run.thrust * propeller.rps(1.0, model), greybox.constraint(model, run.plane)
    track = greybox.integrate(
        first, duct_rad, rps, fit.STRIDE, 1.0 / RATE_HZ, run.plane == "yaw", inverse, model, what.around
    )
    return -track[:, 2 : 2 + what.measured.shape[1]]


def departure_rad(run: Run) -> Array:
    """How far a test moved its surface from where the loop had held it, from the start of the test on."""
    return _away_rad(run)[~run.preroll]


def _away_rad(run: Run) -> Array:
    """Of the command, from where the loop held it before the test."""
    return run.command_rad - (np.mean(run.command_rad[run.preroll]) if run.preroll.any() else run.trim_rad)


def _pulses(steps: Array) -> Array:
    late = int(GUST_S / EVERY_S)
    back = np.zeros_like(steps)
    back[:-late] = steps[late:]
    return steps - back


def _push_per_s2(vehicle: Vehicle, run: Run) -> float:
    """Angular acceleration per unit of duct angle."""
    return planes.small_signal(fit.linear_plane(vehicle, run.plane)).b1_per_s2
