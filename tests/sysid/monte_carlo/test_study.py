"""Sets of gains side by side: the same vehicles and seas, the same bytes, and who fails is found
and named."""

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


def test_unstable_gains_are_found_and_named(believed: DesignPrior) -> None:
    held, unstable = simulate_samples(
        believed, StudyRequest(ITEMS, {"held": HELD, "unstable": UNSTABLE}, vehicles=2)
    )
    assert (held.gains, held.failed, held.diverged) == ("held", 0, {})
    assert (unstable.gains, unstable.failed, unstable.diverged) == ("unstable", 2, {"heading": 2})


def test_the_same_seed_gives_the_same_and_another_seed_another(known: DesignPrior) -> None:
    request = StudyRequest(
        mission(2.0, 10.0, 12.0), {"held": HELD}, (Sea(current_mps=0.3),), vehicles=1
    )
    first, again, other = (
        simulate_samples(known, request._replace(seed=seed)) for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


def test_every_set_meets_the_same_vehicles_and_seas(believed: DesignPrior) -> None:
    one, other = simulate_samples(
        believed, StudyRequest(mission(2.0, 10.0, 12.0), {"one": HELD, "other": HELD}, vehicles=2)
    )
    assert one._replace(gains="") == other._replace(gains="")


def test_gains_without_trims_fly_with_those_of_the_model(known: DesignPrior) -> None:
    trims = samples.trims_deg(known.vehicle(known.mean))
    assert trims["TRIM_RUD_DEG"] == pytest.approx(6.0)
    sets = {"without": HELD, "with": {**HELD, **trims}, "none": {**HELD, "TRIM_RUD_DEG": 0.0}}
    without, with_them, none = simulate_samples(
        known, StudyRequest(mission(2.0, 10.0, 12.0), sets, vehicles=1)
    )
    assert without._replace(gains="") == with_them._replace(gains="")
    assert without._replace(gains="") != none._replace(gains="")


def test_vehicles_differ_as_much_as_the_model_doubts(believed: DesignPrior) -> None:
    drawn = np.array(samples.draw(believed, 200, seed=1))
    assert np.cov(drawn.T) == pytest.approx(believed.covariance, abs=0.02)


def test_progress_ends_at_the_whole(known: DesignPrior) -> None:
    heard: list[tuple[float, float]] = []
    (told,) = simulate_samples(
        known,
        StudyRequest(mission(2.0, 10.0, 5.0), {"held": HELD}, vehicles=2),
        lambda *at: heard.append(at),
    )
    assert [share for share, _ in heard] == [0.5, 1.0]
    assert heard[-1][1] == told.vehicle_s


def test_gains_that_no_autopilot_takes_are_refused_by_name(known: DesignPrior) -> None:
    with pytest.raises(GainsError, match=r"new\.param: HDG_P = 9: must be 0 to 5"):
        simulate_samples(known, StudyRequest(ITEMS, {"new.param": {"HDG_P": 9.0}}))


def test_a_model_believes_what_its_file_says(believed: DesignPrior, tmp_path: Path) -> None:
    models.write(model_of(believed), tmp_path / "model.json")
    read = samples.read(tmp_path / "model.json")
    assert np.array_equal(read.covariance, believed.covariance)
    assert read.biases_rad == pytest.approx(believed.biases_rad)


def test_a_model_without_covariance_is_refused(known: DesignPrior, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    models.write(model_of(known), path)
    with pytest.raises(NoCovarianceError, match=r"model\.json: .*joint\.covariance"):
        samples.read(path)


def test_a_model_of_a_file_that_is_not_shipped_asks_for_it(
    believed: DesignPrior, tmp_path: Path
) -> None:
    path, model = tmp_path / "model.json", model_of(believed)
    models.write(
        msgspec.structs.replace(
            model, vehicle=msgspec.structs.replace(model.vehicle, prior="mine")
        ),
        path,
    )
    with pytest.raises(NoCovarianceError, match=r"vehicle\.prior = 'mine'.*--prior"):
        samples.read(path)
    assert samples.read(path, believed.config).name == "model.json"
