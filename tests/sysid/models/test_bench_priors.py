"""Update of the prior with bench measurements, and errors for invalid files."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from sitl.vehicle import config
from sysid.estimation.map.problem import Prior
from sysid.models import bench_priors, parameters
from sysid.models.parameters import NAMES, PARAMETERS
from sysid.planes import PLANE_OF_SURFACE, PLANES, Plane

AXIS = {
    "natural_frequency_radps": {"value": 3.3, "sd": 0.03},
    "damping_ratio": {"value": 0.6, "sd": None},
    "delay_s": {"value": 0.25, "sd": 0.04},
    "rate_degps": {"value": 12.0, "sd": 0.3},
    "backlash_deg": {"value": 0.0, "sd": 0.01},
    "gain": {"value": 1.0, "sd": 0.01},
}


@pytest.fixture
def prior(bench: config.VehicleConfig) -> Prior:
    return Prior(
        bench,
        dict.fromkeys(PLANES, 0.0),
        np.zeros(len(NAMES)),
        parameters.prior_covariance(),
    )


def written(path: Path, value: object) -> Path:
    path.write_text(json.dumps(value), encoding="utf-8")
    return path


def test_bench_measurement_of_an_assumed_lag_decides(prior: Prior, tmp_path: Path) -> None:
    """A lag that is known to 30 % in the vehicle file takes the value of the bench test."""
    tail = replace(prior.config.tailcone, lag_relative_sd=0.3)
    assumed = prior._replace(config=replace(prior.config, tailcone=tail))
    bench = written(tmp_path / "bench.json", {"rudder": {"model": AXIS, "points": []}})
    after = bench_priors.update_prior(assumed, bench_priors.read(bench))
    vehicle = parameters.candidate_vehicle(after.config, after.biases_rad, after.mean)
    found = vehicle.actuators[Plane.YAW].natural_frequency_radps
    assert found == pytest.approx(3.3, rel=1e-3)
    i = NAMES.index("natural_frequency")
    assert 0.3 * math.sqrt(after.covariance[i, i]) == pytest.approx(0.03 / 3.3, rel=1e-2)


def test_bench_measurement_updates_prior(prior: Prior, tmp_path: Path) -> None:
    """The mean of two independent normal estimates is weighted by their information."""
    bench = written(tmp_path / "bench.json", {"rudder": {"model": AXIS, "points": []}})
    incline = written(
        tmp_path / "incline.json",
        {"z_cm_m": {"value": -0.015, "sd": 0.0003}, "file": "caribou_nominal"},
    )
    after = bench_priors.update_prior(prior, bench_priors.read(bench, incline))
    expected = {
        "natural_frequency": (math.log(1.1), 0.03 / 3.3),
        "rate_limit": (math.log(0.8), 0.3 / 12.0),
        "z_CM": (math.log(0.015 / 0.021), 0.02),
        "delay_yaw": (-0.05, 0.05),
    }
    for name, (moved, sd) in expected.items():
        i = NAMES.index(name)
        scale = PARAMETERS[i].prior_sd
        weight = scale**2 / (scale**2 + sd**2)
        assert after.mean[i] * scale == pytest.approx(weight * moved), name
        assert math.sqrt(after.covariance[i, i]) * scale == pytest.approx(math.sqrt(weight) * sd), (
            name
        )
    for name in ("damping_ratio", "delay_pitch", "elevator_frequency", "Y_v"):
        assert after.mean[NAMES.index(name)] == 0.0
        assert after.covariance[NAMES.index(name), NAMES.index(name)] == 1.0


def test_each_axis_of_bench_informs_its_own_drive(prior: Prior, tmp_path: Path) -> None:
    """The drives after the bench test are those that were measured, to one in a hundred."""
    measured = {"rudder": (3.3, 0.55), "elevator": (2.6, 0.8)}
    axes = {
        name: {
            "model": AXIS
            | {
                "natural_frequency_radps": {"value": frequency, "sd": 0.01},
                "damping_ratio": {"value": damping, "sd": 0.002},
            }
        }
        for name, (frequency, damping) in measured.items()
    }
    after = bench_priors.update_prior(
        prior, bench_priors.read(written(tmp_path / "bench.json", axes))
    )
    drives = parameters.actuators(prior.config, prior.biases_rad, after.mean)
    for name, (frequency, damping) in measured.items():
        drive = drives[PLANE_OF_SURFACE[name]]
        assert drive.natural_frequency_radps == pytest.approx(frequency, rel=0.01), name
        assert drive.damping_ratio == pytest.approx(damping, rel=0.01), name


def test_centre_of_mass_above_axis_is_rejected(prior: Prior) -> None:
    with pytest.raises(bench_priors.BenchResultError, match=r"z_CM = 0.01 .*-0.021"):
        bench_priors.update_prior(prior, [bench_priors.BenchMeasurement("z_CM", 0.01, 0.001)])


@pytest.mark.parametrize("text", ["{", '{"rudder": {}}', '{"keel": {}}'])
def test_invalid_bench_file_rejected_in_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "other.json"
    path.write_text(text, encoding="utf-8")
    for bad in (path, tmp_path / "missing.json"):
        with pytest.raises(
            bench_priors.BenchResultError, match=f"{bad.name}.*ground bench"
        ) as refusal:
            bench_priors.read(tailcone=bad)
        assert "\n" not in str(refusal.value)
