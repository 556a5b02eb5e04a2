"""Preparation of a campaign: first gains, and sea, missions and flown vehicle for this vehicle.

The shipped missions and the disturbance moments of the shipped scenarios were made for Caribou. For
another vehicle they are scaled by the ratios of its vehicle file to Caribou's, and the sizes of the
tests are adapted in simulated dives of the vehicle file. The result is written into the folder of
the campaign and flown from there. Caribou flies the shipped files.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ground.campaign import (
    adaptation,
    failsafe_limits,
    prototype,
    readiness,
    refit,
    scaled_scenario,
)
from ground.campaign.campaign_folder import MISSIONS_FOLDER, SCENARIO_FILE, TRUTH_FILE
from ground.missions import scaling, script
from ground.missions.scaling import AxisScaling, MissionScaling
from mavlink_io.errors import InputError, OperationError
from sysid import prior_knowledge
from sysid.design import initial
from sysid.design.initial import InitialDesign
from sysid.monte_carlo import perturbed_vehicle
from sysid.monte_carlo.readiness import Obstacle, Readiness, find_obstacle
from sysid.planes import PLANES
from sysid.test_design.vehicle_scale import VehicleScale, vehicle_scale

REFERENCE = "caribou_nominal"
"""Vehicle for which missions and scenarios were made."""
SHALLOWEST_M = 1.0
"""Smallest depth of the shipped missions (m): for a longer hull it is multiplied by the ratio."""
RATE_LIMIT, RATE_LIMIT_DEGPS = "SID_RATE_MAX", 60.0
"""Parameter of the yaw or pitch rate that ends a test, and its value for Caribou (deg/s)."""
MAX_RATE_LIMIT_DEGPS = 180.0
"""Largest value of RATE_LIMIT for another vehicle (deg/s)."""
SEED = 1
"""Seed of the simulated sea, the same for all campaigns."""


class Preparation(NamedTuple):
    """Parameters and files of a campaign."""

    parameters: dict[str, float]
    """Parameters of the first dive."""
    files: dict[str, str]
    """Text by path in the folder of the campaign: scenario, missions and flown vehicle."""
    notes: tuple[str, ...]
    """What was scaled, one line each; empty for Caribou."""
    warnings: tuple[str, ...] = ()
    """Unusual properties of the flown vehicle, one line each; empty for a shipped one."""


class PreparationRequest(NamedTuple):
    """Vehicle, sea and missions of a campaign."""

    vehicle: str
    scenario: str
    truth: str
    """Vehicle file that is flown; `perturbed` for a random change of the vehicle file."""
    seed: int
    missions: tuple[str, ...]


def prepare(request: PreparationRequest, announce: Callable[[str], None]) -> Preparation:
    """Return parameters and files of a campaign.

    Parameters
    ----------
    request : PreparationRequest
        Vehicle, sea and missions.
    announce : callable
        Called with each step that takes long.

    Returns
    -------
    Preparation
        Parameters of the first dive, and the files that differ from the shipped ones.

    Raises
    ------
    InputError
        The scenario or the vehicle file cannot be used, no gains meet the specification, or a
        mission cannot be completed.
    """
    warnings = prototype.check_flown(flown_file(request))
    content = readiness.scenario_content(request.scenario)
    scripts = {name: script.load(name) for name in request.missions}
    is_caribou = prototype.is_caribou(request.vehicle)
    config = prior_knowledge.vehicle_file(REFERENCE if is_caribou else request.vehicle)
    readiness.check_buoyancy(request.scenario, content, config)
    truth = _truth(request)
    if is_caribou:
        readiness.check_scenario(request.scenario, content, scripts)
        return Preparation(refit.initial_gains(), truth.files, truth.notes, warnings)
    scale = vehicle_scale(config, prior_knowledge.vehicle_file(REFERENCE))
    scripts = {
        name: scaling.scale_script(mission, mission_scaling(scale))
        for name, mission in scripts.items()
    }
    readiness.check_scenario(request.scenario, content, scripts)
    sea = scaled_scenario.scale(request.scenario, content, moment_ratios(scale))
    design = _first_design(request.vehicle)
    untested = {n: s for n, s in scripts.items() if not any(step.test for step in s.step)}
    controlled_degps = design.parameters.get(RATE_LIMIT, math.inf)
    parameters, check, completed = _first_dives(
        request,
        {**design.parameters, RATE_LIMIT: min(controlled_degps, _rate_limit_degps(scale))},
        lambda reduced: Readiness(config, reduced, readiness.moments(sea.content), SEED),
        untested,
    )
    scripts |= completed
    max_deg: dict[str, float] = {
        PLANES[plane].surface: part.max_size_deg for plane, part in scale.planes.items()
    }
    adapted = adaptation.adapt(check, scripts, max_deg, announce)
    flown, obstacle = _completable(check, adapted.scripts)
    if obstacle:
        raise _refusal(request, obstacle)
    missions = {
        f"{MISSIONS_FOLDER}/{name}.toml": scaling.encode(mission) for name, mission in flown.items()
    }
    return Preparation(
        parameters,
        {**({SCENARIO_FILE: sea.text} if sea.text else {}), **missions, **truth.files},
        (
            sea.note,
            _describe(scale),
            *_describe_gains(design),
            *_describe_reductions(design.parameters, parameters),
            *adapted.notes,
            *_describe_descents(flown),
            *truth.notes,
        ),
        warnings,
    )


def flown_file(request: PreparationRequest) -> str:
    """Return the vehicle file that is flown; the one that is perturbed if it is a random change."""
    return request.vehicle if request.truth == prototype.PERTURBED else request.truth


def mission_scaling(scale: VehicleScale) -> MissionScaling:
    """Return the scaling of missions by the ratios of a vehicle."""
    return MissionScaling(
        thrust_pct=scale.thrust_pct,
        time=scale.time,
        leg=scale.leg,
        min_depth_m=SHALLOWEST_M * max(1.0, scale.length),
        axes={
            PLANES[plane].surface: AxisScaling(
                step_size=part.step_size,
                sweep_size=part.sweep_size,
                frequency=part.frequency,
                max_size_deg=part.max_size_deg,
                loop_on=part.loop_on,
            )
            for plane, part in scale.planes.items()
        },
    )


def moment_ratios(scale: VehicleScale) -> dict[str, float]:
    """Return the ratio of disturbance moments to those for Caribou, by plane."""
    return {str(plane): part.moment for plane, part in scale.planes.items()}


class _Truth(NamedTuple):
    """File and note of the flown vehicle."""

    files: dict[str, str]
    notes: tuple[str, ...]


def _truth(request: PreparationRequest) -> _Truth:
    """Return the perturbed vehicle file if it is asked for. Raises InputError."""
    if request.truth != prototype.PERTURBED:
        return _Truth({}, ())
    config = prior_knowledge.vehicle_file(prototype.prior_file_of(request.vehicle))
    note = f"flown vehicle: {config.name} with a random change, seed {request.seed}"
    return _Truth({TRUTH_FILE: perturbed_vehicle.write(config, request.seed)}, (note,))


def _first_design(vehicle: str) -> InitialDesign:
    """Return the first gains. Raises InputError."""
    try:
        return prototype.design(vehicle)
    except OperationError as error:
        raise InputError(f"--vehicle {vehicle}: no first gains: {error}") from None


def _rate_limit_degps(scale: VehicleScale) -> float:
    """Return SID_RATE_MAX: the limit for Caribou times the ratio of frequencies, if above 1."""
    fastest = max(part.frequency for part in scale.planes.values())
    return round(min(MAX_RATE_LIMIT_DEGPS, max(1.0, fastest) * RATE_LIMIT_DEGPS), 1)


def _describe_gains(design: InitialDesign) -> tuple[str, ...]:
    """Return a note if the first gains meet relaxed limits only."""
    if design.spec == initial.SPEC:
        return ()
    return (
        f"first gains: none reach GM {initial.SPEC.gm_db:g} dB and PM {initial.SPEC.pm_deg:g} deg;"
        f" designed for {design.spec.gm_db:g} dB and {design.spec.pm_deg:g} deg",
    )


def _first_dives(
    request: PreparationRequest,
    parameters: Mapping[str, float],
    vehicle: Callable[[Mapping[str, float]], Readiness],
    scripts: Mapping[str, script.Script],
) -> tuple[dict[str, float], Readiness, dict[str, script.Script]]:
    """Return parameters with which the vehicle completes missions without tests, and the missions.

    An unstable hull may lose its pitch in a fast turn; slower turns and less pitch are tried.
    Raises InputError with the obstacle of the first parameters if those do not help.
    """
    first: Obstacle | None = None
    for reduced in failsafe_limits.with_reductions(parameters):
        check = vehicle(reduced)
        completed, obstacle = _completable(check, scripts)
        if obstacle is None:
            return reduced, check, completed
        first = first or obstacle
        if not first.is_failsafe:
            break
    assert first is not None, "the loop ends with an obstacle"
    raise _refusal(request, first)


def _completable(
    check: Readiness, scripts: Mapping[str, script.Script]
) -> tuple[dict[str, script.Script], Obstacle | None]:
    """Return missions that the simulated vehicle completes, and the obstacle that remains.

    Missions in which it would stay at the surface begin with a descent at full thrust.
    """
    changed = dict(scripts)
    while obstacle := find_obstacle(
        check, {name: script.compile_items(mission) for name, mission in changed.items()}
    ):
        where = obstacle.where
        if not obstacle.is_afloat or scaling.descends_at_full_thrust(changed[where]):
            return changed, obstacle
        changed[where] = scaling.descend_at_full_thrust(changed[where])
    return changed, None


def _refusal(request: PreparationRequest, obstacle: Obstacle) -> InputError:
    """Return the refusal of a vehicle that cannot complete its missions."""
    return InputError(
        f"--vehicle {request.vehicle}: cannot complete a campaign in scenario {request.scenario}:"
        f" {obstacle.where}, simulated with the vehicle file: {obstacle.reason}"
    )


def _describe_reductions(
    designed: Mapping[str, float], flown: Mapping[str, float]
) -> tuple[str, ...]:
    """Return a note with the parameters of the first dives that were reduced."""
    reduced = [
        f"{name} = {value:.3g}"
        for name, value in flown.items()
        if name in failsafe_limits.LIMIT_REASONS and value != designed.get(name)
    ]
    if not reduced:
        return ()
    return (f"{', '.join(reduced)}: with larger ones a simulated mission ends with a failsafe",)


def _describe_descents(scripts: Mapping[str, script.Script]) -> tuple[str, ...]:
    """Return a note with the missions that begin with a descent at full thrust."""
    names = [name for name, mission in scripts.items() if scaling.descends_at_full_thrust(mission)]
    if not names:
        return ()
    return (
        f"descent at full thrust, without which the vehicle stays at the surface in simulation:"
        f" {', '.join(names)}",
    )


def _describe(scale: VehicleScale) -> str:
    """Return the scaling of the missions as text."""
    parts = [
        f"{PLANES[plane].surface} steps {part.step_size:.2g}, sweeps {part.sweep_size:.2g} times"
        f" the size, {part.frequency:.2g} times the frequency, at most {part.max_size_deg:.1f} deg"
        for plane, part in scale.planes.items()
    ]
    return (
        f"missions: Caribou's at {scale.thrust_pct:g} % thrust, legs of {scale.leg:.2g} and steps"
        f" of {scale.time:.2g} times the duration; {'; '.join(parts)}"
    )
