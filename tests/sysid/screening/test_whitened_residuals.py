"""Whitened residuals with the unknown position of the duct, and sizes of tests."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.vehicle import config
from sysid import prior_knowledge
from sysid.data.runs import Run
from sysid.estimation.map import fit, steady_state
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.models import linear_planes
from sysid.planes import Plane
from sysid.screening.anomaly_models import Kind, size_rad, sizes_of_test
from sysid.screening.whitened_residuals import RunResiduals, linearise_runs

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def prior(campaign: list[Run], bench: config.VehicleConfig) -> Prior:
    return prior_knowledge.prior_of(campaign, bench)


@pytest.fixture(scope="module")
def fitted(campaign: list[Run], prior: Prior) -> Fit:
    return fit.fit(campaign, prior)


def with_steps(fitted: Fit, step_deg: float) -> Fit:
    tailcone = msgspec.structs.replace(fitted.vehicle.config.tailcone, step_deg=step_deg)
    vehicle_file = msgspec.structs.replace(fitted.vehicle.config, tailcone=tailcone)
    return fitted._replace(vehicle=fitted.vehicle._replace(config=vehicle_file))


def signature(run: RunResiduals, kind: Kind) -> Array:
    return next(s.white[0] for s in run.signatures if s.kind == kind)


def test_linearise_runs_motor_steps_are_offset_and_gain_noise(fitted: Fit, prior: Prior) -> None:
    """Reference: a' (1 + B B')^-1 a by a dense inverse, B one standard deviation of each error."""
    step_deg = 0.5
    smooth, stepped = (linearise_runs(with_steps(fitted, s), prior) for s in (0.0, step_deg))
    for before, after in zip(smooth, stepped, strict=True):
        gain, offset = signature(before, "gain error"), signature(before, "actuator offset")
        end_sd_deg = step_deg / math.sqrt(12.0)
        size_deg = math.degrees(before.size_rad)
        errors = np.stack([offset * end_sd_deg, gain * 100.0 * end_sd_deg / size_deg]) / math.sqrt(
            2
        )
        inverse = np.linalg.inv(np.eye(gain.size) + errors.T @ errors)
        power = float(np.sum(signature(after, "gain error") ** 2))
        assert power == pytest.approx(float(gain @ inverse @ gain), rel=1e-6)


def test_sizes_of_test_are_deflection_and_its_acceleration(
    fitted: Fit, campaign: list[Run]
) -> None:
    run = next(run for run in campaign if run.name == "rudder/2")  # step of 5 deg
    sizes = sizes_of_test(fitted.vehicle, run)
    plane = steady_state.linear_plane(fitted.vehicle, Plane.YAW)
    assert sizes["actuator slip"] == sizes["actuator offset"] == pytest.approx(5.0, rel=0.02)
    assert sizes["gust"] == pytest.approx(
        sizes["actuator slip"] * abs(linear_planes.small_signal(plane).b1_per_s2)
    )
    assert sizes["gain error"] == sizes["speed off"] == 100.0


def test_size_of_test_excludes_the_loop_that_takes_over(campaign: list[Run]) -> None:
    """The loop moves the rudder to its stop in the last two samples."""
    run = next(run for run in campaign if run.name == "rudder/2")
    rudder_rad = run.rudder_rad.copy()
    rudder_rad[-2:] = -run.travel_rad
    assert size_rad(replace(run, rudder_rad=rudder_rad)) == size_rad(run)
