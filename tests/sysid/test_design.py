"""A design meets its own specification when judged by other means, refuses when it cannot, and says why."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm

from sysid import analysis, design, loops
from sysid.design import Design, DesignRefused, Spec
from sysid.model import IdentifiedModel, digest
from sysid.tables import TABLE_3_INITIAL


@pytest.fixture(scope="module")
def designed(model: IdentifiedModel) -> Design:
    return design.redesign(model)


def test_specification_holds_at_every_cut(designed: Design) -> None:
    spec = designed.spec
    for cut in ("rudder", "heading", "elevator", "depth"):
        margins = designed.analysis.margins[cut]
        assert margins.gm_db >= spec.gm_db * 0.998, cut
        assert margins.pm_deg >= spec.pm_deg * 0.998, cut
        assert margins.ms <= spec.ms * 1.002, cut
    for loop in ("heading", "depth"):
        assert analysis.damping(designed.analysis.poles[loop]) >= spec.damping * 0.998
    assert max(p.real for p in designed.analysis.poles["heading"]) <= -spec.slowest_radps * 0.998
    assert designed.gains["HDG_P"] * spec.heading_step_deg <= spec.travel_deg * 1.001


def test_redesign_leaves_less_error_than_the_prototype(model: IdentifiedModel, designed: Design) -> None:
    """As a log would show it. Heading pays for it with damping: no more is claimed there than the specification."""
    vehicle = design.plant(model)
    heading = [design._heading_error(vehicle, gains, 0.0) for gains in (TABLE_3_INITIAL, designed.gains)]
    assert heading[1] < heading[0]
    assert designed.predicted.depth_m < designed.initial.depth_m
    before, after = (analysis.damping(a.poles["depth"]) for a in (designed.initial_analysis, designed.analysis))
    assert after > before


def test_margins_survive_a_true_delay(model: IdentifiedModel, designed: Design) -> None:
    """Independent of the frequency grid: just inside the gain margin the loop settles in time, just outside not."""
    vehicle = design.plant(model)
    margin = 10 ** (designed.analysis.margins["rudder"].gm_db / 20)
    for factor, stable in ((0.93 * margin, True), (1.07 * margin, False)):
        assert (_growth(vehicle, designed.gains, factor) < 1.0) == stable


def _growth(vehicle: design.Plant, gains: dict[str, float], factor: float) -> float:
    dt, lag = 0.01, vehicle.yaw_lag
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
        queue.append(factor * (integral - gains["HDG_P"] * x[2] - gains["HDG_D"] * x[1]))
        x = step[:5, :5] @ x + step[:5, 5] * queue.pop(0)
        sizes.append(abs(x[2]))
    third = len(sizes) // 3
    return max(sizes[-third:]) / max(sizes[third : 2 * third])


def test_predicted_errors_are_those_of_a_lyapunov_equation(model: IdentifiedModel) -> None:
    """Heading under the slow disturbance alone: frequency integral against the closed loop's covariance."""
    from scipy.linalg import solve_continuous_lyapunov

    vehicle = design.plant(model)
    sea = msgspec.structs.replace(vehicle.sea["yaw"], wave_accel_degps2=0.0)
    vehicle = vehicle._replace(sea={**vehicle.sea, "yaw": sea})
    closed = loops.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, TABLE_3_INITIAL, order=6)
    n = len(closed.A)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[1, n], A[n, n] = closed.A, 1.0, -1.0 / sea.slow_time_s
    density = np.zeros_like(A)
    density[n, n] = 2.0 * math.radians(sea.slow_accel_degps2) ** 2 / sea.slow_time_s
    covariance = solve_continuous_lyapunov(A, -density)
    assert design.respond(vehicle, TABLE_3_INITIAL).heading_deg == pytest.approx(
        math.degrees(math.sqrt(covariance[2, 2])), rel=0.01
    )


def test_an_impossible_specification_is_refused_with_its_reason(model: IdentifiedModel) -> None:
    with pytest.raises(DesignRefused, match="no gains meet the specification: the best found miss the"):
        design.redesign(model, Spec(pm_deg=85.0, slowest_radps=0.2))


def test_a_model_whose_fit_disagreed_is_refused(model: IdentifiedModel) -> None:
    doubtful = msgspec.structs.replace(model, convergence=msgspec.structs.replace(model.convergence, agreed=False))
    with pytest.raises(DesignRefused, match="starts disagree"):
        design.redesign(doubtful)


def test_gains_are_written_with_reasons_and_their_model(
    model: IdentifiedModel, designed: Design, tmp_path: Path
) -> None:
    path = tmp_path / "gains.param"
    designed.write_params(path)
    header, *lines = path.read_text().splitlines()
    assert digest(model) in header
    read = {line.split(",")[0]: float(line.split(",")[1].split("#")[0]) for line in lines}
    assert read == pytest.approx(designed.gains, rel=1e-5)
    assert set(read) == set(TABLE_3_INITIAL)
    assert all("  # " in line and len(line.split("  # ")[1]) > 8 for line in lines)


def test_integrators_have_room_for_the_constant_loads(model: IdentifiedModel, designed: Design) -> None:
    """The rudder bias with three standard deviations, the pitch of level flight, and a few degrees more at most."""
    bias = model.planes["yaw"].actuator_bias_deg
    level = math.radians(abs(model.vehicle.level_pitch_deg))
    room = designed.gains["HDG_IMAX"] - math.radians(abs(bias.value))
    assert math.radians(3 * bias.sd) < room < math.radians(3.0)
    assert level < designed.gains["DPT_IMAX"] < level + math.radians(3.0)


def test_the_integrator_finishes_and_the_sea_disturbs_less(model: IdentifiedModel, designed: Design) -> None:
    """A rudder offset of half a degree is gone within two minutes; the prototype's integrator leaves it for good."""
    vehicle = design.plant(model)
    left = []
    for gains in (TABLE_3_INITIAL, designed.gains):
        closed = loops.close_heading(vehicle.planes.yaw, vehicle.yaw_lag, gains)
        load = np.zeros(len(closed.A))
        load[:3] = vehicle.planes.yaw.B * math.radians(0.5)
        left.append(math.degrees(loops.step_response(closed._replace(reference=load), 2, 120.0)[-1]))
    assert abs(left[1]) < 0.05 < abs(left[0])
    assert designed.predicted.heading_deg < designed.initial.heading_deg
