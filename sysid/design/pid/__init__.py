"""PID redesign: gains from an identified model, and their robustness over the model's posterior.

``redesign`` reads top to bottom: design model and constant loads, gains of both planes within the
limits, reference models for new set-points, and the share of sampled vehicles that meet the limits.
"""

import math
from functools import partial
from types import ModuleType

from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import LEAD_DAMPING, Gains
from sysid.design import constraints, design_model, disturbance_response, minimum_variance
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE, within_range
from sysid.design.design_model import DesignModel
from sysid.design.pid import depth, heading, plane_search, predicted_performance, reference_models
from sysid.design.pid.plane_search import PlaneSearch, Samples
from sysid.design.pid.rationale import explain
from sysid.design.robustness import robustness, violations
from sysid.design.specification import (
    Design,
    DesignInfeasibleError,
    DesignRobustness,
    Loads,
    Response,
    Spec,
)
from sysid.estimation.map import steady_state
from sysid.models import prediction
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

__all__ = [
    "Design",
    "DesignInfeasibleError",
    "DesignRobustness",
    "Loads",
    "Response",
    "Spec",
    "constant_loads",
    "keep",
    "redesign",
]

VEHICLES = 240
"""Number of vehicles sampled from the model's posterior."""
INTEGRATOR_ROOM_RAD = math.radians(1.0)
"""Authority of the heading integrator beyond the identified rudder bias (rad)."""
LEVEL_PITCH_ROOM = 1.25
"""Authority of the depth integrator over the pitch of level flight.

It allows for ballast changes of about a fourth of the net buoyancy.
"""
MAX_IMAX_RAD = 0.25
"""Upper bound of integrator limits (rad)."""
FIRST_LEAD_RATIO = 1.5
"""ACT_LEAD_W over the tailcone's natural frequency at a start without actuator lead."""
MIN_START = 1e-3
"""Smallest start of a gain: the search varies the logarithms."""
NO_PEAK = {"W": 0.0, "Z": 0.5, "GAIN": 1.0}
"""Parameters of a peak filter that is off, by the end of their names."""
FIRST_PEAK = {"W": 1.2, "Z": 0.6, "GAIN": 1.05}
"""Parameters of a peak filter at a start without one."""
WAVE_DEPTH_TIME_S = 0.4
"""EST_DPT_TIME (s) of a model whose tests show the pressure of waves.

At frequencies above its inverse the estimated depth rate is that of the accelerometer, which
follows the heave of the water. With the default, pitch and elevator follow it, too.
"""
PARAMETERS = (
    *TABLE_3_INITIAL,
    "HDG_REF_W",
    "HDG_REF_RATE",
    "DPT_REF_W",
    "DPT_REF_RATE",
    "DPT_REF_LEAD",
    "PTCH_FF",
    "TRIM_PIT_DEG",
    "GAIN_SPD_MPS",
    "EST_DPT_TIME",
)
"""Parameters that a design sets besides those of the tailcone."""


def redesign(
    model: IdentifiedModel,
    spec: Spec | None = None,
    prior: VehicleConfig | None = None,
    initial: Gains = TABLE_3_INITIAL,
) -> Design:
    """Design the parameters of the autopilot's PID loops from an identified model.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model; its fit must have converged to one solution.
    spec : Spec, optional
        Limits of the design; the default `Spec` without it.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.
    initial : Gains
        Gains that are currently set; pitch and depth rms are compared with theirs.

    Returns
    -------
    Design
        Parameters with reasons, analysis, robustness and performance baseline.

    Raises
    ------
    DesignInfeasibleError
        The model is not usable, no gains meet the specification, or too few sampled vehicles meet
        it.

    Notes
    -----
    Minimises the rms of heading, then of depth, in the identified disturbance and the assumed
    waves, subject to `Spec`, and to the limits of sampled vehicles (`plane_search`).
    """
    spec = spec or Spec()
    check_unique(model)
    depth_m = spec.operating_depth_m
    vehicle, loads = design_model.from_model(model, prior, depth_m), constant_loads(model)
    sample = partial(design_model.sample_models, model, VEHICLES, prior, depth_m=depth_m)
    samples = Samples(
        vehicles=list(sample()),
        unmeasured_drive=[design_model.drive_forms(v) for v in sample(drive_known=False)],
    )
    reference = _initial_values(vehicle, initial, spec)
    in_waves = disturbance_response.assume_waves(vehicle, reference, spec)
    try:
        gains = _gains(in_waves, samples, reference, spec)
    except DesignInfeasibleError as error:
        raise DesignInfeasibleError(f"{error}; {spec.lower_limits()}") from None
    robust = robustness(samples.vehicles, gains, spec)
    check_robustness(robust, model, spec)
    gains |= integrator_limits(loads, gains)
    gains["TRIM_PIT_DEG"] = round(math.degrees(loads.level_pitch_rad), 2)
    known = prediction.vehicles(model, prior)[0]
    cruise_mps = known.config.operating_point.speed_mps
    gains["GAIN_SPD_MPS"] = within_range("GAIN_SPD_MPS", cruise_mps)
    gains |= reference_models.heading(
        vehicle,
        gains,
        loads,
        spec,
        partial(steady_state.steady_turn, known.config, known.model),
    )
    gains |= reference_models.depth(vehicle, gains, loads, spec)
    if vehicle.disturbance[Plane.PITCH].wave_depth_m:
        gains["EST_DPT_TIME"] = WAVE_DEPTH_TIME_S
    design = _assemble(model, vehicle, gains, initial, spec, robust)
    return design._replace(
        reasons=explain(model, gains, design.analysis, design.initial, design.predicted, spec)
    )


def keep(
    model: IdentifiedModel, parameters: Gains, spec: Spec, prior: VehicleConfig | None = None
) -> Design:
    """Return the flown gains as the result of a redesign.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model; its fit must have converged to one solution.
    parameters : Gains
        Parameters of the dives, all that a design sets.
    spec : Spec
        Limits that the gains must meet.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.

    Returns
    -------
    Design
        The loop parameters that were flown, with analysis and robustness on the model.

    Raises
    ------
    DesignInfeasibleError
        The model is not usable, or the gains do not meet the margins of the specification.
    """
    check_unique(model)
    vehicle = design_model.from_model(model, prior, spec.operating_depth_m)
    gains = {name: parameters[name] for name in PARAMETERS if name in parameters}
    flown = _initial_values(vehicle, gains, spec)
    worst, violation = max(
        violations(vehicle, flown, constraints.nominal(spec)).items(), key=lambda item: item[1]
    )
    if violation > CONSTRAINT_TOLERANCE:
        raise DesignInfeasibleError(f"the gains violate the {worst} by {100 * violation:.1f} %")
    robust = robustness(list(design_model.sample_models(model, VEHICLES, prior)), flown, spec)
    check_robustness(robust, model, spec)
    design = _assemble(model, vehicle, flown, gains, spec, robust)
    return design._replace(reasons=dict.fromkeys(flown, "the gains of the first dives, kept"))


def check_unique(model: IdentifiedModel) -> None:
    """Raise DesignInfeasibleError if the fit has several solutions."""
    if not model.convergence.agreed:
        raise DesignInfeasibleError(
            "the fit's starts disagree, so the model is not unique; record more tests and refit"
        )


def _assemble(
    model: IdentifiedModel,
    vehicle: DesignModel,
    gains: dict[str, float],
    initial: Gains,
    spec: Spec,
    robust: DesignRobustness | None,
) -> Design:
    """Return the analysis of gains, without their reasons."""
    predicted = disturbance_response.predict_response(vehicle, gains)
    return Design(
        gains=gains,
        reasons={},
        analysis=design_model.analyse_loops(vehicle, gains),
        predicted=predicted,
        initial=disturbance_response.predict_response(vehicle, initial),
        minimum=minimum_variance.minimum_variance(vehicle, predicted),
        initial_analysis=design_model.analyse_loops(vehicle, initial),
        spec=spec,
        robustness=robust,
        baseline=predicted_performance.performance_baseline(model, vehicle, gains, spec, robust),
    )


def _initial_values(vehicle: DesignModel, initial: Gains, spec: Spec) -> dict[str, float]:
    """Return the initial gains with the identified lag and the rate limit of the tailcone."""
    lag = vehicle.yaw_lag
    tail = {
        "ACT_LAG_W": lag.natural_frequency_radps,
        "ACT_LAG_Z": lag.damping_ratio,
        "ACT_LEAD_W": 0.0,
        "ACT_LEAD_Z": LEAD_DAMPING,
        "ACT_RATE_DEGPS": within_range("ACT_RATE_DEGPS", spec.rate_degps),
    }
    filters = {
        f"{traits.gain_prefix}_PEAK_{name}": value
        for traits in PLANES.values()
        for name, value in NO_PEAK.items()
    }
    return {**filters, **initial, **tail}


def _gains(
    vehicle: DesignModel, samples: Samples, initial: dict[str, float], spec: Spec
) -> dict[str, float]:
    """Return the gains of heading, which also sets the actuator lead, then of depth.

    Raises DesignInfeasibleError.
    """

    def design_plane(
        plane: ModuleType, linear: LinearPlane, gains: dict[str, float]
    ) -> dict[str, float]:
        """Return the parameters with new gains of one plane."""
        starts = (*design_model.scale_starts(plane.STARTS, linear), _reference_start(plane, gains))
        return plane_search.robust_gains(PlaneSearch(plane, vehicle, samples, spec, gains), starts)

    return design_plane(
        depth, vehicle.planes.pitch, design_plane(heading, vehicle.planes.yaw, initial)
    )


def _reference_start(plane: ModuleType, reference: Gains) -> dict[str, float]:
    """Return the gains of the reference design as a start; a missing lead begins near the lag."""
    values = plane_search.free_gains(plane, reference)
    if values.get("ACT_LEAD_W") == 0.0:
        values["ACT_LEAD_W"] = FIRST_LEAD_RATIO * reference["ACT_LAG_W"]
    for name in values:
        if name.endswith("_PEAK_W") and not values[name]:
            prefix = name.removesuffix("W")
            values |= {f"{prefix}{end}": value for end, value in FIRST_PEAK.items()}
    return {name: max(value, MIN_START) for name, value in values.items()}


def check_robustness(robust: DesignRobustness | None, model: IdentifiedModel, spec: Spec) -> None:
    """Raise DesignInfeasibleError if fewer sampled vehicles meet the limits than required."""
    if robust is None or robust.specification >= spec.robust_fraction:
        return
    raise DesignInfeasibleError(
        f"only {100 * robust.specification:.0f} % of the vehicles sampled from the model meet the"
        f" specification, at least {100 * spec.robust_fraction:.0f} % required; most violate the"
        f" {robust.worst}; {_recommended_test(model, robust.worst)}, and refit"
    )


def _recommended_test(model: IdentifiedModel, worst: str) -> str:
    """Return the test that the assessment recommends, if it moves the plane of the worst limit."""
    next_test = model.assessment.next_test if model.assessment else None
    in_yaw = any(cut in worst for cut in ("rudder", "heading", "yaw"))
    plane = Plane.YAW if in_yaw else Plane.PITCH
    if next_test and next_test.plane == plane:
        return f"fly {next_test}"
    return (
        f"record more tests of the {PLANES[plane].surface}, or sweep the tailcone by"
        " `ground bench-test`"
    )


def constant_loads(model: IdentifiedModel) -> Loads:
    """Return the constant loads of a model; biases include three standard deviations."""
    yaw, pitch = (model.planes[plane].actuator_bias_deg for plane in Plane)
    return Loads(
        level_pitch_rad=math.radians(model.vehicle.level_pitch_deg),
        rudder_rad=math.radians(abs(yaw.value) + 3.0 * (yaw.sd or 0.0)),
        elevator_rad=math.radians(3.0 * (pitch.sd or 0.0)),
    )


def integrator_limits(loads: Loads, gains: dict[str, float]) -> dict[str, float]:
    """Return the integrator limits HDG_IMAX, PTCH_IMAX and DPT_IMAX (rad).

    Parameters
    ----------
    loads : Loads
        Constant loads to compensate.
    gains : dict
        Gains by name; PTCH_P is used.

    Returns
    -------
    dict
        The heading integrator can compensate the whole rudder bias in case TRIM_RUD_DEG is lost.
        The depth integrator compensates the pitch of level flight; TRIM_ELE_DEG the elevator.
    """
    room = LEVEL_PITCH_ROOM * abs(loads.level_pitch_rad) + loads.elevator_rad / gains["PTCH_P"]
    return {
        "HDG_IMAX": min(MAX_IMAX_RAD, INTEGRATOR_ROOM_RAD + loads.rudder_rad),
        "PTCH_IMAX": 0.0,
        "DPT_IMAX": min(MAX_IMAX_RAD, room),
    }
