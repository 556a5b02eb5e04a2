"""Interface to the test design of sysid, for the command `ground design-test`."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from ground.campaign import prototype, refit
from mavlink_io.errors import InputError
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import plan
from sysid.test_design import prior as design_priors
from sysid.test_design.plan import PlanRequest, TestPlan
from sysid.test_design.prior import DesignPrior

DEFAULT_VEHICLE = "caribou_nominal"
"""Vehicle file of a design without a model."""


def design_prior(model: Path | None, vehicle: str | None, trim: Path | None) -> DesignPrior:
    """Return the prior of a test design.

    Parameters
    ----------
    model : Path, optional
        Model of an earlier refit.
    vehicle : str, optional
        Name or path of the vehicle file; with a model, in place of the one in it.
    trim : Path, optional
        Log of a straight and level flight, from which the trims are measured.

    Raises
    ------
    InputError
        A file cannot be used.
    OperationError
        The trim flight was not steady.
    """
    design_prior = (
        design_priors.read(model, refit.read_vehicle(vehicle))
        if model
        else design_priors.read(vehicle or DEFAULT_VEHICLE)
    )
    if trim is None:
        return design_prior
    trims_deg = refit.measure_trims(trim)
    return design_priors.with_trim(
        design_prior,
        math.radians(trims_deg["TRIM_RUD_DEG"]),
        math.radians(trims_deg["TRIM_ELE_DEG"]),
    )


def trims(prior: DesignPrior) -> dict[str, float]:
    """Return the trim parameters about which tests are flown; empty if they are not known."""
    if not prior.trims_known:
        return {}
    vehicle = prior.vehicle(prior.mean)
    return {
        "TRIM_RUD_DEG": math.degrees(design_priors.level_flight(vehicle, Plane.YAW).trim_rad),
        "TRIM_ELE_DEG": math.degrees(design_priors.level_flight(vehicle, Plane.PITCH).trim_rad),
    }


def first_gains(prior: DesignPrior) -> dict[str, float]:
    """Return the gains of a vehicle's first dive by parameter name.

    Empty for Caribou, whose gains are the defaults of the autopilot.

    Raises
    ------
    OperationError
        No gains meet the specification.
    """
    config = prior.config
    return {} if prototype.is_caribou(config) else prototype.design(config).parameters


def loop_gains(parameters: Mapping[str, float]) -> dict[str, float] | None:
    """Return the gains of the control loops among the parameters.

    None if there is none: then the paper's prototype gains are used, scaled to the vehicle.

    Raises
    ------
    InputError
        Some of the gains are missing.
    """
    missing = [name for name in TABLE_3_INITIAL if name not in parameters]
    if len(missing) == len(TABLE_3_INITIAL):
        return None
    if missing:
        raise InputError(
            f"--gains: has no {', '.join(missing)}; give all gains of the loops or none"
        )
    return {name: parameters[name] for name in TABLE_3_INITIAL}


def plan_tests(
    prior: DesignPrior, request: PlanRequest, report: Callable[[str, float], None]
) -> TestPlan:
    """Return the plan. Raises OperationError if no set of tests is feasible."""
    return plan.plan(prior, request, report)
