"""LQG design from an identified model, with the measurements and limits of the PID redesign.

``design_lqg`` reads top to bottom: design model, weights within the limits for heading and for
depth, and the share of sampled vehicles on which the controllers meet the robust limits.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import asdict
from numpy.typing import NDArray

from autopilot.control import lqg as state_space
from autopilot.control import lqg_file
from autopilot.control.lqg import LqgControllers
from mavlink_io.tick import TICK_S
from mavlink_io.user_data_dir import write_output
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import Gains
from sysid.control_analysis.margins import Planes
from sysid.design import constraints, design_model, disturbance_response, minimum_variance
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds, ConstraintViolation, min_bounds
from sysid.design.design_model import DesignModel
from sysid.design.lqg import loop_analysis, synthesis
from sysid.design.lqg import weights as tuning
from sysid.design.lqg.controller import ContinuousController, discretise
from sysid.design.lqg.weights import PlaneRequirements, Reference
from sysid.design.pid import VEHICLES, check_robustness, check_unique
from sysid.design.pid.plane_search import DAMPING_FACTORS, ROBUST_ENOUGH
from sysid.design.robustness import RELAXED, summarise
from sysid.design.specification import (
    DesignInfeasibleError,
    DesignRobustness,
    MinimumVariance,
    Response,
    Spec,
)
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel, sha256_of_model
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

Array = NDArray[np.float64]


class LqgDesign(NamedTuple):
    """Controllers of both planes and their predicted performance."""

    heading: ContinuousController
    depth: ContinuousController
    weights: dict[Plane, dict[str, float]]
    planes: Planes
    speed_mps: float
    predicted: Response
    robustness: DesignRobustness | None
    """Robustness over the model's posterior; None for a model without covariance."""
    minimum: MinimumVariance | None
    """Lower bound of the errors; None if it has no numerical solution."""
    model_sha256: str


def design_lqg(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: VehicleConfig | None = None,
    initial: Gains = TABLE_3_INITIAL,
) -> LqgDesign:
    """Design LQG controllers from an identified model.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model; its fit must have converged to one solution.
    spec : Spec, optional
        Limits of the design; the default `Spec` without it.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.
    initial : Gains
        Gains that are currently set; the cost is relative to their errors.

    Returns
    -------
    LqgDesign
        Controllers, weights, predicted response and robustness.

    Raises
    ------
    DesignInfeasibleError
        The model is not usable, no weights meet the specification, or too few sampled vehicles meet
        it.
    """
    spec = spec or Spec()
    check_unique(model)
    vehicle = design_model.from_model(model, prior, spec.operating_depth_m)
    vehicles = list(design_model.sample_models(model, VEHICLES, prior))
    in_waves = disturbance_response.assume_waves(vehicle, initial, spec)
    reference = _reference_errors(in_waves, initial)
    try:
        heading = _tune(in_waves, vehicles, Plane.YAW, spec, reference)
        depth = _tune(in_waves, vehicles, Plane.PITCH, spec, reference)
    except DesignInfeasibleError as error:
        raise DesignInfeasibleError(
            f"{error}; {spec.lower_limits()}; PID loops (--method pid) may meet these limits"
        ) from None
    robust = robustness(vehicles, heading.controller, depth.controller, spec)
    check_robustness(robust, model, spec)
    predicted = predict_response(vehicle, heading.controller, depth.controller)
    return LqgDesign(
        heading=heading.controller,
        depth=depth.controller,
        weights={Plane.YAW: heading.weights, Plane.PITCH: depth.weights},
        planes=vehicle.planes,
        speed_mps=model.speed_mps,
        predicted=predicted,
        minimum=minimum_variance.minimum_variance(vehicle, predicted),
        robustness=robust,
        model_sha256=sha256_of_model(model),
    )


class _TunedController(NamedTuple):
    """Weights and the controller that follows from them."""

    weights: dict[str, float]
    controller: ContinuousController


def _tune(
    vehicle: DesignModel,
    vehicles: Sequence[DesignModel],
    plane: Plane,
    spec: Spec,
    reference: Reference,
) -> _TunedController:
    """Increase the nominal damping until enough sampled vehicles meet the limits."""
    task = PlaneRequirements(
        plane=loop_analysis.measured_plane(vehicle, plane),
        disturbance=noise.from_model(vehicle.disturbance[plane]),
        reference=reference,
        spec=spec,
    )
    measured_planes = [loop_analysis.measured_plane(sample, plane) for sample in vehicles]
    bounds = constraints.nominal(spec)
    best: _TunedController | None = None
    best_fraction, starts = -1.0, tuning.starts(task)
    for factor in (1.0, *DAMPING_FACTORS):
        try:
            weights = tuning.tune(task, bounds._replace(damping=factor * bounds.damping), starts)
        except DesignInfeasibleError:
            if best is None:
                raise
            break
        controller = tuning.controller_of(task, weights)
        satisfied = [
            max(loop_analysis.violations(sample, controller, min_bounds(spec)).values())
            <= CONSTRAINT_TOLERANCE
            for sample in measured_planes
        ]
        fraction = sum(satisfied) / len(satisfied) if satisfied else 1.0
        if fraction > best_fraction:
            best, best_fraction = _TunedController(weights, controller), fraction
        if fraction >= ROBUST_ENOUGH:
            break
        starts = (weights,)
    assert best is not None
    return best


def _reference_errors(vehicle: DesignModel, gains: Gains) -> Reference:
    """Return the rms errors of the initial gains."""
    pitch_rad, depth_m, _ = disturbance_response.depth_rms(vehicle, gains)
    return Reference(disturbance_response.heading_rms(vehicle, gains)[0], pitch_rad, depth_m)


def predict_response(
    vehicle: DesignModel, heading: ContinuousController, depth: ContinuousController
) -> Response:
    """Return the standard deviations in closed loop, by disturbance and gyro noise (deg, m)."""
    yaw = loop_analysis.disturbance_response(
        loop_analysis.measured_plane(vehicle, Plane.YAW), heading
    )
    pitch = loop_analysis.disturbance_response(
        loop_analysis.measured_plane(vehicle, Plane.PITCH), depth
    )
    return Response(
        heading_deg=math.degrees(math.hypot(yaw.outputs[1], yaw.noise_outputs[1])),
        pitch_deg=math.degrees(math.hypot(pitch.outputs[1], pitch.noise_outputs[1])),
        depth_m=math.hypot(pitch.outputs[2], pitch.noise_outputs[2]),
        rudder_deg=math.degrees(math.hypot(yaw.command_rad, yaw.noise_rad)),
        elevator_deg=math.degrees(math.hypot(pitch.command_rad, pitch.noise_rad)),
    )


def robustness(
    vehicles: Sequence[DesignModel],
    heading: ContinuousController,
    depth: ContinuousController,
    spec: Spec,
) -> DesignRobustness | None:
    """Return the shares of vehicles that meet the limits, or None without vehicles."""
    if not vehicles:
        return None
    specified, relaxed = (
        [violations(vehicle, heading, depth, bounds) for vehicle in vehicles]
        for bounds in (min_bounds(spec), RELAXED)
    )
    return summarise(specified, relaxed)


def violations(
    vehicle: DesignModel, heading: ContinuousController, depth: ContinuousController, bounds: Bounds
) -> ConstraintViolation:
    """Return the constraint violations of both planes on one vehicle."""
    yaw, pitch = (loop_analysis.measured_plane(vehicle, plane) for plane in Plane)
    return {
        **loop_analysis.violations(yaw, heading, bounds),
        **loop_analysis.violations(pitch, depth, bounds),
    }


def autopilot_controllers(design: LqgDesign) -> LqgControllers:
    """Return the controllers as the autopilot's tick executes them.

    Parameters
    ----------
    design : LqgDesign
        Result of the design.

    Returns
    -------
    LqgControllers
        Controllers of heading and depth, discrete in time with the period of the tick.
    """
    return LqgControllers(
        speed_mps=design.speed_mps,
        heading=tick_controllers(design.heading, design.planes.yaw),
        depth=tick_controllers(design.depth, design.planes.pitch),
        pitch_per_metre=synthesis.pitch_per_metre(design.depth),
    )


def tick_controllers(
    controller: ContinuousController, plane: LinearPlane
) -> state_space.LqgController:
    """Return the discrete-time controller of one plane.

    The initial observer state follows from the measurements by the pseudo-inverse of C.
    """
    step, measured = discretise(controller, TICK_S), design_model.outputs(plane)
    initial_state_map = np.zeros((len(controller.B), len(measured)))
    initial_state_map[: len(plane.B)] = np.linalg.pinv(measured)
    rows = np.column_stack([step.A, step.B, step.L])
    return state_space.from_matrices(
        _tuples(rows),
        tuple(step.F.tolist()),
        _tuples(initial_state_map),
        synthesis.count_loads(plane),
    )


def _tuples(matrix: Array) -> tuple[tuple[float, ...], ...]:
    """Return a matrix as nested tuples."""
    return tuple(tuple(row) for row in matrix.tolist())


def write(design: LqgDesign, path: str | Path) -> None:
    """Write the controller file that `autopilot --controller` reads, with the prediction.

    The autopilot ignores `predicted` and `robustness`, which are for the reader of the file.

    Parameters
    ----------
    design : LqgDesign
        Designed controllers.
    path : str or Path
        JSON file to write.
    """
    content = json.loads(lqg_file.to_json(autopilot_controllers(design), design.model_sha256))
    content["predicted"] = asdict(design.predicted)
    if design.robustness:
        content["robustness"] = asdict(design.robustness)
    write_output(path, json.dumps(content) + "\n")
