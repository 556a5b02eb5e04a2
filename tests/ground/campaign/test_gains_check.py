"""Gains are checked on the model that their file names before they are loaded."""

from pathlib import Path

import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from ground.campaign import refit
from ground.campaign.gains_check import UnsafeGainsError, check_gains
from ground.cli.main import app
from ground.client import param_file
from mavlink_io.errors import InputError
from sitl.vehicle import config
from sysid.models import model_file
from sysid.monitor.performance_spec import PerformanceBaseline, PredictedStatistic, encode
from sysid.test_design import prior
from tests.sysid.monte_carlo.files import model_of

GAINS = refit.improved_gains()
"""The paper's improved gains: margins of 12 dB and 51 deg or more on the nominal vehicle."""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "model.json"
    model_file.write(model_of(prior.from_file(config.load("caribou_nominal"))), path)
    return path


def gains_file(model: Path, changes: dict[str, float]) -> Path:
    """Write gains that were designed on a model and changed afterwards."""
    baseline = PerformanceBaseline(
        model_sha256=model_file.sha256_of_model(model_file.read(model)),
        version="1",
        speed_mps=1.3,
        thrust=0.58,
        heading_resonance_radps=2.0,
        pitch_resonance_radps=2.0,
        specification={"damping": 0.6, "gm_db": 8.0},
        predicted={"heading_deg": PredictedStatistic(0.0, 0.0, 0.4, 0.8, 0.1, 3.0)},
    )
    text = encode(baseline, GAINS, dict.fromkeys(GAINS, "reason"))
    for name, value in changes.items():
        text = text.replace(f"{name},{GAINS[name]:.6g}", f"{name},{value:g}")
    path = model.parent / "gains.param"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, ""),
        ({"HDG_P": 8.0}, r"on .*model\.json the .* is .*, and must be at least"),
        ({"DPT_P": -0.5}, r"the damping of the .* is -.* \(unstable\), and must be at least 0\.5"),
    ],
)
def test_gains_beyond_their_limits_are_refused(
    model: Path, changes: dict[str, float], reason: str
) -> None:
    file = gains_file(model, changes)
    if not reason:
        assert check_gains(file, param_file.load(file), None) == ""
        return
    with pytest.raises(UnsafeGainsError, match=reason):
        check_gains(file, param_file.load(file), None)


def test_gains_of_an_absent_model_are_reported_as_not_checked(model: Path, tmp_path: Path) -> None:
    file = tmp_path / "gains.param"
    file.write_text(gains_file(model, {"HDG_P": 8.0}).read_text())
    values = param_file.load(file)
    assert "is not in this folder; give --model" in check_gains(file, values, None)
    with pytest.raises(UnsafeGainsError):
        check_gains(file, values, model)


def test_vehicle_that_is_not_shipped_is_checked_on_its_file(tmp_path: Path) -> None:
    shipped = config.load("caribou_nominal")
    fitted = model_of(prior.from_file(shipped))
    own = replace(fitted.vehicle, prior="own.toml")
    path, file = tmp_path / "model.json", tmp_path / "gains.param"
    model_file.write(replace(fitted, method="map", vehicle=own), path)
    assert check_gains(file, param_file.load(gains_file(path, {})), None) == ""


def test_gains_of_another_model_are_refused(model: Path, tmp_path: Path) -> None:
    other = tmp_path / "model.json"
    model_file.write(model_of(prior.from_file(config.load("caribou_truth"))), other)
    file = gains_file(model, {})
    with pytest.raises(InputError, match=r"was designed on model .*, and .* is model"):
        check_gains(file, param_file.load(file), other)
    beside = tmp_path / "gains.param"
    beside.write_text(file.read_text())
    assert "was designed on model" in check_gains(beside, param_file.load(beside), None)


def test_plain_parameter_file_is_checked_only_with_a_model(model: Path, tmp_path: Path) -> None:
    file = tmp_path / "plain.param"
    file.write_text("HDG_P,9\n")
    assert check_gains(file, {"HDG_P": 9.0}, None) == ""
    with pytest.raises(InputError, match="was designed on model unknown"):
        check_gains(file, {"HDG_P": 9.0}, model)


def test_gains_without_a_loop_gain_are_refused(model: Path) -> None:
    with pytest.raises(UnsafeGainsError, match="lacks PTCH_I"):
        check_gains(gains_file(model, {}), {"HDG_P": 0, "HDG_I": 0, "HDG_D": 0, "PTCH_P": 0}, None)


def test_unreadable_header_is_reported_and_gains_are_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ground.cli.params.upload", lambda *args, **options: ())
    (tmp_path / "old.param").write_text("# caribou gains 1\nHDG_P,0.5\n")
    done = CliRunner().invoke(app, ["params", "load", str(tmp_path / "old.param")])
    assert done.exit_code == 0
    assert "has format 1" in done.stderr
    assert "not checked" in done.stderr


@pytest.mark.parametrize("force", [False, True])
def test_params_load_refuses_before_it_connects_unless_forced(
    model: Path, force: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    uploaded: list[object] = []

    def upload(*arguments: object, **options: object) -> tuple[()]:
        uploaded.append(arguments)
        return ()

    monkeypatch.setattr("ground.cli.params.upload", upload)
    file = gains_file(model, {"HDG_P": 8.0})
    options = ["--force"] if force else []
    done = CliRunner().invoke(app, ["params", "load", str(file), *options])
    assert bool(uploaded) == force
    if force:
        assert done.exit_code == 0
        assert "loaded by --force" in done.stderr
    else:
        assert isinstance(done.exception, UnsafeGainsError)
        assert "or load them with --force" in str(done.exception)
