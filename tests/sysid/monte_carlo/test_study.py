"""Study of gains: the same vehicles and disturbances for all sets, failures by name."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from sysid.models import model_file as models
from sysid.monte_carlo import samples
from sysid.monte_carlo.samples import NoCovarianceError
from sysid.monte_carlo.simulate import Sea
from sysid.monte_carlo.study import GainsError, StudyRequest, simulate_samples
from sysid.test_design.prior import DesignPrior
from tests.sysid.monte_carlo.conftest import HELD, UNSTABLE, mission
from tests.sysid.monte_carlo.files import model_of

ITEMS = mission(2.0, 10.0, 44.0)


def test_study_unstable_gains_are_reported(uncertain: DesignPrior) -> None:
    held, unstable = simulate_samples(
        uncertain, StudyRequest(ITEMS, {"held": HELD, "unstable": UNSTABLE}, vehicles=2)
    )
    assert (held.gains, held.failed, held.diverged) == ("held", 0, {})
    assert (unstable.gains, unstable.failed, unstable.diverged) == ("unstable", 2, {"heading": 2})


def test_study_seed_determines_result(known: DesignPrior) -> None:
    request = StudyRequest(
        mission(2.0, 10.0, 12.0), {"held": HELD}, (Sea(current_mps=0.3),), vehicles=1
    )
    first, again, other = (
        simulate_samples(known, request._replace(seed=seed)) for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


def test_study_sets_share_vehicles_and_disturbance(uncertain: DesignPrior) -> None:
    one, other = simulate_samples(
        uncertain, StudyRequest(mission(2.0, 10.0, 12.0), {"one": HELD, "other": HELD}, vehicles=2)
    )
    assert one._replace(gains="") == other._replace(gains="")


def test_study_gains_without_trims_use_model_trims(known: DesignPrior) -> None:
    trims = samples.trims_deg(known.vehicle(known.mean))
    assert trims["TRIM_RUD_DEG"] == pytest.approx(6.0)
    sets = {"without": HELD, "with": {**HELD, **trims}, "none": {**HELD, "TRIM_RUD_DEG": 0.0}}
    without, with_them, none = simulate_samples(
        known, StudyRequest(mission(2.0, 10.0, 12.0), sets, vehicles=1)
    )
    assert without._replace(gains="") == with_them._replace(gains="")
    assert without._replace(gains="") != none._replace(gains="")


def test_draw_spread_equals_posterior(uncertain: DesignPrior) -> None:
    drawn = np.array(samples.draw(uncertain, 200, seed=1))
    assert np.cov(drawn.T) == pytest.approx(uncertain.covariance, abs=0.02)


def test_study_progress_ends_at_one(known: DesignPrior) -> None:
    received: list[float] = []
    simulate_samples(
        known, StudyRequest(mission(2.0, 10.0, 5.0), {"held": HELD}, vehicles=2), received.append
    )
    assert received == [0.5, 1.0]


def test_kept_dives_give_the_same_summary(known: DesignPrior, tmp_path: Path) -> None:
    request = StudyRequest(mission(2.0, 10.0, 5.0), {"held": HELD}, vehicles=2)
    keep = tmp_path / "dives.jsonl"
    first = simulate_samples(known, request._replace(keep=keep))
    assert keep.read_bytes().count(b"\n") == 1 + 2
    again = simulate_samples(known, request._replace(keep=keep))
    assert keep.read_bytes().count(b"\n") == 1 + 2, "no dive was simulated again"
    assert repr(first) == repr(again) == repr(simulate_samples(known, request))


def test_study_invalid_gain_raises_with_name(known: DesignPrior) -> None:
    with pytest.raises(GainsError, match=r"new\.param: HDG_P = 9: must be 0 to 5"):
        simulate_samples(known, StudyRequest(ITEMS, {"new.param": {"HDG_P": 9.0}}))


def test_read_model_gives_posterior_of_file(uncertain: DesignPrior, tmp_path: Path) -> None:
    models.write(model_of(uncertain), tmp_path / "model.json")
    read = samples.read(tmp_path / "model.json")
    assert np.array_equal(read.covariance, uncertain.covariance)
    assert read.biases_rad == pytest.approx(uncertain.biases_rad)


def test_read_model_without_covariance_raises(known: DesignPrior, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    models.write(model_of(known), path)
    with pytest.raises(NoCovarianceError, match=r"model\.json: .*joint\.covariance"):
        samples.read(path)


def test_read_model_of_unshipped_vehicle_uses_the_file_in_it(
    uncertain: DesignPrior, tmp_path: Path
) -> None:
    path, model = tmp_path / "model.json", model_of(uncertain)
    vehicle = msgspec.structs.replace(model.vehicle, prior="mine.toml")
    models.write(msgspec.structs.replace(model, vehicle=vehicle), path)
    assert samples.read(path).config == uncertain.config
