"""LQG beside the PID redesign: the same model, measurements, limits and vehicles, another law.

``design_lqg`` reads top to bottom: what is known, weights within limits for heading and for depth,
and the share of the vehicles that the model allows for on which the laws keep what is asked of
every one."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import lqg as state_space
from autopilot.control import lqg_file
from autopilot.control.lqg import LqgControllers
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Gains
from sysid.control_analysis.margins import Planes
from sysid.data.segments import Plane
from sysid.design import constraints, design_model
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, ConstraintViolation
from sysid.design.design_model import DesignModel
from sysid.design.lqg import loop_analysis, synthesis
from sysid.design.lqg import weights as tuning
from sysid.design.lqg.controller import DiscreteController, discretise
from sysid.design.lqg.weights import Reference, Task
from sysid.design.pid import DAMPING_FACTORS, ROBUST_ENOUGH, VEHICLES, check_robustness
from sysid.design.robustness import RELAXED, min_bounds, summarise
from sysid.design.specification import DesignInfeasibleError, DesignRobustness, Response, Spec
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel, sha256_of_model
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

Array = NDArray[np.float64]


class LqgDesign(NamedTuple):
    """Continuous laws of both planes, and what they promise."""

    heading: DiscreteController
    depth: DiscreteController
    weights: dict[Plane, dict[str, float]]
    planes: Planes
    speed_mps: float
    predicted: Response
    trust: DesignRobustness | None
    """None for a model that does not say how sure it is."""
    model_sha256: str


def design_lqg(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: VehicleConfig | None = None,
    initial: Gains = TABLE_3_INITIAL,
) -> LqgDesign:
    """LQG laws from an identified model; ``prior`` and ``initial`` as for
    ``sysid.design.redesign``.

    Raises:
        DesignRefused: the model is not fit for it, or no weights meet the specification.
    """
    spec = spec or Spec()
    if not model.convergence.agreed:
        raise DesignInfeasibleError(
            "the fit's starts disagree, so the model is not unique; record more tests and refit"
        )
    vehicle, allowed = (
        design_model.from_model(model),
        list(design_model.sample_models(model, VEHICLES, prior)),
    )
    before = _reference_errors(vehicle, initial)
    heading = _tune(vehicle, allowed, "yaw", spec, before)
    depth = _tune(vehicle, allowed, "pitch", spec, before)
    sure = robustness(allowed, heading.law, depth.law, spec)
    check_robustness(sure, model, spec)
    return LqgDesign(
        heading=heading.law,
        depth=depth.law,
        weights={"yaw": heading.weights, "pitch": depth.weights},
        planes=vehicle.planes,
        speed_mps=model.speed_mps,
        predicted=predict_response(vehicle, heading.law, depth.law),
        trust=sure,
        model_sha256=sha256_of_model(model),
    )


class _TunedController(NamedTuple):
    weights: dict[str, float]
    law: DiscreteController


def _tune(
    vehicle: DesignModel,
    allowed: Sequence[DesignModel],
    plane: Plane,
    spec: Spec,
    before: Reference,
) -> _TunedController:
    """Of stricter and stricter damping, as far as it can be met, until enough vehicles keep the
    least one."""
    task = Task(
        loop_analysis.measured_plane(vehicle, plane),
        noise.from_model(vehicle.sea[plane]),
        before,
        spec,
    )
    seen, asked = (
        [loop_analysis.measured_plane(each, plane) for each in allowed],
        constraints.nominal(spec),
    )
    found: _TunedController | None = None
    most, starts = -1.0, tuning.starts(task)
    for factor in DAMPING_FACTORS:
        try:
            weights = tuning.tune(task, asked._replace(damping=factor * asked.damping), starts)
        except DesignInfeasibleError:
            if found is None:
                raise
            break
        law = tuning.controller_of(task, weights)
        kept = [
            max(loop_analysis.violations(each, law, min_bounds(spec)).values())
            <= CONSTRAINT_TOLERANCE
            for each in seen
        ]
        share = sum(kept) / len(kept) if kept else 1.0
        if share > most:
            found, most = _TunedController(weights, law), share
        if share >= ROBUST_ENOUGH:
            break
        starts = (weights,)
    assert found is not None
    return found


def _reference_errors(vehicle: DesignModel, gains: Gains) -> Reference:
    pitch_rad, depth_m, _ = design_model.depth_rms(vehicle, gains)
    return Reference(design_model.heading_rms(vehicle, gains)[0], pitch_rad, depth_m)


def predict_response(
    vehicle: DesignModel, heading: DiscreteController, depth: DiscreteController
) -> Response:
    """Standard deviations in closed loop under the sea of the model."""
    yaw = loop_analysis.disturbance_response(loop_analysis.measured_plane(vehicle, "yaw"), heading)
    pitch = loop_analysis.disturbance_response(
        loop_analysis.measured_plane(vehicle, "pitch"), depth
    )
    return Response(
        heading_deg=math.degrees(yaw.outputs[1]),
        pitch_deg=math.degrees(pitch.outputs[1]),
        depth_m=float(pitch.outputs[2]),
        rudder_deg=math.degrees(yaw.command_rad),
        elevator_deg=math.degrees(pitch.command_rad),
    )


def robustness(
    vehicles: Sequence[DesignModel],
    heading: DiscreteController,
    depth: DiscreteController,
    spec: Spec,
) -> DesignRobustness | None:
    """As ``sysid.design.trust.trust``; None where there are no vehicles to try."""
    if not vehicles:
        return None
    wanted, relaxed = (
        [violations(each, heading, depth, bounds) for each in vehicles]
        for bounds in (min_bounds(spec), RELAXED)
    )
    return summarise(wanted, relaxed)


def violations(
    vehicle: DesignModel, heading: DiscreteController, depth: DiscreteController, bounds: Bounds
) -> ConstraintViolation:
    yaw, pitch = (
        loop_analysis.measured_plane(vehicle, "yaw"),
        loop_analysis.measured_plane(vehicle, "pitch"),
    )
    return {
        **loop_analysis.violations(yaw, heading, bounds),
        **loop_analysis.violations(pitch, depth, bounds),
    }


def autopilot_controllers(design: LqgDesign) -> LqgControllers:
    """The laws as the autopilot's tick closes them."""
    heading, depth = (
        tick_controllers(design.heading, design.planes.yaw),
        tick_controllers(design.depth, design.planes.pitch),
    )
    return LqgControllers(design.speed_mps, heading, depth, synthesis.pitch_per_metre(design.depth))


def tick_controllers(law: DiscreteController, plane: LinearPlane) -> state_space.LqgController:
    step, measured = discretise(law, loop_transfer.TICK_S), loop_analysis.outputs(plane)
    start = np.zeros((len(law.B), len(measured)))
    start[: len(plane.B)] = np.linalg.pinv(measured)
    rows = np.column_stack([step.A, step.B, step.L])
    return state_space.from_matrices(
        _tuples(rows), tuple(step.F.tolist()), _tuples(start), synthesis.count_loads(plane)
    )


def _tuples(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())


def write(design: LqgDesign, path: str | Path) -> None:
    """The file that `autopilot --controller` reads."""
    Path(path).write_text(
        lqg_file.to_json(autopilot_controllers(design), design.model_sha256), encoding="utf-8"
    )
