"""The paper's adjustment of the model (figures 5 and 6), as a loop with its error at each step."""

from collections.abc import Sequence

import numpy as np

from sitl.vehicle import build_model
from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import Run
from sysid.estimation.map import steady_state
from sysid.models import parameters
from sysid.models.parameters import NAMES
from sysid.planes import Plane
from sysid.reproduction import paper_method
from sysid.reproduction.paper_method import PlaneFit

MAX_STEP_DEG = 10.0
"""Largest duct angle of the steps that the paper used."""


def adjust(runs: Sequence[Run], prior: VehicleConfig) -> dict[Plane, PlaneFit]:
    """Adjust the first-principles model to steps by the paper's method.

    Parameters
    ----------
    runs : Sequence of Run
        Tests; steps below `MAX_STEP_DEG` are used.
    prior : VehicleConfig
        Vehicle file of the first-principles model.

    Returns
    -------
    dict
        Fit of each plane with its error after each step.
    """
    steps = [run for run in runs if run.wave == "step" and abs(run.magnitude_deg) < MAX_STEP_DEG]
    biases = steady_state.trim_biases(prior, build_model.build(prior), steps)
    nominal = parameters.candidate_vehicle(prior, biases, np.zeros(len(NAMES)))
    return paper_method.fit(steps, prior, nominal.actuators)
