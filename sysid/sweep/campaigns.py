"""Campaigns of a sweep: tests, identification and redesign for one vehicle, in one task."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from autopilot.control import params
from autopilot.control.params import Config
from mavlink_io.errors import CaribouError
from mavlink_io.mission_items import MissionItem
from sysid import prior_knowledge, refit
from sysid.data import segments
from sysid.data.dataset import Log
from sysid.data.runs import Run
from sysid.design import pid
from sysid.design.specification import Design, DesignInfeasibleError, Spec
from sysid.estimation.map.problem import Prior
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import samples, simulate
from sysid.monte_carlo.simulate import Sea
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.screening import screen
from sysid.test_design.prior import DesignPrior
from sysid.validation.assess import with_assessment


class SweepMission(NamedTuple):
    """A mission."""

    name: str
    items: tuple[MissionItem, ...]


class CampaignPlan(NamedTuple):
    """Tests that are flown before the gains are redesigned."""

    values: dict[str, float]
    """Parameters of the autopilot during the tests."""
    tests: tuple[SweepMission, ...]
    """Missions whose tests are fitted."""
    held_out: tuple[SweepMission, ...] = ()
    """Missions whose tests validate the model; without them every model that converges is used."""
    spec: Spec = Spec()
    """Limits of the redesign; travel and rate are those of the vehicle's tailcone."""


class CampaignResult(NamedTuple):
    """Gains of a campaign."""

    config: Config
    """Redesigned gains; those of the tests if there is a failure."""
    tests_s: float
    """Duration of all tests with their transits: time in the water."""
    failure: str = ""
    """Why no gains were designed; empty for redesigned gains."""


def run(
    plan: CampaignPlan, vehicle: CandidateVehicle, prior: DesignPrior, sea: Sea, seed: Sequence[int]
) -> CampaignResult:
    """Fly the tests of a campaign on a vehicle, identify it, and redesign the gains.

    Parameters
    ----------
    plan : CampaignPlan
        Tests, and the gains that fly them.
    vehicle : CandidateVehicle
        The vehicle; the identification receives only the logs.
    prior : DesignPrior
        Knowledge of the vehicle before its tests.
    sea : Sea
        Sea of the tests.
    seed : sequence of int
        Seed; each mission has its own noise.

    Returns
    -------
    CampaignResult
        Gains with the trims that a trim flight gives, and the duration of the tests.

    Raises
    ------
    MissionRejectedError
        The autopilot rejects a test mission.
    """
    values = {**plan.values, **samples.trims_deg(vehicle)}
    config = params.config(values)
    logs = []
    for number, mission in enumerate((*plan.tests, *plan.held_out), start=1):
        flown = simulate.fly(vehicle, prior.noise, mission.items, config, sea, (*seed, number))
        logs.append(replace(flown.log, name=mission.name))
    tests_s = float(sum(log.attitude.time_s[-1] for log in logs))
    fitted, held_out = logs[: len(plan.tests)], logs[len(plan.tests) :]
    try:
        model = _identify(_accepted(fitted), _accepted(held_out), prior, values)
        gains = _redesign(model, plan.spec, prior, values).gains
    except (CaribouError, np.linalg.LinAlgError) as error:
        return CampaignResult(config, tests_s, str(error))
    return CampaignResult(params.config({**values, **gains}), tests_s)


def _accepted(logs: Sequence[Log]) -> list[Run]:
    """Return the tests of the logs that pass screening."""
    runs = [run for log in logs for run in segments.cut_runs(log)]
    return [screening.run for screening in screen(runs) if screening.accepted]


def _identify(
    runs: Sequence[Run], held_out: Sequence[Run], prior: DesignPrior, values: dict[str, float]
) -> IdentifiedModel:
    """Return the model of the runs. Raises DesignInfeasibleError if it cannot be used."""
    if not runs:
        raise DesignInfeasibleError("no test passed the screening")
    before = (
        Prior(prior.config, prior.biases_rad, prior.mean, prior.covariance)
        if prior.trims_known
        else prior_knowledge.prior_of(runs, prior.config)
    )
    model, refitted = refit.identify_without_outliers(runs, before, prior.name)
    if model.convergence.failures:
        raise DesignInfeasibleError(f"the fit failed: {'; '.join(model.convergence.failures)}")
    if not held_out:
        return model
    model = with_assessment(model, refitted.accepted_runs, held_out, _gains(values), prior.config)
    if model.assessment is None or not model.assessment.fit_for_redesign:
        reasons = model.assessment.reasons if model.assessment else ("no assessment",)
        raise DesignInfeasibleError(f"the model is not fit for redesign: {'; '.join(reasons)}")
    return model


def _redesign(
    model: IdentifiedModel, limits: Spec, prior: DesignPrior, values: dict[str, float]
) -> Design:
    """Return the redesign for the vehicle's tailcone. Raises DesignInfeasibleError.

    The limits are those of the plan. `ground campaign` relaxes its own ones step by step
    (`gain_selection`), which would replace limits that a plan states.
    """
    tail = prior.config.tailcone
    spec = msgspec.structs.replace(limits, travel_deg=tail.travel_deg, rate_degps=tail.rate_degps)
    return pid.redesign(model, spec, prior.config, _gains(values))


def _gains(values: dict[str, float]) -> dict[str, float]:
    """Return the gains of the tests; those that are not given are the initial ones."""
    return {name: values.get(name, gain) for name, gain in TABLE_3_INITIAL.items()}
