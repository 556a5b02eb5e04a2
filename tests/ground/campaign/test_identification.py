"""Summary of an identified model, and refusal of unfit models."""

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from ground.campaign import identification, refit
from ground.cli.main import app
from mavlink_io.errors import InputError, OperationError
from sitl.vehicle import config
from sitl.vehicle.config import VehicleFileError
from sysid import refit as fitting
from sysid import usable_runs
from sysid.models import model_file as models
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane
from sysid.validation.assess import with_assessment
from sysid.validation.results import ModelAssessment
from tests.sysid import sea

TRIM = (math.radians(6.0), math.radians(1.0))


@pytest.fixture(scope="module")
def told() -> IdentifiedModel:
    """A model by the paper's method, which is fast; also compared with itself."""
    field = config.load("caribou_truth")
    runs = [
        sea.fly(field, Plane.YAW, sea.step(d), name=f"r/{d}", seed=int(d) + 20, trim_rad=TRIM)
        for d in (4.0, -4.0)
    ]
    found = fitting.identify(runs, config.load("caribou_nominal"), method="paper")
    return with_assessment(found, runs, runs)


def with_assessment_result(model: IdentifiedModel, fit: bool) -> IdentifiedModel:
    reasons = (
        () if fit else ("yaw: b1, 1 sd 25 %, at most 20 %", "pitch: runs held out 0, at least 1")
    )
    return msgspec.structs.replace(model, assessment=ModelAssessment(fit, reasons, (), None))


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            VehicleFileError("bench: the mass matrix has an eigenvalue -0.007"),
            "edge of the possible vehicles",
        ),
        (np.linalg.LinAlgError("Singular matrix"), "undetermined"),
    ],
)
def test_refit_failure_is_one_line(
    error: Exception, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def identify(*asked: object) -> None:
        raise error

    monkeypatch.setattr(usable_runs, "select", lambda *asked: ([], []))
    monkeypatch.setattr(fitting, "_identify", identify)
    with pytest.raises(
        OperationError, match=f"prior caribou_nominal: .*{said}.*own file as the prior"
    ):
        refit.refit(fitting.RefitRequest(paths=[]))


def test_refit_failed_model_is_written_with_force_only(
    told: IdentifiedModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --force the file is written and records the failure; a refusal of data stays."""
    failed = msgspec.structs.replace(
        told, convergence=msgspec.structs.replace(told.convergence, failures=("Y_v at a bound",))
    )
    monkeypatch.setattr(fitting, "refit", lambda *asked: failed)
    out = tmp_path / "model.json"
    arguments = ["refit", "a.mcap", "--out", str(out)]
    with pytest.raises(OperationError, match=r"the fit failed: Y_v at a bound; .*--force"):
        CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert not out.exists()
    CliRunner().invoke(app, [*arguments, "--force"], catch_exceptions=False)
    assert models.read(out).convergence.failures == ("Y_v at a bound",)
    monkeypatch.undo()
    with pytest.raises(InputError, match=r"absent\.mcap: No such file"):
        CliRunner().invoke(app, ["refit", "absent.mcap", "--force"], catch_exceptions=False)


def test_format_text_holds_numbers_checks_assessment(told: IdentifiedModel) -> None:
    words = identification.format_text(told, Path("model.json"))
    assert "b1_per_s2" in words
    assert "not fit for redesign" in words
    assert "pitch: runs fitted 0, at least 1" in words
    assert (
        "pitch by itself: no elevator test was fitted: the pitch numbers are the prior's" in words
    )
    assert "yaw by itself: not fit" in words
    assert max(len(line) for line in words.splitlines()) <= 160


def test_summarise_model_is_finite_json(told: IdentifiedModel) -> None:
    plain = msgspec.to_builtins(identification.summarise_model(told))
    json.dumps(plain, allow_nan=False)
    assert plain["assessment"]["fit_for_redesign"] is False
    assert plain["assessment"]["reasons"]
    assert set(plain["held_out_rate_error"]["yaw"]) == {
        "initial_model_deg2ps2",
        "refitted_model_deg2ps2",
        "opening_initial_model_deg2ps2",
        "opening_refitted_model_deg2ps2",
    }


def test_redesign_unfit_model_refused_with_reason(told: IdentifiedModel, tmp_path: Path) -> None:
    models.write(with_assessment_result(told, fit=False), tmp_path / "model.json")
    with pytest.raises(
        OperationError, match=r"not fit for redesign: yaw: b1, 1 sd 25 %.* \(and 1 more\).*--force"
    ):
        CliRunner().invoke(app, ["redesign", str(tmp_path / "model.json")], catch_exceptions=False)


def test_redesign_model_without_assessment_refused(told: IdentifiedModel) -> None:
    with pytest.raises(OperationError, match="it has no assessment"):
        refit.redesign(msgspec.structs.replace(told, assessment=None))


@pytest.mark.parametrize(("fit", "force"), [(True, False), (False, True)])
def test_redesign_fit_or_forced_model_accepted(
    fit: bool, force: bool, told: IdentifiedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sysid.design import pid

    asked: list[IdentifiedModel] = []
    monkeypatch.setattr(pid, "redesign", lambda model, *rest, **named: asked.append(model))
    candidate = with_assessment_result(told, fit)
    refit.redesign(candidate, force=force)
    assert asked == [candidate]
