"""Faults of the actuators: the two tailcone axes and the propeller shaft."""

from __future__ import annotations

from math import isnan, radians
from typing import NamedTuple

from numpy.random import Generator

from sitl.core.tailcone import TailconeAxis
from sitl.faults.timeline import Running

MIN_STEP_RAD = radians(0.1)
"""Step of a slipping axis whose vehicle file gives none: a common stepper motor with its gear."""


class Drives(NamedTuple):
    """Axis parameters and the controls that reach the drives."""

    rudder: TailconeAxis
    elevator: TailconeAxis
    controls: tuple[float, ...]
    """Rudder, elevator and thrust in [-1, 1]."""


def apply(
    drives: Drives, running: tuple[Running, ...], noise: Generator
) -> tuple[Drives, tuple[Running, ...]]:
    """Apply ``running`` faults to the drives; return them with the new fault states."""
    updated = list(running)
    for index, item in enumerate(running):
        unit, kind, sizes = item.fault.unit, item.fault.kind, item.fault.sizes
        rudder, elevator, thrust = drives.controls
        if unit == "rudder":
            axis, control = _apply_to_axis(drives.rudder, rudder, kind, sizes, noise)
            drives = drives._replace(rudder=axis, controls=(control, elevator, thrust))
        elif unit == "elevator":
            axis, control = _apply_to_axis(drives.elevator, elevator, kind, sizes, noise)
            drives = drives._replace(elevator=axis, controls=(rudder, control, thrust))
        elif unit == "propeller":
            if item.fault.kind == "stuck" and item.memory.values is None:
                item = item._replace(memory=item.memory._replace(values=(thrust,)))
                updated[index] = item
            drives = drives._replace(controls=(rudder, elevator, _shaft_thrust(thrust, item)))
    return drives, tuple(updated)


def _shaft_thrust(thrust: float, running: Running) -> float:
    """Return the thrust control under a propeller fault."""
    if running.fault.kind == "stuck" and running.memory.values is not None:
        return running.memory.values[0]
    return 0.0 if running.fault.kind == "off" else thrust


def _apply_to_axis(
    axis: TailconeAxis, control: float, kind: str, sizes: tuple[float, ...], noise: Generator
) -> tuple[TailconeAxis, float]:
    """Return the axis parameters and the control of an axis under a fault."""
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
