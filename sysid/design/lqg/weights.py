"""Search for LQG weights with the smallest error under disturbance within the limits of the PID."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from sysid.design import constrained_search
from sysid.design.constrained_search import MAX_VIOLATION, ConstrainedProblem, CostAndConstraints
from sysid.design.constraints import Bounds
from sysid.design.lqg import loop_analysis, synthesis
from sysid.design.lqg.controller import ContinuousController
from sysid.design.lqg.loop_analysis import MeasuredPlane
from sysid.design.lqg.synthesis import Weights
from sysid.design.specification import Spec
from sysid.models.noise import Noise
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2

HEADING_STARTS = (
    Weights(effort=0.61, rate_s=1.8, load=0.0019, recovery=0.022, wave=1.0, gyro=0.95),
)
"""Starting weights in heading, suitable for Caribou."""
DEPTH_STARTS = (
    Weights(
        effort=5.9,
        rate_s=12.9,
        load=0.005,
        recovery=0.0165,
        wave=0.34,
        gyro=0.69,
        pitch=6.3,
        buoyancy=0.014,
        heave=0.0068,
        depth=0.02,
    ),
)
"""Starting weights in depth, suitable for Caribou."""
SURFACE_WEIGHTS = ("load", "recovery")
"""Weights in radians of the surface; ``effort`` is per radian."""


class Reference(NamedTuple):
    """Rms errors of the initial gains, to which the cost is relative."""

    heading_rad: float
    pitch_rad: float
    depth_m: float


class PlaneRequirements(NamedTuple):
    """One plane and its requirements."""

    plane: MeasuredPlane
    """Plane with its measured outputs."""
    disturbance: Noise
    """Identified disturbance and sensor noise."""
    reference: Reference
    spec: Spec


def starts(task: PlaneRequirements) -> tuple[dict[str, float], ...]:
    """Return the starting weights, scaled with the vehicle's control effectiveness."""
    in_pitch = task.plane.names[1] == "depth"
    names = Weights._fields if in_pitch else Weights._fields[:6]
    ratio = CARIBOU_TURN_PER_S2 / abs(float(task.plane.plane.B[1]))
    scale = {"effort": 1.0 / ratio, **dict.fromkeys(SURFACE_WEIGHTS, ratio)}
    every = DEPTH_STARTS if in_pitch else HEADING_STARTS
    return tuple(
        {name: getattr(start, name) * scale.get(name, 1.0) for name in names} for start in every
    )


def tune(
    task: PlaneRequirements, bounds: Bounds, first: Sequence[Mapping[str, float]]
) -> dict[str, float]:
    """Return the weights of the first start that ends within the limits, by name.

    Raises DesignInfeasibleError.
    """
    names = tuple(evaluate(task, controller_of(task, first[0]), bounds).violations)

    def evaluate_weights(weights: Mapping[str, float]) -> CostAndConstraints:
        """Return cost and violations; the largest violation if no controller exists."""
        try:
            return evaluate(task, controller_of(task, weights), bounds)
        except ValueError:  # no numerical solution of a Riccati equation; scipy has both types
            return CostAndConstraints(MAX_VIOLATION, dict.fromkeys(names, MAX_VIOLATION))

    return constrained_search.solve(ConstrainedProblem({}, first, evaluate_weights))


def controller_of(task: PlaneRequirements, weights: Mapping[str, float]) -> ContinuousController:
    """Return the controller of given weights."""
    return synthesis.controller(
        task.plane.plane, task.plane.lag, task.disturbance, Weights(**weights)
    )


def evaluate(
    task: PlaneRequirements, controller: ContinuousController, bounds: Bounds
) -> CostAndConstraints:
    """Return the relative error and the constraint violations of a controller."""
    spec, errors = task.spec, loop_analysis.disturbance_response(task.plane, controller)
    violations = {
        **loop_analysis.violations(task.plane, controller, bounds, spec),
        f"noise of the {task.plane.names[0]}'s command": math.degrees(errors.noise_rad)
        / spec.command_noise_deg
        - 1.0,
    }
    if task.plane.names[1] == "heading":
        return CostAndConstraints(float(errors.outputs[1]) / task.reference.heading_rad, violations)
    pitch_deg = math.degrees(synthesis.pitch_per_metre(controller))
    violations["pitch activity"] = (
        float(errors.outputs[1]) / task.reference.pitch_rad / spec.pitch_rms_ratio - 1.0
    )
    violations["pitch per metre of depth"] = pitch_deg / spec.pitch_per_metre_deg - 1.0
    return CostAndConstraints(float(errors.outputs[2]) / task.reference.depth_m, violations)
