"""The pressure of waves in a design: it moves the measured depth, and the loop follows."""

import numpy as np
import pytest
from msgspec.structs import replace

from sysid.control_analysis import loop_transfer
from sysid.design import design_model, disturbance_response, pid
from sysid.design.pid import Spec
from sysid.models.model_file import IdentifiedModel, NoiseModel
from sysid.models.parameters import NAMES
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_3_IMPROVED, TABLE_3_INITIAL


@pytest.fixture(scope="module")
def in_swell(model: IdentifiedModel) -> IdentifiedModel:
    """Return a model whose tests, 8 m deep, showed 1 cm of depth by a swell of 6 s."""
    pitch = replace(
        model.noise[Plane.PITCH],
        wave_frequency_hz=1.0 / 6.0,
        wave_depth_m=0.01,
        test_depth_m=8.0,
    )
    return replace(model, noise={**model.noise, Plane.PITCH: pitch})


def test_measured_depth_follows_sensitivity_of_depth_loop(in_swell: IdentifiedModel) -> None:
    """Reference: an error of the depth sensor passes 1 / (1 + L), L opened at the depth error."""
    vehicle = design_model.from_model(in_swell)
    _, pressure = disturbance_response.disturbances(vehicle, Plane.PITCH)
    _, depth, _ = disturbance_response.depth_responses(vehicle, TABLE_3_IMPROVED, pressure.states)
    loop = loop_transfer.depth_loops(vehicle.pitch, TABLE_3_IMPROVED)["depth"]
    assert depth == pytest.approx(1.0 / (1.0 + loop), rel=1e-9)


def test_pressure_of_waves_adds_variance(in_swell: IdentifiedModel, model: IdentifiedModel) -> None:
    with_waves, without = (
        disturbance_response.depth_rms(design_model.from_model(each, depth_m=8.0), TABLE_3_IMPROVED)
        for each in (in_swell, replace(model, noise=_without_pressure(in_swell)))
    )
    vehicle = design_model.from_model(in_swell, depth_m=8.0)
    _, pressure = disturbance_response.disturbances(vehicle, Plane.PITCH)
    responses = disturbance_response.depth_responses(vehicle, TABLE_3_IMPROVED, pressure.states)
    radps = loop_transfer.GRID_RADPS
    added = [np.trapezoid(np.abs(r) ** 2 * pressure.density, radps) / np.pi for r in responses]
    assert np.square(with_waves) - np.square(without) == pytest.approx(added, rel=1e-6)
    assert np.trapezoid(pressure.density, radps) / np.pi == pytest.approx(0.01**2, rel=0.01)


def test_waves_near_surface_are_larger(in_swell: IdentifiedModel) -> None:
    shallow, deep = (
        design_model.from_model(in_swell, depth_m=depth_m).disturbance[Plane.PITCH]
        for depth_m in (1.0, 8.0)
    )
    # Airy: exp(k d) with k = omega^2 / g = 0.1118 1/m and d = 7 m.
    assert shallow.wave_depth_m / deep.wave_depth_m == pytest.approx(2.187, rel=1e-3)
    assert shallow.wave_accel_degps2 / deep.wave_accel_degps2 == pytest.approx(2.187, rel=1e-3)


def test_assumed_waves_make_a_loop_that_amplifies_waves_less(model: IdentifiedModel) -> None:
    """Without sampled vehicles, whose limits change the gains by as much as the waves do."""
    nothing = tuple((0.0,) * len(NAMES) for _ in NAMES)
    certain = replace(model, joint=replace(model.joint, covariance=nothing))
    waves = Spec(assumed_wave_depth_m=0.03)
    vehicle = disturbance_response.assume_waves(
        design_model.from_model(model), TABLE_3_INITIAL, waves
    )
    _, pressure = disturbance_response.disturbances(vehicle, Plane.PITCH)

    def measured_depth_m(wave_depth_m: float) -> float:
        """Return the rms by waves of 3 cm with gains that are designed for waves of this size."""
        spec = Spec(assumed_wave_depth_m=wave_depth_m, assumed_wave_ratio=0.0)
        gains = pid.redesign(certain, spec).gains
        _, depth, _ = disturbance_response.depth_responses(vehicle, gains, pressure.states)
        power = np.abs(depth) ** 2 * pressure.density
        return float(np.sqrt(np.trapezoid(power, loop_transfer.GRID_RADPS) / np.pi))

    assert measured_depth_m(0.03) < 0.95 * measured_depth_m(0.0)


def test_assumed_waves_are_the_least(in_swell: IdentifiedModel) -> None:
    vehicle = design_model.from_model(in_swell, depth_m=8.0)
    _, depth_m, _ = disturbance_response.depth_rms(vehicle, TABLE_3_INITIAL)
    assumed = [
        disturbance_response.assume_waves(
            vehicle,
            TABLE_3_INITIAL,
            Spec(assumed_wave_depth_m=wave_depth_m, assumed_wave_ratio=ratio),
        )
        .disturbance[Plane.PITCH]
        .wave_depth_m
        for wave_depth_m, ratio in ((0.0, 0.0), (0.005, 0.0), (0.03, 0.0), (0.0, 2.0))
    ]
    assert assumed == pytest.approx([0.01, 0.01, 0.03, 2.0 * depth_m])


def test_depth_estimate_of_tests_with_waves_follows_the_pressure(
    in_swell: IdentifiedModel, model: IdentifiedModel
) -> None:
    """Campaigns in swell: remus100 held its depth half as well with the redesigned gains."""
    calm = replace(model, noise=_without_pressure(model))
    with_waves, without = pid.redesign(in_swell), pid.redesign(calm)
    assert with_waves.gains["EST_DPT_TIME"] == pid.WAVE_DEPTH_TIME_S
    assert "pressure" in with_waves.reasons["EST_DPT_TIME"]
    assert "EST_DPT_TIME" not in without.gains


def _without_pressure(model: IdentifiedModel) -> dict[Plane, NoiseModel]:
    """Return the noise of a model without the pressure of waves."""
    pitch = replace(model.noise[Plane.PITCH], wave_depth_m=0.0)
    return {**model.noise, Plane.PITCH: pitch}
