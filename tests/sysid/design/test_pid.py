"""A design meets its own specification when judged by other means, refuses when it cannot, and says
why."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm

from autopilot.control import reference_model
from autopilot.control.reference_model import ActuatorLead, ReferenceState
from sysid.control_analysis import loop_transfer
from sysid.design import constraints, pid
from sysid.design.design_model import (
    DesignModel,
    analyse_loops,
    command_noise_rad,
    from_model,
    predict_response,
    sample_models,
)
from sysid.design.pid import Design, DesignInfeasibleError, Spec, heading, step_response
from sysid.design.robustness import robustness
from sysid.models.model_file import IdentifiedModel, sha256_of_model
from sysid.reproduction.paper_tables import TABLE_3_INITIAL


@pytest.fixture(scope="module")
def designed(model: IdentifiedModel) -> Design:
    return pid.redesign(model)


def test_specification_holds_at_every_cut(model: IdentifiedModel, designed: Design) -> None:
    spec, judged = designed.spec, analyse_loops(from_model(model), designed.gains)
    assert (spec.damping, spec.gm_db, spec.pm_deg, spec.ms) == (0.6, 8.0, 55.0, 1.6)
    for cut in ("rudder", "heading", "elevator", "depth"):
        margins = judged.margins[cut]
        assert margins.gm_db >= spec.gm_db * 0.995, cut
        assert margins.pm_deg >= spec.pm_deg * 0.995, cut
        assert margins.ms <= spec.ms * 1.005, cut


def test_what_the_sea_starts_dies_out_damped(model: IdentifiedModel, designed: Design) -> None:
    """A blow's answer in time, no eigenvalues asked: it swings back once, by less than 0.2, and no
    further."""
    vehicle = from_model(model)
    closed = loop_transfer.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, designed.gains)
    blow, dt = np.zeros(len(closed.A)), 0.02
    blow[1] = 1.0
    step, x, heading = expm(closed.A * dt), blow, []
    for _ in range(3000):
        x = step @ x
        heading.append(x[2])
    turns = np.flatnonzero(np.diff(np.sign(np.diff(heading)))) + 1
    sizes = np.abs(np.array(heading)[turns])
    assert sizes[0] == np.max(np.abs(heading))
    assert np.all(sizes[1:2] < 0.2 * sizes[0])
    assert np.all(sizes[2:] < 0.01 * sizes[0])


def test_redesign_leaves_less_error_than_the_prototype(designed: Design) -> None:
    """With larger margins, which is what undoing the tailcone's lag is for."""
    assert designed.predicted.heading_deg < 0.9 * designed.initial.heading_deg
    assert designed.predicted.depth_m < 0.9 * designed.initial.depth_m
    assert designed.analysis.margins["rudder"].ms < designed.initial_analysis.margins["rudder"].ms
    assert designed.gains["ACT_LEAD_W"] > 1.5 * designed.gains["ACT_LAG_W"]


def test_a_quiet_gyro_lets_more_of_the_lag_be_undone(
    model: IdentifiedModel, designed: Design
) -> None:
    vehicle, spec = from_model(model), Spec(command_noise_deg=0.2)
    first = {**designed.gains, "ACT_LEAD_W": 0.0}
    loud = {**first, **heading.gains(vehicle, first, spec, constraints.nominal(spec))}
    assert loud["ACT_LEAD_W"] < designed.gains["ACT_LEAD_W"]
    assert command_noise_rad(vehicle, "yaw", loud) == pytest.approx(math.radians(0.2), rel=0.02)


def test_its_promise_holds_on_fresh_vehicles(model: IdentifiedModel, designed: Design) -> None:
    """Other draws than those it was designed on."""
    assert designed.trust is not None
    assert designed.trust.relaxed >= designed.trust.specification > 0.5
    fresh = list(sample_models(model, 2 * pid.VEHICLES))[pid.VEHICLES :]
    again = robustness(fresh, designed.gains, designed.spec)
    assert again is not None
    assert abs(again.specification - designed.trust.specification) < 0.15
    assert again.relaxed > 0.9


def test_a_new_heading_leaves_the_travel_alone(model: IdentifiedModel, designed: Design) -> None:
    """Flown by the autopilot's own loops: 20 deg with the rudder that the bias leaves; without a
    way it would not."""
    vehicle, loads = from_model(model), pid.constant_loads(model)
    room = math.radians(15.0) - loads.rudder_rad
    flown = step_response.heading_step(
        vehicle, designed.gains, math.radians(20.0), 30.0, designed.spec
    )
    assert np.max(np.abs(flown.command_rad)) <= room
    assert abs(flown.value[-1] - math.radians(20.0)) < math.radians(0.5)
    bare = step_response.heading_step(
        vehicle, {**designed.gains, "HDG_REF_W": 0.0}, math.radians(20.0), 30.0, designed.spec
    )
    assert np.max(np.abs(bare.command_rad)) > room


@pytest.mark.parametrize("step_m", [3.0, -3.0])
def test_a_new_depth_is_hardly_passed(
    model: IdentifiedModel, designed: Design, step_m: float
) -> None:
    level = pid.constant_loads(model).level_pitch_rad
    flown = step_response.depth_step(
        from_model(model), designed.gains, step_m, 60.0, designed.spec, level
    )
    way = math.copysign(1.0, step_m)
    assert np.max(way * flown.value) <= 1.1 * abs(step_m)
    assert abs(flown.value[-1] - step_m) < 0.1


def test_a_long_way_down_is_kept_to_where_the_elevator_holds_its_pitch(
    model: IdentifiedModel, designed: Design
) -> None:
    """What is missing of six metres when the way has just ended there."""
    level, step_m = pid.constant_loads(model).level_pitch_rad, 6.0
    missing = {}
    for stiffness in (0.0, designed.gains["PTCH_FF"]):
        values = {**designed.gains, "PTCH_FF": stiffness}
        flown = step_response.depth_step(
            from_model(model), values, step_m, 30.0, designed.spec, level
        )
        missing[stiffness] = (
            step_m
            - flown.value[np.searchsorted(flown.time_s, step_m / values["DPT_REF_RATE"] + 2.0)]
        )
    assert missing[designed.gains["PTCH_FF"]] < 0.6 * missing[0.0]


def test_integrators_finish(model: IdentifiedModel, designed: Design) -> None:
    """A rudder and an elevator offset of half a degree, in time: 15 % of the largest error after
    half a minute."""
    vehicle, offset = from_model(model), math.radians(0.5)
    for closed, surface, state in (
        (
            loop_transfer.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, designed.gains),
            vehicle.planes.yaw.B,
            2,
        ),
        (
            loop_transfer.close_depth(vehicle.planes.pitch, vehicle.pitch_lag, designed.gains),
            vehicle.planes.pitch.B,
            3,
        ),
    ):
        load = np.zeros(len(closed.A))
        load[: surface.size] = offset * surface
        answer = np.abs(loop_transfer.step_response(closed._replace(reference=load), state, 60.0))
        assert np.max(answer[300:]) <= 0.16 * np.max(answer)


def test_margins_survive_a_true_delay(model: IdentifiedModel, designed: Design) -> None:
    """Independent of the frequency grid: just inside the gain margin the loop settles in time, just
    outside not."""
    vehicle = from_model(model)
    margin = 10 ** (designed.analysis.margins["rudder"].gm_db / 20)
    for factor, stable in ((0.93 * margin, True), (1.07 * margin, False)):
        assert (_growth(vehicle, designed.gains, factor) < 1.0) == stable


def _growth(vehicle: DesignModel, gains: dict[str, float], factor: float) -> float:
    """The lag undone as the autopilot does it, by its own function: no state space asked."""
    dt, lag = 0.01, vehicle.yaw_lag
    servo = ActuatorLead(
        gains["ACT_LAG_W"], gains["ACT_LAG_Z"], gains["ACT_LEAD_W"], math.inf, math.inf
    )
    way: ReferenceState | None = None
    queue = [0.0] * round(lag.delay_s / dt)
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    A = np.zeros((5, 5))
    A[:3, :3], A[:3, 3] = vehicle.planes.yaw.A, vehicle.planes.yaw.B
    A[3, 4], A[4, 3], A[4, 4] = 1.0, -(wn**2), -2 * zeta * wn
    block = np.zeros((6, 6))
    block[:5, :5], block[4, 5] = A, wn**2
    step = expm(block * dt)
    x, integral, sizes = np.array([0.0, 0.0, 0.1, 0.0, 0.0]), 0.0, []
    for _ in range(int(120 / dt)):
        integral -= gains["HDG_I"] * x[2] * dt
        wanted = factor * (integral - gains["HDG_P"] * x[2] - gains["HDG_D"] * x[1])
        command, way = reference_model.lead(float(wanted), way, servo, dt)
        queue.append(command)
        x = step[:5, :5] @ x + step[:5, 5] * queue.pop(0)
        sizes.append(abs(x[2]))
    third = len(sizes) // 3
    return max(sizes[-third:]) / max(sizes[third : 2 * third])


def test_predicted_errors_are_those_of_a_lyapunov_equation(model: IdentifiedModel) -> None:
    """Heading under the slow disturbance alone: frequency integral against the closed loop's
    covariance."""
    from scipy.linalg import solve_continuous_lyapunov

    vehicle = from_model(model)
    sea = msgspec.structs.replace(vehicle.sea["yaw"], wave_accel_degps2=0.0)
    vehicle = vehicle._replace(sea={**vehicle.sea, "yaw": sea})
    closed = loop_transfer.close_heading(
        vehicle.planes.yaw, vehicle.yaw_lag, TABLE_3_INITIAL, order=6
    )
    n = len(closed.A)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[1, n], A[n, n] = closed.A, 1.0, -1.0 / sea.slow_time_s
    density = np.zeros_like(A)
    density[n, n] = 2.0 * math.radians(sea.slow_accel_degps2) ** 2 / sea.slow_time_s
    covariance = solve_continuous_lyapunov(A, -density)
    assert predict_response(vehicle, TABLE_3_INITIAL).heading_deg == pytest.approx(
        math.degrees(math.sqrt(covariance[2, 2])), rel=0.01
    )


def test_an_impossible_specification_is_refused_with_its_reason(model: IdentifiedModel) -> None:
    with pytest.raises(
        DesignInfeasibleError,
        match=(
            r"no gains meet the specification: the best found miss the .* ask for less, or .* and"
            r" refit"
        ),
    ):
        pid.redesign(model, Spec(pm_deg=85.0))


def test_gains_that_few_vehicles_would_keep_are_refused_with_what_would_help(
    model: IdentifiedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pid, "VEHICLES", 20)
    with pytest.raises(
        DesignInfeasibleError,
        match=r"of the vehicles that the model allows for .* most miss the .*refit",
    ):
        pid.redesign(model, Spec(probability=0.999))


def test_a_model_whose_fit_disagreed_is_refused(model: IdentifiedModel) -> None:
    doubtful = msgspec.structs.replace(
        model, convergence=msgspec.structs.replace(model.convergence, agreed=False)
    )
    with pytest.raises(DesignInfeasibleError, match="starts disagree"):
        pid.redesign(doubtful)


def test_gains_are_written_with_reasons_and_their_model(
    model: IdentifiedModel, designed: Design, tmp_path: Path
) -> None:
    path = tmp_path / "gains.param"
    designed.write_params(path)
    text = path.read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert sha256_of_model(model) in text.partition("HDG_P")[0]
    read = {line.split(",")[0]: float(line.split(",")[1].split("#")[0]) for line in lines}
    assert read == pytest.approx(designed.gains, rel=1e-5)
    assert set(read) > set(TABLE_3_INITIAL)
    assert all("  # " in line and len(line.split("  # ")[1]) > 8 for line in lines)


def test_integrators_have_room_for_the_constant_loads(
    model: IdentifiedModel, designed: Design
) -> None:
    """The rudder bias with three standard deviations, the pitch of level flight, and a few degrees
    more at most."""
    bias = model.planes["yaw"].actuator_bias_deg
    level = math.radians(abs(model.vehicle.level_pitch_deg))
    room = designed.gains["HDG_IMAX"] - math.radians(abs(bias.value))
    assert math.radians(3 * bias.sd) < room < math.radians(3.0)
    assert level < designed.gains["DPT_IMAX"] < level + math.radians(3.0)
