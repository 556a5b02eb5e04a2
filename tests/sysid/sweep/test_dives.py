"""Dives of a sweep: numbering, inputs, rows and keys."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autopilot.control import lqg_file
from autopilot.control.lqg import LqgControllers
from sysid.control_analysis.loop_transfer import SAMPLING_S, Lag
from sysid.design.design_model import DEFAULT_DISTURBANCE
from sysid.design.lqg import synthesis, tick_controllers, weights
from sysid.models import noise
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.monte_carlo import metrics, samples, simulate
from sysid.monte_carlo.metrics import DiveMetrics, Leg, Steady
from sysid.monte_carlo.simulate import MissionRejectedError, Sea
from sysid.reproduction.paper_tables import CRUISE_SPEED_MPS, TABLE_1_ADJUSTED
from sysid.sweep import dives, gains
from sysid.sweep.campaigns import SweepMission
from sysid.sweep.dives import (
    COLUMNS,
    Conditions,
    DiveLimits,
    OtherSourcesError,
    Part,
    fly_chunk,
    rows_of,
)
from sysid.sweep.parts import PartStore, digest
from sysid.sweep.points import ParameterRange
from sysid.sweep.sweep_request import Chunks
from sysid.trials import map_trials
from tests.helpers.missions import leg
from tests.sysid.monte_carlo.conftest import HELD, LAND
from tests.sysid.sweep.conftest import SHORT, Sweep

HELD_DIVE = DiveMetrics(
    steady=Steady(1.0, 2.0, 0.1),
    legs=(Leg(10.0, 2.0, 20.0), Leg(20.0, 2.0, 30.0)),
    rudder_deg=10.0,
    elevator_deg=5.0,
    stopped=0.0,
    shallowest_m=1.0,
    broached=False,
    diverged="",
    failsafe="",
    seconds=100.0,
)


def test_numbers_of_dives_stay_when_samples_are_added(request_of: Sweep) -> None:
    sea = {"disturbance_scale": (1.0, 2.0), "current_mps": ParameterRange(0.0, 0.4)}
    few, many = (Chunks(request_of(conditions=sea, samples=n, repeats=2)) for n in (3, 7))
    assert (few.dives, many.dives, few.combinations) == (24, 56, 4)
    for ours, theirs in zip(few, many, strict=False):
        for one, other in zip(ours.dives, theirs.dives, strict=True):
            assert one._replace(z=0.0) == other._replace(z=0.0)  # type: ignore[arg-type]
            assert np.array_equal(one.z, other.z)


def test_combinations_are_flown_with_same_samples_and_noise(request_of: Sweep) -> None:
    chunks = Chunks(request_of(conditions={"current_mps": ParameterRange(0.0, 0.4)}, samples=3))
    flown = [dive for chunk in chunks for dive in chunk.dives]
    assert [(d.sample, d.gains.name) for d in flown] == [
        (n, name) for n in range(3) for name in ("held", "wild")
    ]
    for held, wild in zip(flown[::2], flown[1::2], strict=True):
        assert np.array_equal(held.z, wild.z)
        assert held.conditions == wild.conditions
        assert 0.0 <= held.conditions.current_mps <= 0.4
    assert len({dive.conditions for dive in flown}) == 3


def test_spread_zero_flies_mean_vehicle(request_of: Sweep) -> None:
    (vehicle,) = request_of().vehicles
    (chunk,) = Chunks(request_of(vehicles=(vehicle._replace(spread=0.0),), samples=1))
    assert np.array_equal(chunk.dives[0].z, vehicle.prior.mean)


@pytest.mark.slow
def test_row_holds_inputs_metrics_and_command(request_of: Sweep) -> None:
    request = request_of(conditions={"disturbance_scale": (1.5,), "rudder_bias_deg": (2.0,)})
    held, wild = rows_of(fly_chunk(Chunks(request)[1]).text)
    assert tuple(held) == COLUMNS
    assert (held["dive"], held["gains"], held["sample"], held["passed"]) == ("2", "held", "1", "1")
    assert (wild["diverged"], wild["passed"]) == ("heading", "0")
    assert held["command"] == "ground sweep plan.toml --dive 2"
    dive = Chunks(request)[1].dives[0]
    flown = simulate.fly(
        dive.prior.vehicle(dive.z),
        dive.prior.noise,
        SHORT,
        dive.gains.config,
        Sea(times=1.5, bias_shift_rad=np.radians(2.0)),
        (1, 1, 0),
    )
    hull = dive.prior.vehicle(dive.z).model.hydrostatics.radius_m
    expected = metrics.of_dive(flown, dive.gains.config.travel_rad, hull)
    assert expected.steady is not None
    assert float(held["heading_deg"]) == expected.steady.heading_deg
    assert float(held["seconds"]) == expected.seconds
    assert held["z_N_dr"] == f"{dive.z[5]:.4f}"
    (alone,) = rows_of(fly_chunk(Chunks(request).of_dives([2])).text)
    assert alone == held, "one dive alone gives the same row"


def test_each_condition_changes_the_vehicle_or_the_sea(request_of: Sweep) -> None:
    (chunk,) = Chunks(request_of(samples=1))
    vehicle = chunk.dives[0].prior.vehicle(chunk.dives[0].z)
    changed = dives._with_faults(
        vehicle,
        Conditions(elevator_bias_deg=2.0, actuator_rate_scale=0.5, actuator_delay_s=0.2),
    )
    for plane, actuator in vehicle.actuators.items():
        faulty = changed.actuators[plane]
        assert faulty.rate_radps == 0.5 * actuator.rate_radps
        assert faulty.delay_s == pytest.approx(actuator.delay_s + 0.2)
    (shift_yaw, shift_pitch) = (
        changed.actuators[plane].bias_rad - vehicle.actuators[plane].bias_rad
        for plane in vehicle.actuators
    )
    assert shift_yaw == 0.0
    assert shift_pitch == pytest.approx(np.radians(2.0))


@pytest.mark.slow
def test_digest_does_not_depend_on_size_of_chunks(tmp_path: Path, request_of: Sweep) -> None:
    digests = set()
    for chunk in (1, 3):
        folder = tmp_path / str(chunk)
        chunks = Chunks(request_of(samples=2, chunk=chunk))
        map_trials(fly_chunk, chunks, Part, keep=PartStore(folder))
        digests.add(digest(folder))
    assert len(digests) == 1


def test_other_sources_are_refused(request_of: Sweep) -> None:
    chunk = Chunks(request_of())[0]._replace(source="other")
    with pytest.raises(OtherSourcesError, match="other source code"):
        fly_chunk(chunk)


def test_rejected_mission_names_mission_and_gains(request_of: Sweep) -> None:
    deep = SweepMission("deep", (*leg(depth_m=5000.0, heading_deg=0.0, duration_s=9.0), LAND))
    with pytest.raises(MissionRejectedError, match="deep, held: "):
        fly_chunk(Chunks(request_of(missions=(deep,)))[0])


def test_impossible_vehicle_is_drawn_again(request_of: Sweep) -> None:
    dive = Chunks(request_of())[0].dives[0]
    impossible = dive._replace(z=np.full_like(dive.z, -30.0))
    _, z, redraws = dives._possible_vehicle(impossible)
    assert redraws > 0
    assert np.max(np.abs(z)) < 5.0
    assert np.array_equal(z, dives._possible_vehicle(impossible)[1]), "the same at each call"


@pytest.mark.parametrize(
    ("change", "limits", "passes"),
    [
        ({}, DiveLimits(), True),
        ({"diverged": "depth"}, DiveLimits(), False),
        ({"failsafe": "leak"}, DiveLimits(), False),
        ({"broached": True}, DiveLimits(), False),
        ({}, DiveLimits(heading_deg=1.0, pitch_deg=2.0, depth_m=0.1, settling_s=30.0), True),
        ({}, DiveLimits(depth_m=0.09), False),
        ({}, DiveLimits(settling_s=29.0), False),
        ({"legs": (Leg(10.0, 2.0, None),)}, DiveLimits(settling_s=60.0), False),
        ({"steady": None}, DiveLimits(), True),
        ({"steady": None}, DiveLimits(pitch_deg=60.0), False),
    ],
)
def test_passes_held_to_end_and_within_limits(
    change: dict[str, Any], limits: DiveLimits, passes: bool
) -> None:
    assert dives._passes(HELD_DIVE._replace(**change), limits) is passes


@pytest.mark.slow
def test_lqg_controllers_fly_instead_of_pid(tmp_path: Path, request_of: Sweep) -> None:
    lag, sea = Lag(0.3 + SAMPLING_S), noise.from_model(DEFAULT_DISTURBANCE)
    yaw, pitch = yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED)
    heading = synthesis.controller(yaw, lag, sea, weights.HEADING_STARTS[0])
    depth = synthesis.controller(pitch, lag, sea, weights.DEPTH_STARTS[0])
    controllers = LqgControllers(
        speed_mps=CRUISE_SPEED_MPS,
        heading=tick_controllers(heading, yaw),
        depth=tick_controllers(depth, pitch),
        pitch_per_metre=synthesis.pitch_per_metre(depth),
    )
    path = tmp_path / "controller.json"
    path.write_text(lqg_file.to_json(controllers, "0" * 64), encoding="utf-8")
    (vehicle,) = request_of().vehicles
    trims = samples.trims_deg(vehicle.prior.vehicle(vehicle.prior.mean))
    sets = (gains.read("pid", HELD, trims), gains.read("lqg", HELD, trims, path))
    request = request_of(vehicles=(vehicle._replace(gains=sets),), samples=1)
    pid, lqg = rows_of(fly_chunk(Chunks(request)[0]).text)
    assert (pid["passed"], lqg["passed"]) == ("1", "1")
    assert pid["heading_deg"] != lqg["heading_deg"]
    assert pid["key"] != lqg["key"]
