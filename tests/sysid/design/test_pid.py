"""PID redesign: the specification verified by other methods, and infeasible requests."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm

from autopilot.control import params, reference_model
from autopilot.control.reference_model import NO_REFERENCE, ActuatorLead
from ground.campaign import refit
from ground.missions.script import MissionStep, Script, compile_items
from mavlink_io.errors import OperationError
from sitl.vehicle import config as vehicle_files
from sysid.control_analysis import loop_state_space
from sysid.design import constraints, pid
from sysid.design.design_model import DesignModel, analyse_loops, from_model, sample_models
from sysid.design.disturbance_response import command_noise_rad, predict_response
from sysid.design.pid import (
    Design,
    DesignInfeasibleError,
    DesignRobustness,
    Spec,
    heading,
    step_response,
)
from sysid.design.robustness import robustness
from sysid.models import model_export, prediction
from sysid.models.model_file import IdentifiedModel, sha256_of_model
from sysid.monte_carlo import samples, simulate
from sysid.monte_carlo.simulate import Sea
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import prior as design_priors
from sysid.validation.results import ModelAssessment, NextTest


@pytest.fixture(scope="module")
def designed(model: IdentifiedModel) -> Design:
    return pid.redesign(model)


def test_redesign_all_cuts_meet_specification(model: IdentifiedModel, designed: Design) -> None:
    spec, judged = designed.spec, analyse_loops(from_model(model), designed.gains)
    assert (spec.damping, spec.gm_db, spec.pm_deg, spec.max_sensitivity) == (0.6, 8.0, 55.0, 1.6)
    for cut in ("rudder", "heading", "elevator", "depth", "pitch"):
        margins = judged.margins[cut]
        assert margins.gm_db >= spec.gm_db * 0.995, cut
        assert margins.pm_deg >= spec.pm_deg * 0.995, cut
        assert margins.max_sensitivity <= spec.max_sensitivity * 1.005, cut


def test_redesign_impulse_response_is_damped(model: IdentifiedModel, designed: Design) -> None:
    """Response to an impulse in time: one overshoot below 0.2 and none after it."""
    vehicle = from_model(model)
    closed = loop_state_space.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, designed.gains)
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


def test_redesign_errors_are_below_initial_gains(designed: Design) -> None:
    """The margins are larger as well; compensation of the tailcone's lag makes both possible."""
    assert designed.predicted.heading_deg < 0.9 * designed.initial.heading_deg
    assert designed.predicted.depth_m < 0.9 * designed.initial.depth_m
    assert (
        designed.analysis.margins["rudder"].max_sensitivity
        < designed.initial_analysis.margins["rudder"].max_sensitivity
    )
    assert designed.gains["ACT_LEAD_W"] > 1.5 * designed.gains["ACT_LAG_W"]
    assert designed.gains["ACT_RATE_DEGPS"] == designed.spec.rate_degps


def test_redesign_holds_course_at_full_thrust(
    model: IdentifiedModel, designed: Design, bench: vehicle_files.VehicleConfig
) -> None:
    """1.7 times the speed is 9 dB of loop gain: before, the surfaces moved from stop to stop."""
    legs = (
        MissionStep(depth_m=5.0, heading_deg=0.0, thrust_pct=58.0, duration_s=60.0),
        MissionStep(depth_m=5.0, heading_deg=0.0, thrust_pct=100.0, duration_s=120.0),
    )
    items = compile_items(Script(name="fast", about="", step=legs))
    known, sea = prediction.vehicles(model)[0], design_priors.from_file(bench).noise
    largest_deg = []
    for speed_mps in (designed.gains["GAIN_SPD_MPS"], 0.0):
        gains = {**designed.gains, **samples.trims_deg(known), "GAIN_SPD_MPS": speed_mps}
        dive = simulate.fly(known, sea, items, params.config(gains), Sea(1.0), (1,))
        held = dive.log.actuators.time_s > dive.seconds - 40.0
        surfaces_rad = dive.log.actuators.rudder_rad[held], dive.log.actuators.elevator_rad[held]
        largest_deg.append(math.degrees(max(map(np.ptp, surfaces_rad))) / 2.0)
    scheduled_deg, unscheduled_deg = largest_deg
    assert scheduled_deg < 4.0
    assert unscheduled_deg > 8.0


def test_redesign_stricter_command_noise_gives_slower_lead(
    model: IdentifiedModel, designed: Design
) -> None:
    vehicle, spec = from_model(model), Spec(command_noise_deg=0.2)
    first = {**designed.gains, "ACT_LEAD_W": 0.0}
    strict = {**first, **heading.gains(vehicle, first, spec, constraints.nominal(spec))}
    assert strict["ACT_LEAD_W"] < designed.gains["ACT_LEAD_W"]
    assert command_noise_rad(vehicle, Plane.YAW, strict) == pytest.approx(
        math.radians(0.2), rel=0.02
    )


def test_robustness_other_samples_agrees(model: IdentifiedModel, designed: Design) -> None:
    """Other samples than those of the design."""
    assert designed.robustness is not None
    assert designed.robustness.relaxed >= designed.robustness.specification > 0.5
    fresh = list(sample_models(model, 2 * pid.VEHICLES))[pid.VEHICLES :]
    again = robustness(fresh, designed.gains, designed.spec)
    assert again is not None
    assert abs(again.specification - designed.robustness.specification) < 0.15
    assert again.relaxed > 0.9


def test_heading_step_reference_model_avoids_saturation(
    model: IdentifiedModel, designed: Design
) -> None:
    """By the autopilot's own loops: 20 deg within the travel left by the bias.

    Without a reference model the rudder would saturate.
    """
    vehicle, loads = from_model(model), pid.constant_loads(model)
    room = math.radians(15.0) - loads.rudder_rad
    response = step_response.heading_step(
        vehicle, designed.gains, math.radians(20.0), 30.0, designed.spec
    )
    assert np.max(np.abs(response.command_rad)) <= room
    assert abs(response.value[-1] - math.radians(20.0)) < math.radians(0.5)
    bare = step_response.heading_step(
        vehicle, {**designed.gains, "HDG_REF_W": 0.0}, math.radians(20.0), 30.0, designed.spec
    )
    assert np.max(np.abs(bare.command_rad)) > room


@pytest.mark.parametrize("step_m", [3.0, -3.0, 6.0, -6.0])
def test_depth_step_overshoot_is_small(
    model: IdentifiedModel, designed: Design, step_m: float
) -> None:
    level = pid.constant_loads(model).level_pitch_rad
    response = step_response.depth_step(
        from_model(model), designed.gains, step_m, 60.0, designed.spec, level
    )
    direction = math.copysign(1.0, step_m)
    assert np.max(direction * response.value) <= abs(step_m) + 0.04 * 3.0
    assert abs(response.value[-1] - step_m) < 0.1


def test_depth_reference_others_overshoot_or_settle_later(
    model: IdentifiedModel, designed: Design
) -> None:
    level, spec = pid.constant_loads(model).level_pitch_rad, designed.spec

    def changes(bandwidth_factor: float, lead_factor: float) -> tuple[float, float]:
        """Return overshoot (m) and mean time to stay within 3 cm (s)."""
        values = {
            **designed.gains,
            "DPT_REF_W": designed.gains["DPT_REF_W"] * bandwidth_factor,
            "DPT_REF_LEAD": designed.gains["DPT_REF_LEAD"] * lead_factor,
        }
        overshoots_m, settling_s = [], []
        for step_m in (3.0, -3.0, 6.0, -6.0):
            response = step_response.depth_step(
                from_model(model), values, step_m, 60.0, spec, level
            )
            error_m = math.copysign(1.0, step_m) * (response.value - step_m)
            overshoots_m.append(np.max(error_m))
            settling_s.append(response.time_s[np.abs(error_m) > 0.03][-1])
        return float(np.max(overshoots_m)), float(np.mean(settling_s))

    _, soonest_s = changes(1.0, 1.0)
    for factors in ((0.6, 1.0), (0.8, 1.0), (1.25, 1.0), (1.6, 1.0), (1.0, 0.7), (1.0, 1.3)):
        overshoot_m, settling_s = changes(*factors)
        assert overshoot_m > 0.12 or settling_s > soonest_s, factors


def test_depth_step_pitch_feedforward_reduces_lag(model: IdentifiedModel, designed: Design) -> None:
    """Depth error after a change of 6 m, when the reference has just arrived."""
    level, step_m = pid.constant_loads(model).level_pitch_rad, 6.0
    missing = {}
    for stiffness in (0.0, designed.gains["PTCH_FF"]):
        values = {**designed.gains, "PTCH_FF": stiffness}
        response = step_response.depth_step(
            from_model(model), values, step_m, 30.0, designed.spec, level
        )
        missing[stiffness] = (
            step_m
            - response.value[
                np.searchsorted(response.time_s, step_m / values["DPT_REF_RATE"] + 2.0)
            ]
        )
    assert missing[designed.gains["PTCH_FF"]] < 0.6 * missing[0.0]


def test_integrators_offset_is_compensated_in_time(
    model: IdentifiedModel, designed: Design
) -> None:
    """In simulation, offsets of 0.5 deg leave 15 % of their largest error after 30 s."""
    vehicle, offset = from_model(model), math.radians(0.5)
    for closed, surface, state in (
        (
            loop_state_space.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, designed.gains),
            vehicle.planes.yaw.B,
            2,
        ),
        (
            loop_state_space.close_depth(vehicle.planes.pitch, vehicle.pitch_lag, designed.gains),
            vehicle.planes.pitch.B,
            3,
        ),
    ):
        load = np.zeros(len(closed.A))
        load[: surface.size] = offset * surface
        answer = np.abs(
            loop_state_space.step_response(closed._replace(reference=load), state, 60.0)
        )
        assert np.max(answer[300:]) <= 0.16 * np.max(answer)


def test_gain_margin_true_delay_is_the_stability_limit(
    model: IdentifiedModel, designed: Design
) -> None:
    """In simulation the loop is stable just below the gain margin and unstable above it."""
    vehicle = from_model(model)
    margin = 10 ** (designed.analysis.margins["rudder"].gm_db / 20)
    for factor, stable in ((0.93 * margin, True), (1.07 * margin, False)):
        assert (_growth(vehicle, designed.gains, factor) < 1.0) == stable


def _growth(vehicle: DesignModel, gains: dict[str, float], factor: float) -> float:
    """Simulate with the autopilot's own actuator lead; return late over early amplitude."""
    dt, lag = 0.01, vehicle.yaw_lag
    lag_and_lead = [gains[f"ACT_{name}"] for name in ("LAG_W", "LAG_Z", "LEAD_W", "LEAD_Z")]
    servo = ActuatorLead._make([*lag_and_lead, math.inf, math.inf])
    reference = NO_REFERENCE
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
        command, reference = reference_model.lead(float(wanted), reference, servo, dt)
        queue.append(command)
        x = step[:5, :5] @ x + step[:5, 5] * queue.pop(0)
        sizes.append(abs(x[2]))
    third = len(sizes) // 3
    return float(max(sizes[-third:]) / max(sizes[third : 2 * third]))


def test_predicted_heading_equals_lyapunov_equation(model: IdentifiedModel) -> None:
    """Heading for the slow disturbance alone: frequency integral against the covariance."""
    from scipy.linalg import solve_continuous_lyapunov

    vehicle = from_model(model)
    sea = msgspec.structs.replace(vehicle.disturbance[Plane.YAW], wave_accel_degps2=0.0)
    vehicle = vehicle._replace(disturbance={**vehicle.disturbance, Plane.YAW: sea})
    closed = loop_state_space.close_heading(
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


def test_redesign_impossible_specification_raises(model: IdentifiedModel) -> None:
    with pytest.raises(
        DesignInfeasibleError,
        match=(
            r"no gains meet the specification: the best ones violate the .*; ask for less, as a"
            r" campaign would: --damping 0.5 .* --integral-settling-s 60"
        ),
    ):
        pid.redesign(model, Spec(pm_deg=85.0))


def test_redesign_low_robustness_raises_with_advice(
    model: IdentifiedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The nominal model is at its limit of 55 deg, so that half of the samples are below it."""
    monkeypatch.setattr(pid, "VEHICLES", 20)
    with pytest.raises(
        DesignInfeasibleError,
        match=r"of the vehicles sampled from the model .* most violate the .*refit",
    ):
        pid.redesign(model, Spec(robust_fraction=0.999, robust_pm_deg=55.0))


@pytest.mark.parametrize(
    ("worst", "advice"),
    [
        ("phase margin at the rudder", "fly chirp of 5 deg on the rudder for 30 s"),
        ("damping of the pitch loop", "record more tests of the elevator, or sweep the tailcone"),
    ],
)
def test_advice_is_for_the_plane_of_the_worst_limit(
    model: IdentifiedModel, worst: str, advice: str
) -> None:
    test = NextTest(
        plane=Plane.YAW, signal="chirp", magnitude_deg=5.0, duration_s=30.0, reason="coherence"
    )
    assessed = msgspec.structs.replace(model, assessment=ModelAssessment(True, (), (), test))
    few = DesignRobustness(specification=0.4, relaxed=1.0, worst=worst, vehicles=20)
    with pytest.raises(DesignInfeasibleError, match=f"{worst}; {advice}"):
        pid.check_robustness(few, assessed, Spec())


def test_edited_number_is_named(model: IdentifiedModel) -> None:
    vehicle = msgspec.structs.replace(model.vehicle, file=vehicle_files.load(model.vehicle.prior))
    own = msgspec.structs.replace(model, vehicle=vehicle)
    assert model_export.edited_number(own) == ""
    pitch = own.planes[Plane.PITCH]
    delayed = msgspec.structs.replace(
        pitch, delay_s=msgspec.structs.replace(pitch.delay_s, value=9.0)
    )
    edited = msgspec.structs.replace(own, planes=own.planes | {Plane.PITCH: delayed})
    assert model_export.edited_number(edited).startswith("planes.pitch.delay_s.value = 9: vehicle")


def test_assessment_without_reasons_is_a_reason(model: IdentifiedModel) -> None:
    silent = ModelAssessment(fit_for_redesign=False, reasons=(), checks=(), next_test=None)
    with pytest.raises(OperationError, match="not fit for redesign: its assessment gives no reas"):
        refit.redesign(msgspec.structs.replace(model, assessment=silent))


def test_redesign_ambiguous_fit_raises(model: IdentifiedModel) -> None:
    doubtful = msgspec.structs.replace(
        model, convergence=msgspec.structs.replace(model.convergence, agreed=False)
    )
    with pytest.raises(DesignInfeasibleError, match="starts disagree"):
        pid.redesign(doubtful)


def test_write_params_contains_reasons_and_model(
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


def test_integrator_limits_cover_constant_loads(model: IdentifiedModel, designed: Design) -> None:
    """Rudder bias plus three standard deviations, pitch of level flight, and some reserve."""
    bias = model.planes[Plane.YAW].actuator_bias_deg
    level = math.radians(abs(model.vehicle.level_pitch_deg))
    assert bias.sd is not None
    room = designed.gains["HDG_IMAX"] - math.radians(abs(bias.value))
    assert math.radians(3 * bias.sd) < room < math.radians(3.0)
    assert level < designed.gains["DPT_IMAX"] < level + math.radians(3.0)
