"""Search of gains that suit sampled vehicles: an uncertain drive, and single sampled vehicles."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains
from sysid.design import constraints, design_model
from sysid.design.design_model import DesignModel
from sysid.design.pid import heading, plane_search
from sysid.design.pid.plane_search import PlaneSearch, Samples, _Candidate
from sysid.design.specification import Spec
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES
from sysid.reproduction.paper_tables import TABLE_3_INITIAL

LEAD = {"ACT_LAG_W": 3.0, "ACT_LAG_Z": 0.6, "ACT_LEAD_W": 6.0, "ACT_LEAD_Z": 0.4}


@pytest.fixture(scope="module")
def vehicle(model: IdentifiedModel) -> DesignModel:
    return design_model.from_model(model)


@pytest.fixture(scope="module")
def samples(model: IdentifiedModel) -> Samples:
    return Samples(
        vehicles=list(design_model.sample_models(model, 240)),
        unmeasured_drive=[
            design_model.drive_forms(sample)
            for sample in design_model.sample_models(model, 240, drive_known=False)
        ],
    )


def search(vehicle: DesignModel, samples: Samples, spec: Spec) -> PlaneSearch:
    return PlaneSearch(heading, vehicle, samples, spec, {**TABLE_3_INITIAL, **LEAD})


def test_unmeasured_drive_widens_the_drive_most(model: IdentifiedModel) -> None:
    known = np.sqrt(np.diag(np.array(model.joint.covariance)))
    ratio = np.sqrt(np.diag(design_model.uncertain_drive_covariance(model))) / known
    drive = [NAMES.index(name) for name in design_model.DRIVE]
    assert np.all(ratio >= 1.0 - 1e-9)
    assert np.all(ratio[drive] > 1.2)
    assert np.max(np.delete(ratio, drive)) < np.min(ratio[drive])


def test_unmeasured_drive_response_scatters_above_the_tested_frequencies(
    model: IdentifiedModel,
) -> None:
    """Standard deviation of the gain from rudder to yaw rate, dB, at 1 and at 6 rad/s.

    The tests reach 2.5 rad/s. 500 vehicles: 60 of other draws gave 1.20 and 1.26 in place of 1.24.
    """
    scatter = {}
    for drive_known in (True, False):
        vehicles = design_model.sample_models(model, 500, drive_known=drive_known)
        gains = np.abs([sample.yaw.command[:, 1] for sample in vehicles])
        at = [int(np.searchsorted(GRID_RADPS, omega)) for omega in (1.0, 6.0)]
        scatter[drive_known] = np.std(20.0 * np.log10(gains[:, at]), axis=0)
    assert scatter[False][0] < 1.1 * scatter[True][0]
    assert scatter[False][1] > 1.2 * scatter[True][1]


def with_damping(vehicle: DesignModel, damping_ratio: float) -> DesignModel:
    lag = vehicle.yaw_lag._replace(damping_ratio=damping_ratio)
    return design_model.build(vehicle.planes, lag, lag, vehicle.disturbance)


def low_gain_margin_db(task: PlaneSearch, gains: Gains) -> float:
    """Return the lower end of the 95 % interval of the smallest gain margin."""
    margins_db = [
        min(task.gain_margin_db(form, gains) for form in forms)
        for forms in task.samples.unmeasured_drive
    ]
    return float(np.quantile(margins_db, 0.025))


@pytest.mark.parametrize("damping_ratio", [0.8, 0.9, 0.99])
def test_first_order_drive_differs_above_the_tested_frequencies_only(
    vehicle: DesignModel, damping_ratio: float
) -> None:
    """Compared with 1 / (1 + s / a) behind a delay, a from the curvature of the gain."""
    second_order, first_order = design_model.drive_forms(with_damping(vehicle, damping_ratio))
    ratio = first_order.yaw.command[:, 1] / second_order.yaw.command[:, 1]
    omega_radps = vehicle.yaw_lag.natural_frequency_radps
    x = GRID_RADPS / omega_radps
    tested = x < 0.5
    assert np.max(np.abs(20.0 * np.log10(np.abs(ratio[tested])))) < 0.3
    assert np.max(np.abs(np.degrees(np.angle(ratio[tested])))) < 2.0

    pole = omega_radps / math.sqrt(4.0 * damping_ratio**2 - 2.0)
    lag_gain = 1.0 / np.abs(1.0 - x**2 + 2.0j * damping_ratio * x)
    expected = 1.0 / (np.abs(1.0 + 1j * GRID_RADPS / pole) * lag_gain)
    below = x < 2.0
    assert np.abs(ratio[below]) == pytest.approx(expected[below], rel=0.02)
    assert np.abs(ratio[below])[-1] > 1.4


def test_weakly_damped_drive_has_no_first_order_form(vehicle: DesignModel) -> None:
    assert len(design_model.drive_forms(with_damping(vehicle, 0.79))) == 1


def test_first_order_form_counts_in_the_gain_margin(vehicle: DesignModel) -> None:
    damped = with_damping(vehicle, 0.9)
    gains = search(vehicle, Samples((), ()), Spec()).find(
        constraints.nominal(Spec()), heading.STARTS
    )
    second_order, first_order = design_model.drive_forms(damped)
    tasks = [
        search(damped, Samples((), [forms]), Spec())
        for forms in ((second_order,), (second_order, first_order))
    ]
    margins_db = [low_gain_margin_db(task, gains) for task in tasks]
    assert margins_db[1] < margins_db[0] - 1.0
    between = Spec(robust_gm_db=0.5 * sum(margins_db))
    assert tasks[0]._replace(spec=between).vehicle_of_low_margin(gains) is None
    assert tasks[1]._replace(spec=between).vehicle_of_low_margin(gains) is first_order


def test_robust_gains_have_the_gain_margin_on_nearly_all_vehicles(
    vehicle: DesignModel, samples: Samples
) -> None:
    """A required margin of 9.5 dB, 1.5 dB more than the specification asks of the nominal model.

    Two vehicles that are added to the search leave a tenth of a decibel.
    """
    strict = search(vehicle, samples, Spec(robust_gm_db=9.5))
    first = strict.find(constraints.nominal(strict.spec), heading.STARTS)
    assert low_gain_margin_db(strict, first) < 9.2
    robust = plane_search.robust_gains(strict, heading.STARTS)
    assert low_gain_margin_db(strict, robust) > 9.4
    assert strict.gain_margin_db(vehicle, robust) > strict.gain_margin_db(vehicle, first)


def test_gain_margin_is_not_increased_if_too_few_vehicles_then_meet_their_limits(
    vehicle: DesignModel, samples: Samples
) -> None:
    strict = search(vehicle, samples, Spec(robust_gm_db=9.5))
    unreachable = search(vehicle, samples, replace(strict.spec, robust_fraction=1.01))
    bounds = constraints.nominal(strict.spec)
    gains = strict.find(bounds, heading.STARTS)
    first = _Candidate(gains, bounds, strict.worst_violations(gains))
    increased = plane_search._with_gain_margin(strict, first, heading.STARTS).gains
    assert strict.gain_margin_db(vehicle, increased) > (strict.gain_margin_db(vehicle, gains) + 0.3)
    assert plane_search._with_gain_margin(unreachable, first, heading.STARTS) is first


def test_search_with_sampled_vehicles_meets_their_limits(
    vehicle: DesignModel, samples: Samples
) -> None:
    """The vehicles are as many as in a redesign, and are added in pairs."""
    spec = Spec(damping=0.65)
    task = search(vehicle, samples, spec)
    gains = task.find(constraints.nominal(spec), heading.STARTS)
    before = task.worst_violations(gains)
    first = _Candidate(gains, constraints.nominal(spec), before)
    found = plane_search._with_samples(task, first, heading.STARTS)
    assert np.all(before[first.hard] > 0.01)
    assert np.all(found.worst[first.hard] < 0.005)
    assert len(found.sampled) in range(2, 2 * plane_search.ADDITIONS + 1, 2)
    assert np.mean(found.worst < 0.005) > np.mean(before < 0.005) + 0.2


def test_search_continues_after_vehicles_that_lower_the_share(
    monkeypatch: pytest.MonkeyPatch, vehicle: DesignModel, samples: Samples
) -> None:
    shares = iter((0.5, 0.9, 0.8, 0.7))

    def found(_: PlaneSearch, wanted: _Candidate, __: Sequence[Gains]) -> _Candidate:
        return wanted._replace(worst=violations(next(shares)))

    def violations(share: float) -> NDArray[np.float64]:
        return np.where(np.arange(240) < share * 240, 0.0, 1.0)

    monkeypatch.setattr(plane_search, "_find", found)
    task = search(vehicle, samples, Spec())
    first = _Candidate({}, constraints.nominal(task.spec), violations(0.6))
    best = plane_search._with_samples(task, first, ())
    assert (best.fraction, len(best.sampled)) == (0.9, 4)
    assert next(shares, None) is None


def test_gain_margin_without_samples_is_not_changed(vehicle: DesignModel) -> None:
    alone = search(vehicle, Samples((), ()), Spec())
    first = alone.find(constraints.nominal(alone.spec), heading.STARTS)
    assert alone.vehicle_of_low_margin(first) is None
    assert plane_search.robust_gains(alone, heading.STARTS) == first
