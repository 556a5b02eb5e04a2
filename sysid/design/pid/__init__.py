"""Gains from an identified model: the smallest answer to the sea that a specification allows, and
how sure that is.

``redesign`` reads top to bottom: what is known, the gains of both planes within limits, the ways to
new set-points, and the share of the vehicles that the model allows for on which all of it holds.
"""

import math
from collections.abc import Sequence
from types import ModuleType

from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import Gains
from sysid.design import constraints, design_model
from sysid.design.constraints import Bounds
from sysid.design.design_model import DesignModel
from sysid.design.pid import depth, heading, predicted_performance, reference_models
from sysid.design.pid.rationale import explain
from sysid.design.robustness import fraction_satisfying, min_bounds, robustness
from sysid.design.specification import (
    Design,
    DesignInfeasibleError,
    DesignRobustness,
    Loads,
    Response,
    Spec,
)
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

__all__ = [
    "Design",
    "DesignInfeasibleError",
    "DesignRobustness",
    "Loads",
    "Response",
    "Spec",
    "constant_loads",
    "redesign",
]

VEHICLES = 240
"""That are drawn from what the model says of itself."""
DAMPING_FACTORS = (1.0, 1.08, 1.16)
"""Factors on the nominal damping, tried until enough of the drawn vehicles keep the least one:
margins have room between what the nominal model and what every vehicle is asked for, damping has
none."""
ROBUST_ENOUGH = 0.9
"""Share of vehicles above which that ends."""
INTEGRATOR_ROOM_RAD = math.radians(1.0)
"""Room of the heading integrator beyond the measured rudder bias."""
LEVEL_PITCH_ROOM = 1.25
"""Depth integrator over the pitch that level flight needs: ballast changes by a fourth of the net
buoyancy or so."""
MAX_IMAX_RAD = 0.25


def redesign(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: VehicleConfig | None = None,
    initial: Gains = TABLE_3_INITIAL,
) -> Design:
    """Parameters for the autopilot's loops from an identified model.

    ``prior`` is needed when the model was refitted from a vehicle file that is not shipped;
    ``initial`` are the gains that were flown before, with which the new ones are compared.

    Raises:
        DesignRefused: the model is not fit for it, or no gains meet the specification.
    """
    spec = spec or Spec()
    if not model.convergence.agreed:
        raise DesignInfeasibleError(
            "the fit's starts disagree, so the model is not unique; record more tests and refit"
        )
    vehicle, loads = design_model.from_model(model), constant_loads(model)
    allowed = list(design_model.sample_models(model, VEHICLES, prior))
    try:
        gains = _gains(vehicle, allowed, _initial_values(vehicle, initial), spec)
    except DesignInfeasibleError as refused:
        raise DesignInfeasibleError(
            f"{refused}; ask for less, or {_recommended_test(model)}, and refit"
        ) from None
    sure = robustness(allowed, gains, spec)
    check_robustness(sure, model, spec)
    gains |= integrator_limits(loads, gains)
    gains |= reference_models.heading(vehicle, gains, loads, spec)
    gains |= reference_models.depth(vehicle, gains, loads, spec)
    judged = design_model.analyse_loops(vehicle, gains)
    before, after = (
        design_model.predict_response(vehicle, initial),
        design_model.predict_response(vehicle, gains),
    )
    return Design(
        gains=gains,
        reasons=explain(model, gains, judged, before, after, spec),
        analysis=judged,
        predicted=after,
        initial=before,
        initial_analysis=design_model.analyse_loops(vehicle, initial),
        spec=spec,
        trust=sure,
        promise=predicted_performance.performance_baseline(model, vehicle, gains, spec, sure),
    )


def _initial_values(vehicle: DesignModel, initial: Gains) -> dict[str, float]:
    """The initial gains, and the tailcone as it was identified."""
    lag = vehicle.yaw_lag
    tail = {
        "ACT_LAG_W": lag.natural_frequency_radps,
        "ACT_LAG_Z": lag.damping_ratio,
        "ACT_LEAD_W": 0.0,
    }
    return {**initial, **tail}


def _gains(
    vehicle: DesignModel, allowed: Sequence[DesignModel], first: dict[str, float], spec: Spec
) -> dict[str, float]:
    """Of heading first, which settles how far the lag is undone, then of depth. Raises
    DesignRefused."""

    def strict_enough(
        plane: ModuleType, linear: LinearPlane, known: dict[str, float]
    ) -> dict[str, float]:
        """Of stricter and stricter damping, as far as it can be met, until enough vehicles keep the
        least one."""
        found, share, starts = known, -1.0, design_model.scale_starts(plane.STARTS, linear)
        for factor in DAMPING_FACTORS:
            try:
                moved = plane.gains(vehicle, known, spec, _tighten_damping(spec, factor), starts)
            except DesignInfeasibleError:
                if share < 0.0:
                    raise
                break
            kept = fraction_satisfying(
                allowed, plane.violations, {**known, **moved}, min_bounds(spec)
            )
            if kept > share:
                found, share = {**known, **moved}, kept
            if kept >= ROBUST_ENOUGH:
                break
            starts = (moved,)
        return found

    return strict_enough(
        depth, vehicle.planes.pitch, strict_enough(heading, vehicle.planes.yaw, first)
    )


def _tighten_damping(spec: Spec, factor: float) -> Bounds:
    asked = constraints.nominal(spec)
    return asked._replace(damping=factor * asked.damping)


def check_robustness(found: DesignRobustness | None, model: IdentifiedModel, spec: Spec) -> None:
    """Raises DesignRefused where fewer vehicles keep the specification than it asks for; says what
    would help."""
    if found is None or found.specification >= spec.probability:
        return
    raise DesignInfeasibleError(
        f"only {100 * found.specification:.0f} % of the vehicles that the model allows for keep the"
        f" specification, at least {100 * spec.probability:.0f} asked for; most miss the"
        f" {found.worst}; {_recommended_test(model)}, and refit"
    )


def _recommended_test(model: IdentifiedModel) -> str:
    """The test that the model's own verdict asks for, where it has one."""
    following = model.verdict.next_test if model.verdict else None
    return (
        f"fly {following}"
        if following
        else "record more tests, or sweep the tailcone by `ground bench-test`"
    )


def constant_loads(model: IdentifiedModel) -> Loads:
    """What a model says of them, and what is unsure about it (3 sd)."""
    yaw, pitch = model.planes["yaw"].actuator_bias_deg, model.planes["pitch"].actuator_bias_deg
    return Loads(
        level_pitch_rad=math.radians(model.vehicle.level_pitch_deg),
        rudder_rad=math.radians(abs(yaw.value) + 3.0 * (yaw.sd or 0.0)),
        elevator_rad=math.radians(3.0 * (pitch.sd or 0.0)),
    )


def integrator_limits(loads: Loads, gains: dict[str, float]) -> dict[str, float]:
    """Room for the constant loads.

    The heading integrator could carry the whole rudder bias if TRIM_RUD_DEG were lost; the depth
    integrator carries the pitch of level flight, and TRIM_ELE_DEG the elevator."""
    room = LEVEL_PITCH_ROOM * abs(loads.level_pitch_rad) + loads.elevator_rad / gains["PTCH_P"]
    return {
        "HDG_IMAX": min(MAX_IMAX_RAD, INTEGRATOR_ROOM_RAD + loads.rudder_rad),
        "PTCH_IMAX": 0.0,
        "DPT_IMAX": min(MAX_IMAX_RAD, room),
    }
