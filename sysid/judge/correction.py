"""What runs that were not fitted would change about a model's response at crossover: its gain and its phase.

Two changes are put to the held-out runs: every command's effect grown by a factor, and the delay grown. Both enter
linearly for small changes, so generalised least squares on innovations that are white gives them at once, with
standard deviations that hold in a coloured sea. A constant offset of the surface is left free in every run.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sysid import fit, noise
from sysid.fit import STRIDE, Experiment
from sysid.judge.records import Correction
from sysid.noise import Noise
from sysid.parameters import Vehicle
from sysid.runs import RATE_HZ, Plane, Run

Array = NDArray[np.float64]

GAIN_STEP, DELAY_STEP_S, OFFSET_STEP_RAD = 0.02, 0.02, math.radians(0.05)
"""Of the finite differences: small against what they look for, large against rounding."""


def correction(
    vehicle: Vehicle, plane: Plane, level: Noise, runs: Sequence[Run], crossover_radps: float
) -> Correction | None:
    """Of the response from command to rate at ``crossover_radps``; None without runs of the plane."""
    experiments = [fit.experiment(run) for run in runs if run.plane == plane]
    if not experiments:
        return None
    by = noise.build(
        fit.linear_plane(vehicle, plane), level, STRIDE / RATE_HZ, max(len(e.measured) for e in experiments)
    )

    def white(candidate: Vehicle, of: Sequence[Experiment]) -> list[Array]:
        return [noise.whitened(residual, by).ravel() for residual in fit.residuals(candidate, of)]

    base = white(vehicle, experiments)
    grown = white(vehicle, [_grown(e) for e in experiments])
    later = white(_moved(vehicle, plane, DELAY_STEP_S, 0.0), experiments)
    offset = white(_moved(vehicle, plane, 0.0, OFFSET_STEP_RAD), experiments)
    information, gradient = np.zeros((2, 2)), np.zeros(2)
    for residual, more, late, off in zip(base, grown, later, offset, strict=True):
        slopes = np.column_stack([(more - residual) / GAIN_STEP, (late - residual) / DELAY_STEP_S])
        free = (off - residual) / OFFSET_STEP_RAD
        free /= np.linalg.norm(free)
        slopes -= np.outer(free, free @ slopes)
        information += slopes.T @ slopes
        gradient -= slopes.T @ residual
    covariance = np.linalg.inv(information)
    gain, delay_s = covariance @ gradient
    gain_sd, delay_sd_s = np.sqrt(np.diag(covariance))
    per_db, per_deg = 20.0 / math.log(10.0), math.degrees(crossover_radps)
    return Correction(
        gain_db=float(per_db * gain),
        gain_sd_db=float(per_db * gain_sd),
        phase_deg=float(-per_deg * delay_s),
        phase_sd_deg=float(per_deg * delay_sd_s),
    )


def _grown(what: Experiment) -> Experiment:
    """The same measurements under commands that depart further from where they stood before the test."""
    run = what.run
    command = run.command_rad
    rest = float(np.mean(command[run.preroll])) if run.preroll.any() else float(command[0])
    grown = command + GAIN_STEP * (command - rest)
    if run.plane == "yaw":
        return what._replace(run=replace(run, rudder_rad=grown))
    return what._replace(run=replace(run, elevator_rad=grown))


def _moved(vehicle: Vehicle, plane: Plane, delay_s: float, offset_rad: float) -> Vehicle:
    actuator = vehicle.actuators[plane]
    moved = actuator._replace(delay_s=actuator.delay_s + delay_s, bias_rad=actuator.bias_rad + offset_rad)
    return vehicle._replace(actuators={**vehicle.actuators, plane: moved})
