"""sysid's planning as this tool asks for it; its refusals become this tool's."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ground.campaign import prototype, refit
from ground.errors import InputError, OperationError
from sysid.data.dataset import LogError
from sysid.models.model_file import ModelError
from sysid.refit import RefitError, VehicleFileError
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import plan
from sysid.test_design import prior as design_priors
from sysid.test_design.plan import PlanInfeasibleError, PlanRequest, TestPlan
from sysid.test_design.prior import DesignPrior
from sysid.test_design.safety_margins import UnstableLoopError


def design_prior(prior: str | Path, trim: Path | None, window_s: float) -> DesignPrior:
    """What is known beforehand, and from a trim flight where the surfaces stood. Raises
    BadInputError, FailedError."""

    with _translate_errors():
        found = design_priors.read(prior)
        if trim is None:
            return found
        held = refit.measure_trims(trim, window_s)
        return design_priors.with_trim(
            found, math.radians(held["TRIM_RUD_DEG"]), math.radians(held["TRIM_ELE_DEG"])
        )


def trims(known: DesignPrior) -> dict[str, float]:
    """The parameters from which tests are counted, where they are known."""

    if not known.trims_known:
        return {}
    vehicle = known.vehicle(known.mean)
    return {
        "TRIM_RUD_DEG": math.degrees(design_priors.level_flight(vehicle, "yaw").trim_rad),
        "TRIM_ELE_DEG": math.degrees(design_priors.level_flight(vehicle, "pitch").trim_rad),
    }


def first_gains(model: Path | None, prior: str) -> dict[str, float]:
    """Of a vehicle's first dive, by parameter name; nothing for Caribou, whose autopilot has them.
    Raises as above."""
    return {} if model else prototype.first_dive_parameters(prior)


def loop_gains(aboard: Mapping[str, float]) -> dict[str, float] | None:
    """The loops' own among the parameters aboard; None for the prototype's, as far as the tail is
    livelier weaker.

    Raises:
        BadInputError: some are there and some are missing.
    """

    missing = [name for name in TABLE_3_INITIAL if name not in aboard]
    if len(missing) == len(TABLE_3_INITIAL):
        return None
    if missing:
        raise InputError(
            f"--gains: has no {', '.join(missing)}; give all gains of the loops or none"
        )
    return {name: aboard[name] for name in TABLE_3_INITIAL}


def plan_tests(
    known: DesignPrior, request: PlanRequest, report: Callable[[str, float], None]
) -> TestPlan:
    """The plan. Raises FailedError where no set of tests is possible."""

    with _translate_errors():
        return plan.plan(known, request, report)


@contextmanager
def _translate_errors() -> Iterator[None]:

    try:
        yield
    except (LogError, ModelError, RefitError, VehicleFileError) as error:
        raise InputError(str(error)) from None
    except (UnstableLoopError, PlanInfeasibleError) as error:
        raise OperationError(str(error)) from None
