"""What an anomaly would add to a run's residuals: the run simulated with it, less the run without.

A slip is a step of the surface that the command does not know; a gust is told by the slip and the return 5 s later
that would push as hard. Both may come at any time, so there is one signature a second.
"""

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid import fit, noise, planes
from sysid.fit import Experiment
from sysid.noise import Filter
from sysid.parameters import Vehicle
from sysid.runs import Run

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
    """(k,) of the run, when the anomaly begins; NaN for one that lasts throughout."""
    white: Array
    """(k, samples x outputs): whitened residual per unit of ``size``."""
    unit: Literal["deg", "%", "deg/s2"]


def signatures(vehicle: Vehicle, what: Experiment, by: Filter) -> list[Signature]:
    """All that are looked for; angles at the duct in degrees, accelerations in deg/s^2, errors in percent."""
    run = what.run
    times_s = np.arange(run.time_s[0] + MARGIN_S, run.time_s[-1] - MARGIN_S, EVERY_S)
    size = _away_from_stops(run)
    moved = [_moved(run, time_s, size) for time_s in times_s]
    lasting = [_moved(run, -math.inf, size), _stretched(run), replace(run, thrust=run.thrust * (1.0 + SMALL_SHARE))]
    before, *after = fit.residuals(vehicle, [fit.experiment(r) for r in (run, *moved, *lasting)])
    white = np.stack([noise.whitened(before - residual, by).ravel() for residual in after])
    degree, percent = math.degrees(size), 100.0 * SMALL_SHARE
    slips, (offset, gain, speed) = white[: times_s.size] / degree, white[times_s.size :]
    return [
        Signature("actuator slip", times_s, slips, "deg"),
        Signature("gust", times_s, _pulses(slips) / _push_per_s2(vehicle, run), "deg/s2"),
        Signature("actuator offset", np.array([math.nan]), offset[None] / degree, "deg"),
        Signature("gain error", np.array([math.nan]), gain[None] / percent, "%"),
        Signature("speed off", np.array([math.nan]), speed[None] / percent, "%"),
    ]


def _away_from_stops(run: Run) -> float:
    """A small angle, of the sign that the stops allow: what slips slips behind them."""
    return -math.copysign(SMALL_RAD, float(run.command_rad[np.argmax(np.abs(run.command_rad))]))


def _moved(run: Run, time_s: float, angle_rad: float) -> Run:
    return _commanded(run, run.command_rad + np.where(run.time_s >= time_s - 1e-9, angle_rad, 0.0))


def _stretched(run: Run) -> Run:
    """Every departure from the trim a little larger."""
    return _commanded(run, run.command_rad + SMALL_SHARE * (run.command_rad - _held_rad(run)))


def departure(run: Run) -> Array:
    """How far a test moved its surface from where the loop had held it, from the start of the test on."""
    return (run.command_rad - _held_rad(run))[~run.preroll]


def _held_rad(run: Run) -> float:
    return float(np.mean(run.command_rad[run.preroll])) if run.preroll.any() else run.trim_rad


def _commanded(run: Run, command_rad: Array) -> Run:
    return replace(run, rudder_rad=command_rad) if run.plane == "yaw" else replace(run, elevator_rad=command_rad)


def _pulses(steps: Array) -> Array:
    late = int(GUST_S / EVERY_S)
    back = np.zeros_like(steps)
    back[:-late] = steps[late:]
    return steps - back


def _push_per_s2(vehicle: Vehicle, run: Run) -> float:
    """Angular acceleration per unit of duct angle."""
    return planes.small_signal(fit.linear_plane(vehicle, run.plane)).b1_per_s2
