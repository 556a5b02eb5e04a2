"""Faults of what moves her: the two axes of the tailcone and the shaft of the propeller."""

from __future__ import annotations

from math import isnan, radians
from typing import NamedTuple

from numpy.random import Generator

from sitl.core.tailcone import TailconeAxis
from sitl.faults.timeline import Running

MIN_STEP_RAD = radians(0.1)
"""Of an axis that slips but whose vehicle file knows no steps: a common stepper's behind its
gear."""


class Drives(NamedTuple):
    """The axes as they answer, and what they are asked for as controls in [-1, 1]."""

    rudder: TailconeAxis
    elevator: TailconeAxis
    controls: tuple[float, ...]
    """Rudder, elevator, thrust."""


def apply(
    drives: Drives, running: tuple[Running, ...], noise: Generator
) -> tuple[Drives, tuple[Running, ...]]:
    """The drives under ``running`` faults, which remember what they hold."""
    remembered = list(running)
    for at, each in enumerate(running):
        unit, kind, sizes = each.fault.unit, each.fault.kind, each.fault.sizes
        rudder, elevator, thrust = drives.controls
        if unit == "rudder":
            axis, control = _apply_to_axis(drives.rudder, rudder, kind, sizes, noise)
            drives = drives._replace(rudder=axis, controls=(control, elevator, thrust))
        elif unit == "elevator":
            axis, control = _apply_to_axis(drives.elevator, elevator, kind, sizes, noise)
            drives = drives._replace(elevator=axis, controls=(rudder, control, thrust))
        elif unit == "propeller":
            if each.fault.kind == "stuck" and each.memory.values is None:
                remembered[at] = each = each._replace(memory=each.memory._replace(values=(thrust,)))
            drives = drives._replace(controls=(rudder, elevator, _shaft_thrust(thrust, each)))
    return drives, tuple(remembered)


def _shaft_thrust(thrust: float, running: Running) -> float:
    if running.fault.kind == "stuck" and running.memory.values is not None:
        return running.memory.values[0]
    return 0.0 if running.fault.kind == "off" else thrust


def _apply_to_axis(
    axis: TailconeAxis, control: float, kind: str, sizes: tuple[float, ...], noise: Generator
) -> tuple[TailconeAxis, float]:
    """The axis with a fault, and the control that reaches it."""
    match kind:
        case "off":
            return axis, 0.0
        case "stuck":
            if isnan(sizes[0]):
                return axis._replace(rate_limit_radps=0.0), control
            return axis, sizes[0] / axis.travel_rad
        case "slow":
            return axis._replace(rate_limit_radps=min(axis.rate_limit_radps, sizes[0])), control
        case "biased":
            return axis._replace(bias_rad=axis.bias_rad + sizes[0]), control
        case "noisy":
            return axis._replace(
                bias_rad=axis.bias_rad + sizes[0] * noise.standard_normal()
            ), control
        case _:
            return axis._replace(
                step_rad=axis.step_rad or MIN_STEP_RAD,
                lost_step_chance=sizes[0],
                lost_step_above_radps=0.0,
            ), control
