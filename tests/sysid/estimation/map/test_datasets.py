"""Part of a run that the joint fit simulates, for stable and unstable vehicles."""

import math
from pathlib import Path

import numpy as np
import pytest

from ground.campaign import prototype
from sitl.vehicle import config
from sysid import prior_knowledge
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.runs import Run
from sysid.estimation.map import datasets, fit, steady_state
from sysid.estimation.map.datasets import dataset, max_lead_s
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import perturbed_vehicle
from sysid.planes import Plane
from sysid.test_design import prior as design_priors
from sysid.validation import crossover
from tests.sysid import sea

UNSTABLE = Path(__file__).parents[4] / "benchmarks/campaigns/vehicles/unstable_yaw.toml"
"""Hull with small fins; its pole in yaw is 0.26 1/s."""


def nominal(vehicle: config.VehicleConfig) -> CandidateVehicle:
    prior = design_priors.from_file(vehicle)
    return prior.vehicle(prior.mean)


def test_run_of_stable_vehicle_begins_when_duct_is_known(
    campaign: list[Run], bench: config.VehicleConfig
) -> None:
    lead_s = max_lead_s(nominal(bench), Plane.YAW)
    data = dataset(campaign[0], lead_s)
    assert data.run.time_s[0] == pytest.approx(-sea.PREROLL_S + datasets.DUCT_SETTLING_S)


def test_run_of_unstable_vehicle_begins_when_errors_grow_little(campaign: list[Run]) -> None:
    vehicle = nominal(config.load(UNSTABLE))
    lead_s = max_lead_s(vehicle, Plane.YAW)
    poles = np.linalg.eigvals(steady_state.linear_plane(vehicle, Plane.YAW).A)
    assert math.exp(max(poles.real) * lead_s) == pytest.approx(math.exp(0.5))
    data = dataset(campaign[0], lead_s)
    assert data.run.time_s[0] == pytest.approx(-lead_s, abs=0.02)
    assert dataset(campaign[0], 0.1).run.time_s[0] == pytest.approx(datasets.MAX_START_S)


@pytest.mark.slow
def test_unstable_vehicle_is_identified_from_tests_after_steady_flight() -> None:
    """Tolerance: three standard deviations of the estimate are 0.4 dB and 3 deg.

    With the whole steady flight before each test the estimate is off by 1 dB and 9 deg.
    """
    prior = config.load(UNSTABLE)
    truth = perturbed_vehicle.perturb(prior, 1)
    gains = prototype.design(str(UNSTABLE)).parameters
    hold = sea.Hold(
        heading_p=gains["HDG_P"],
        heading_d=gains["HDG_D"],
        heading_i=gains["HDG_I"],
        pitch_p=gains["PTCH_P"],
        pitch_d=gains["PTCH_D"],
        depth_p=gains["DPT_P"],
        depth_i=gains["DPT_I"],
    )
    runs = [
        sea.fly(
            truth,
            Plane.YAW,
            signal,
            name=f"rudder/{number}",
            seed=number,
            hold=hold,
            trim_rad=(-math.radians(truth.tailcone.rudder_bias_deg), 0.0),
        )
        for number, signal in enumerate(
            [*(sea.step(size, 12.0) for size in (8.0, -8.0, 8.0, -8.0)), sea.doublet(8.0, 4.0)]
        )
    ]
    found = fit.fit(runs, prior_knowledge.prior_of(runs, prior), starts=0).vehicle
    at = np.argmin(np.abs(GRID_RADPS - 1.8))
    ratio = (
        crossover.response(found, Plane.YAW)[at] / crossover.response(nominal(truth), Plane.YAW)[at]
    )
    assert abs(20.0 * math.log10(abs(ratio))) < 0.4
    assert abs(math.degrees(np.angle(ratio))) < 3.0
