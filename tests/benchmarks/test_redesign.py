"""The study of redesigned gains: figures from synthetic rows and dives, and one short dive."""

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.control import core
from benchmarks.redesign import (
    campaign,
    faults,
    holding,
    missions,
    probability,
    robust,
    steady,
)
from benchmarks.redesign.campaign import GAIN_SETS, OURS
from benchmarks.redesign.holding import TrackingError
from benchmarks.study import Figure
from sitl.vehicle import config
from sysid.data import segments
from sysid.reproduction.paper_tables import TABLE_3_IMPROVED
from tests.helpers.closed_loop import Dive
from tests.helpers.missions import excitation_item
from tests.test_closed_loop import TRIM, legs

GOOD, BAD = TrackingError(1.0, 6.0, 1.0, 0.0), TrackingError(1.5, 20.0, 1.0, 0.0)
LOST = TrackingError(90.0, 500.0, 9.0, 1.0)


def row(initial: TrackingError, paper: TrackingError, ours: TrackingError) -> list[float]:
    return [*initial, *paper, *ours]


def missed(figures: list[Figure]) -> set[str]:
    return {figure.name for figure in figures if not figure.met}


class SyntheticDive(Dive):
    """Columns by name, and the final state; nothing is simulated."""

    def __init__(self, columns: dict[str, NDArray[np.float64]]) -> None:
        self.columns = columns
        self.surfacing_s = 150.0
        self.state = core.initial_state()

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        return self.columns[column]


def synthetic_dive(**columns: float) -> SyntheticDive:
    t = np.arange(0.0, 200.0, 0.1)
    level = {
        "true_pitch": 0.0,
        "true_heading": np.radians(20.0),
        "true_depth_m": 3.0,
        "surface_m": 0.0,
    }
    constant = {name: np.full(t.size, value) for name, value in {**level, **columns}.items()}
    return SyntheticDive({"t_s": t, **constant})


def test_tracking_error_wraps_heading_and_detects_loss() -> None:
    assert holding.tracking_error(synthetic_dive()) == TrackingError(0.0, 0.0, 0.0, 0.0)
    beyond = synthetic_dive(true_heading=np.radians(20.0 - 360.0 + 2.0), true_depth_m=2.9)
    assert holding.tracking_error(beyond) == pytest.approx(TrackingError(2.0, 10.0, 0.0, 0.0))
    assert holding.tracking_error(synthetic_dive(true_depth_m=0.3)).lost == 1.0
    surfaced = synthetic_dive()
    surfaced.state = surfaced.state._replace(failsafe="Leak detected")
    assert holding.tracking_error(surfaced).lost == 1.0


def test_only_redesigned_gains_have_targets() -> None:
    held = TrackingError(0.7, 4.0, 0.4, 0.0)
    rows = np.array([row(BAD, BAD, held), row(BAD, BAD, held)])
    assert not missed(steady.judge("disturbed", rows))
    assert missed(steady.judge("calm", rows)) == {
        *(f"{what}, 95 %: ours" for what in holding.WHAT),
        "heading, 95 %: ours, worst dive",
    }
    worse = np.array([row(held, held, BAD), row(held, held, held)])
    assert missed(steady.judge("disturbed", worse)) == {"heading, 95 %: ours", "depth, 95 %: ours"}
    assert not missed(steady.judge("rough", worse))


def test_rough_sea_has_twice_the_disturbed_moments() -> None:
    rough, disturbed = steady.sea("rough").disturbance, steady.sea("disturbed").disturbance
    assert rough.slow.yaw_rms_nm == 2.0 * disturbed.slow.yaw_rms_nm
    assert rough.waves.pitch_rms_nm == 2.0 * disturbed.waves.pitch_rms_nm
    assert rough.waves.frequency_hz == disturbed.waves.frequency_hz


def test_one_vehicle_beyond_twice_the_targets_is_a_miss() -> None:
    held = np.array([[0.0, *GOOD], [1.0, *GOOD], [2.0, *BAD._replace(heading_deg=2.3)]])
    figures = robust.judge("caribou_truth", held)
    assert figures[0].value == 3.0
    assert missed(figures) == {
        "heading, 95 %: ours, worst dive",
        "depth, 95 %: ours, worst dive",
        "outside twice the targets",
    }
    assert not missed(robust.judge("caribou_truth", held[:2]))
    assert "lost: ours" in missed(robust.judge("caribou_truth", np.array([[0.0, *LOST]])))


def test_drawn_vehicle_coefficients_differ_up_to_20_percent() -> None:
    drawn, first = robust.draw("caribou_truth", 7).vehicle, config.load("caribou_truth")
    ratios = [
        getattr(drawn.linear, name) / getattr(first.linear, name)
        for name in first.linear.__struct_fields__
    ]
    assert all(0.8 <= ratio <= 1.2 for ratio in ratios)
    assert len(set(ratios)) == len(ratios)
    assert robust.draw("caribou_truth", 7) == robust.draw("caribou_truth", 7)
    assert drawn.tailcone.rudder_bias_deg == -6.0


def test_unsettled_leg_and_emerged_hull_are_misses() -> None:
    settled, late = [1.0, 10.0, 1.0, 13.9, 0.4], [1.0, 10.0, 1.0, 14.1, -0.1]
    figures = missions.judge(
        "combined/disturbed", np.array([late + late + settled, late + late + settled])
    )
    assert not missed(figures)
    shares = {
        figure.name: figure.value for figure in figures if figure.name.startswith("every leg")
    }
    assert [shares[f"every leg settled: {name}"] for name in GAIN_SETS] == [0.0, 0.0, 100.0]
    figures = missions.judge("combined/disturbed", np.array([settled + settled + late]))
    assert missed(figures) == {
        "leg 2, depth, 95 %: ours",
        "every leg settled: ours",
        "least water above hull: ours",
    }


def test_water_above_counts_from_highest_part_to_surface() -> None:
    """Level: half the diameter above the axis; nose up: half the length; a trough is subtracted."""
    level = missions.water_above_m(synthetic_dive(true_depth_m=2.0))
    assert level == pytest.approx(2.0 - 0.5334 / 2, abs=0.01)
    assert missions.water_above_m(
        synthetic_dive(true_depth_m=2.0, surface_m=-0.3)
    ) == pytest.approx(level - 0.3)
    upright = missions.water_above_m(synthetic_dive(true_depth_m=2.5, true_pitch=np.radians(90.0)))
    assert upright == pytest.approx(2.5 - 3.543 / 2, abs=0.01)


def test_overestimated_probability_is_a_miss() -> None:
    kept, broken = [1.0, 1.0, 0.9, 1.0, 0.99, 1.0, *GOOD], [1.0, 1.0, 0.9, 0.0, 0.99, 1.0, *GOOD]
    refused = [0.0, 0.0, *[np.nan] * (4 + len(TrackingError._fields))]
    assert not missed(probability.judge("caribou_truth", np.array([kept, kept, kept, refused])))
    assert missed(
        probability.judge("caribou_truth", np.array([kept, broken, broken, refused]))
    ) == {
        "full specification kept by the vehicle that flew",
        "full specification, kept less stated",
    }


def test_lost_dive_is_a_miss_for_redesigned_gains_only() -> None:
    assert not missed(faults.judge("gyro off", np.array([row(LOST, LOST, BAD)])))
    assert missed(faults.judge("gyro off", np.array([row(GOOD, GOOD, LOST)]))) == {"lost: ours"}


@pytest.mark.parametrize("fault", faults.FAULTS)
def test_every_fault_is_in_the_catalogue(fault: str) -> None:
    (read,) = faults.sea(fault).faults
    assert read.name == fault


def test_short_dive_is_tracked_and_its_segment_is_cut() -> None:
    values = {**TABLE_3_IMPROVED, **TRIM}
    items = (*legs((3.0, 20.0, 90.0)), excitation_item(4, axis=12, magnitude_deg=5.0, duration_s=8))
    dive = Dive(items, values=values)
    (run,) = segments.cut_runs(campaign.log(dive, "short", values))
    assert (run.plane, run.wave, run.magnitude_deg) == ("yaw", "step", 5.0)
    assert np.degrees(run.command_rad[~run.preroll][10:-10]) == pytest.approx(11.0, abs=0.01)
    dive.surfacing_s = 90.0
    assert holding.tracking_error(dive, 70.0).heading_deg < 1.0


def test_gain_sets_have_the_same_trims() -> None:
    sets = campaign.gain_sets(TRIM, {"HDG_P": 0.9})
    assert tuple(sets) == GAIN_SETS
    assert all(values["TRIM_RUD_DEG"] == TRIM["TRIM_RUD_DEG"] for values in sets.values())
    assert sets[OURS]["HDG_P"] == 0.9
