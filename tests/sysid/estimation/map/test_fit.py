"""Joint estimate against a known truth: errors within the stated ones, no claim without data."""

import math
from pathlib import Path

import numpy as np
import pytest

from sitl.vehicle import build_model, config
from sysid import refit
from sysid.data.runs import Run
from sysid.estimation.map import steady_state
from sysid.models import json_record, linear_planes, parameters, prediction
from sysid.models import model_file as models
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import INERTIAS, NAMES, PARAMETERS
from sysid.planes import PLANES, Plane
from tests.sysid import sea

TRIM = (math.radians(6.0), math.radians(1.0))


def true_z(truth: config.VehicleConfig, prior: config.VehicleConfig) -> dict[str, float]:
    """Parameters of the truth in the coordinates of the estimate, where vehicle files hold them."""
    true_column = parameters.to_table_1_column(truth.linear)._asdict()
    prior_column = parameters.to_table_1_column(prior.linear)._asdict()
    z = {}
    for parameter in PARAMETERS:
        name = parameter.name
        added_inertia = prior_column[INERTIAS[name]] if name in INERTIAS else 0.0
        if name in prior_column:
            z[name] = (
                math.log((true_column[name] - added_inertia) / (prior_column[name] - added_inertia))
                / parameter.prior_sd
            )
        elif name == "backlash":
            z[name] = (
                math.log(truth.tailcone.backlash_deg / parameters.backlash_deg(prior))
                / parameter.prior_sd
            )
        elif "bias" not in name:
            z[name] = 0.0
    return z


def test_fit_errors_match_stated_covariance(
    model: IdentifiedModel, field: config.VehicleConfig, bench: config.VehicleConfig
) -> None:
    """Squared error in the metric of the stated covariance; its expectation is one."""
    truth = true_z(field, bench)
    index = [NAMES.index(name) for name in truth]
    covariance = np.array(model.joint.covariance)[np.ix_(index, index)]
    error = np.array(model.joint.z)[index] - np.array(list(truth.values()))
    normalised_square = error @ np.linalg.solve(covariance, error) / len(error)
    assert 0.2 < normalised_square < 2.5
    assert np.max(np.abs(error) / np.sqrt(np.diag(covariance))) < 3.5


def test_fit_design_numbers_within_three_sd(
    model: IdentifiedModel, field: config.VehicleConfig
) -> None:
    vehicle = parameters.CandidateVehicle(field, build_model.build(field), {})
    for plane in PLANES:
        true_signal = linear_planes.small_signal(steady_state.linear_plane(vehicle, plane))
        plane_model = model.planes[plane]
        for name in ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s"):
            estimate = getattr(plane_model, name)
            assert abs(estimate.value - getattr(true_signal, name)) < 3 * estimate.sd, (plane, name)
        delay = plane_model.delay_s
        assert delay.sd is not None
        assert abs(delay.value - 0.3) < 3 * delay.sd
    bias = model.planes[Plane.YAW].actuator_bias_deg
    assert bias.sd is not None
    assert abs(bias.value + 6.0) < 3 * bias.sd
    assert bias.sd < 0.3


def test_fit_design_numbers_are_precise(model: IdentifiedModel) -> None:
    for plane in PLANES:
        b1, delay = model.planes[plane].b1_per_s2, model.planes[plane].delay_s
        assert b1.sd is not None
        assert b1.sd / b1.value < 0.06
        assert delay.sd is not None
        assert delay.sd < 0.03
    assert model.convergence.agreed
    assert model.convergence.at_bounds == ()


def test_fit_undetermined_coefficients_keep_the_prior(model: IdentifiedModel) -> None:
    """Motion does not determine added mass separately from mass, nor the scale of an equation."""
    coefficients = model.coefficients
    for name in ("Y_vdot", "N_rdot", "M_qdot", "Z_wdot"):
        assert coefficients[name].status == "prior", name
        kept = coefficients[name].posterior_to_prior_sd
        assert kept is not None
        assert kept > 0.8
    for name, coefficient in coefficients.items():
        share = coefficient.posterior_to_prior_sd
        assert share is not None
        assert (coefficient.status == "measured") == (share <= 0.8), name
    assert model.joint.informed_directions < len(NAMES)
    assert model.joint.condition_number is None or model.joint.condition_number > 1e4


def test_scaled_equation_has_the_same_motion(bench: config.VehicleConfig) -> None:
    """Moment coefficients and inertia are scaled together: a null direction without crossflow."""
    vehicle = parameters.candidate_vehicle(bench, dict.fromkeys(PLANES, 0.0), np.zeros(len(NAMES)))
    z = np.zeros(len(NAMES))
    for name in ("N_v", "N_r", "N_dr", "I_zz"):
        z[NAMES.index(name)] = math.log(1.2) / PARAMETERS[NAMES.index(name)].prior_sd
    scaled = parameters.candidate_vehicle(bench, dict.fromkeys(PLANES, 0.0), z)
    before, after = (
        linear_planes.small_signal(steady_state.straight_plane(v, Plane.YAW))
        for v in (vehicle, scaled)
    )
    np.testing.assert_allclose(after, before, rtol=1e-9)


def test_fit_plane_without_runs_keeps_the_prior(
    campaign: list[Run], bench: config.VehicleConfig
) -> None:
    half = refit.identify([run for run in campaign if run.plane == Plane.YAW][:3], bench)
    assert all(
        half.coefficients[name].status == "prior"
        for name in ("Z_w", "M_w", "Z_q", "M_q", "M_de", "z_CM")
    )
    assert any("no run in pitch" in note for note in half.notes)
    assert "pitch" not in half.noise


def test_fit_predicts_held_out_runs_better_than_prior(
    model: IdentifiedModel, field: config.VehicleConfig
) -> None:
    signals: list[tuple[Plane, np.ndarray]] = [
        (Plane.YAW, sea.step(4.0, 20.0)),
        (Plane.YAW, sea.step(-6.0, 20.0)),
        (Plane.YAW, sea.doublet(6.0, 6.0)),
        (Plane.PITCH, sea.step(2.5, 8.0)),
        (Plane.PITCH, sea.step(10.0, 6.0)),
        (Plane.PITCH, sea.doublet(4.0, 3.0)),
    ]
    held_out = [
        sea.fly(
            field, plane, signal, name=f"unseen/{k}", seed=5000 + 10 * k + repeat, trim_rad=TRIM
        )
        for k, (plane, signal) in enumerate(signals)
        for repeat in range(3)
    ]
    qualities = prediction.quality(model, held_out)
    for plane in PLANES:
        errors = prediction.mean_rate_errors(qualities, plane)
        assert errors is not None
        prior, refitted = errors
        assert refitted < prior, plane


def test_fit_prediction_error_without_noise_is_small(
    model: IdentifiedModel, field: config.VehicleConfig
) -> None:
    quiet = sea.Sensors(0.0, 0.0, 0.0, 0.0)
    for plane in PLANES:
        signal = sea.doublet(5.0, 4.0)
        run = sea.fly(field, plane, signal, level=sea.CALM, sensors=quiet, trim_rad=TRIM)
        (score,) = prediction.quality(model, [run])
        assert score.model_mse_deg2ps2 < 0.5 * score.prior_mse_deg2ps2, plane
        assert score.variance_accounted_for > 0.97


@pytest.mark.slow
def test_identify_same_runs_give_same_bytes(
    campaign: list[Run], bench: config.VehicleConfig, tmp_path: Path
) -> None:
    few = [campaign[0], campaign[1], campaign[7], campaign[8]]
    first, second = (refit.identify(few, bench) for _ in range(2))
    assert json_record.encode(first) == json_record.encode(second)
    models.write(first, tmp_path / "model.json")
    assert models.read(tmp_path / "model.json") == first


def test_identify_earlier_model_as_prior_reduces_covariance(
    campaign: list[Run], bench: config.VehicleConfig
) -> None:
    """The second half of the runs, with the first half as the prior, reduces the covariance."""
    first = refit.identify(campaign[:3] + campaign[7:9], bench)
    second = refit.identify(campaign[3:7] + campaign[9:], bench, earlier=first)
    assert np.all(np.diag(second.joint.covariance) <= np.diag(first.joint.covariance) * 1.001)


def test_identify_paper_method_reports_rank_deficiency(
    campaign: list[Run], bench: config.VehicleConfig
) -> None:
    paper_model = refit.identify(campaign, bench, method="paper")
    assert paper_model.joint.rank < 15
    assert all(
        coefficient.status != "measured" and coefficient.sd is None
        for coefficient in paper_model.coefficients.values()
    )
    assert any("no unique solution" in note for note in paper_model.notes)


@pytest.mark.parametrize("bad", ["caribou_truth", "nowhere.toml", "nowhere.json"])
def test_refit_invalid_prior_is_rejected_in_one_line(bad: str) -> None:
    with pytest.raises(ValueError, match=bad.split(".")[0]) as refusal:
        refit.refit(refit.RefitRequest(paths=[], prior=bad))
    assert "\n" not in str(refusal.value)
