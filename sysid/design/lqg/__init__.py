"""LQG beside the PID redesign: the same model, measurements, limits and vehicles, another law.

``design_laws`` reads top to bottom: what is known, weights within limits for heading and for depth,
and the share of the vehicles that the model allows for on which the laws keep what is asked of
every one."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot import lqg_file
from autopilot.control import lqg as state_space
from autopilot.control.lqg import Laws
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Gains
from sysid.control_analysis.margins import Planes
from sysid.data.segments import Plane
from sysid.design import constraints, design_model
from sysid.design.constrained_search import SLACK
from sysid.design.constraints import Bounds, Misses
from sysid.design.design_model import Plant
from sysid.design.lqg import loop_analysis, synthesis
from sysid.design.lqg import weights as tuning
from sysid.design.lqg.controller import Law, sampled
from sysid.design.lqg.weights import Reference, Task
from sysid.design.pid import STRICTER, SURE, VEHICLES, refuse_unlikely
from sysid.design.robustness import RELAXED, least, summed_up
from sysid.design.specification import DesignRefused, Response, Spec, Trust
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel, digest
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

Array = NDArray[np.float64]


class LawDesign(NamedTuple):
    """Continuous laws of both planes, and what they promise."""

    heading: Law
    depth: Law
    weights: dict[Plane, dict[str, float]]
    planes: Planes
    speed_mps: float
    predicted: Response
    trust: Trust | None
    """None for a model that does not say how sure it is."""
    model_sha256: str


def design_laws(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: VehicleConfig | None = None,
    initial: Gains = TABLE_3_INITIAL,
) -> LawDesign:
    """LQG laws from an identified model; ``prior`` and ``initial`` as for
    ``sysid.design.redesign``.

    Raises:
        DesignRefused: the model is not fit for it, or no weights meet the specification.
    """
    spec = spec or Spec()
    if not model.convergence.agreed:
        raise DesignRefused(
            "the fit's starts disagree, so the model is not unique; record more tests and refit"
        )
    vehicle, allowed = design_model.plant(model), list(design_model.allowed(model, VEHICLES, prior))
    before = _errors_of(vehicle, initial)
    heading = _tuned(vehicle, allowed, "yaw", spec, before)
    depth = _tuned(vehicle, allowed, "pitch", spec, before)
    sure = trust(allowed, heading.law, depth.law, spec)
    refuse_unlikely(sure, model, spec)
    return LawDesign(
        heading=heading.law,
        depth=depth.law,
        weights={"yaw": heading.weights, "pitch": depth.weights},
        planes=vehicle.planes,
        speed_mps=model.speed_mps,
        predicted=respond(vehicle, heading.law, depth.law),
        trust=sure,
        model_sha256=digest(model),
    )


class _Tuned(NamedTuple):
    weights: dict[str, float]
    law: Law


def _tuned(
    vehicle: Plant, allowed: Sequence[Plant], plane: Plane, spec: Spec, before: Reference
) -> _Tuned:
    """Of stricter and stricter damping, as far as it can be met, until enough vehicles keep the
    least one."""
    task = Task(
        loop_analysis.view(vehicle, plane), noise.of_model(vehicle.sea[plane]), before, spec
    )
    seen, asked = [loop_analysis.view(each, plane) for each in allowed], constraints.nominal(spec)
    found: _Tuned | None = None
    most, starts = -1.0, tuning.starts(task)
    for factor in STRICTER:
        try:
            weights = tuning.tuned(task, asked._replace(damping=factor * asked.damping), starts)
        except DesignRefused:
            if found is None:
                raise
            break
        law = tuning.law_of(task, weights)
        kept = [
            max(loop_analysis.stability(each, law, least(spec)).values()) <= SLACK for each in seen
        ]
        share = sum(kept) / len(kept) if kept else 1.0
        if share > most:
            found, most = _Tuned(weights, law), share
        if share >= SURE:
            break
        starts = (weights,)
    assert found is not None
    return found


def _errors_of(vehicle: Plant, gains: Gains) -> Reference:
    pitch_rad, depth_m, _ = design_model.depth_rms(vehicle, gains)
    return Reference(design_model.heading_rms(vehicle, gains)[0], pitch_rad, depth_m)


def respond(vehicle: Plant, heading: Law, depth: Law) -> Response:
    """Standard deviations in closed loop under the sea of the model."""
    yaw = loop_analysis.errors(loop_analysis.view(vehicle, "yaw"), heading)
    pitch = loop_analysis.errors(loop_analysis.view(vehicle, "pitch"), depth)
    return Response(
        heading_deg=math.degrees(yaw.outputs[1]),
        pitch_deg=math.degrees(pitch.outputs[1]),
        depth_m=float(pitch.outputs[2]),
        rudder_deg=math.degrees(yaw.command_rad),
        elevator_deg=math.degrees(pitch.command_rad),
    )


def trust(vehicles: Sequence[Plant], heading: Law, depth: Law, spec: Spec) -> Trust | None:
    """As ``sysid.design.trust.trust``; None where there are no vehicles to try."""
    if not vehicles:
        return None
    wanted, relaxed = (
        [misses(each, heading, depth, bounds) for each in vehicles]
        for bounds in (least(spec), RELAXED)
    )
    return summed_up(wanted, relaxed)


def misses(vehicle: Plant, heading: Law, depth: Law, bounds: Bounds) -> Misses:
    yaw, pitch = loop_analysis.view(vehicle, "yaw"), loop_analysis.view(vehicle, "pitch")
    return {
        **loop_analysis.stability(yaw, heading, bounds),
        **loop_analysis.stability(pitch, depth, bounds),
    }


def aboard(design: LawDesign) -> Laws:
    """The laws as the autopilot's tick closes them."""
    heading, depth = (
        ticked(design.heading, design.planes.yaw),
        ticked(design.depth, design.planes.pitch),
    )
    return Laws(design.speed_mps, heading, depth, synthesis.pitch_per_metre(design.depth))


def ticked(law: Law, plane: LinearPlane) -> state_space.Law:
    step, measured = sampled(law, loop_transfer.TICK_S), loop_analysis.outputs(plane)
    start = np.zeros((len(law.B), len(measured)))
    start[: len(plane.B)] = np.linalg.pinv(measured)
    rows = np.column_stack([step.A, step.B, step.L])
    return state_space.law(
        _tuples(rows), tuple(step.F.tolist()), _tuples(start), synthesis.loads(plane)
    )


def _tuples(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())


def write(design: LawDesign, path: str | Path) -> None:
    """The file that `autopilot --laws` reads."""
    Path(path).write_text(lqg_file.text_of(aboard(design), design.model_sha256), encoding="utf-8")
