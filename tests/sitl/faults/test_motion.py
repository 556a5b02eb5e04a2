"""Effects of actuator and ballast faults on duct, shaft and vehicle, with known controls."""

from collections.abc import Callable
from math import atan2, degrees, dist, pi, radians, sin

import msgspec
import numpy as np
import pytest

from mavlink_io.frames import euler_from_quaternion
from mavlink_io.records import ActuatorFrame
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import plant
from sitl.core.truth import Truth
from sitl.faults import body
from sitl.vehicle import build_model, config

FROM_S = 5.0


def control(tick: int) -> ActuatorFrame:
    """Return a slow sine of half travel on both axes, and a thrust that changes after 10 s."""
    turn = 0.5 * sin(2 * pi * 0.1 * tick * TICK_S)
    return ActuatorFrame(0, 1, (turn, -turn, 0.58 if tick < 500 else 0.3, *(0.0,) * 13), 129)


def idle(tick: int) -> ActuatorFrame:
    """Return neutral outputs without thrust."""
    return ActuatorFrame(0, 1, (0.0,) * 16, 129)


def run(
    vehicle: str = "caribou_nominal",
    seconds: float = 15.0,
    controls: Callable[[int], ActuatorFrame] = control,
    /,
    **fault: str | float,
) -> list[Truth]:
    """Return the true state of every tick, with a fault from ``FROM_S`` on if given."""
    calm = scenario.load("calm")
    start = msgspec.structs.replace(calm.start, depth_m=6.0)
    rows = ({"at_s": FROM_S, **fault},) if fault else ()
    sea = plant.build(config.load(vehicle), msgspec.structs.replace(calm, start=start, fault=rows))
    rng = plant.random_streams(2)
    state, _ = plant.initial_state(sea, rng)
    truths = []
    for tick in range(round(seconds / TICK_S)):
        state, _ = plant.step(sea, state, controls(tick), rng)
        truths.append(state.truth)
    return truths


def angles_deg(truths: list[Truth], unit: str) -> np.ndarray:
    return np.degrees(
        [getattr(truth, f"{unit}_rad") for truth in truths if truth.time_us >= FROM_S * 1e6]
    )


@pytest.mark.parametrize("unit", ["rudder", "elevator"])
def test_axis_faults_change_duct_angle(unit: str) -> None:
    sound = angles_deg(run(), unit)
    other = {"rudder": "elevator", "elevator": "rudder"}[unit]

    def broken(kind: str, **sizes: float) -> np.ndarray:
        truths = run(unit=unit, kind=kind, **sizes)
        assert (angles_deg(truths, other) == angles_deg(run(), other)).all()
        return angles_deg(truths, unit)

    assert np.ptp(broken("stuck")) == 0.0
    assert broken("stuck", angle_deg=-12.0)[-1] == pytest.approx(-12.0, abs=0.1)
    assert broken("off")[-1] == pytest.approx(0.0, abs=0.1)
    assert broken("biased", angle_deg=2.5) - sound == pytest.approx(np.full(sound.size, 2.5))
    slow = broken("slow", rate_degps=1.0)
    assert np.abs(np.diff(slow)).max() == pytest.approx(1.0 * TICK_S, rel=1e-6)
    noise = broken("noisy", rms_deg=0.5) - sound
    assert noise.std() == pytest.approx(0.5, rel=0.1)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.15
    slipping = broken("slipping", share=0.5)
    way, whole = np.abs(np.diff(slipping)).sum(), np.abs(np.diff(sound)).sum()
    assert way / whole == pytest.approx(0.5, abs=0.1)


def test_propeller_faults_change_speed_or_thrust() -> None:
    sound = run()
    late = [n for n, truth in enumerate(sound) if truth.time_us > 12e6]
    off, stuck, weak = (run(unit="propeller", kind=kind) for kind in ("off", "stuck", "loss"))
    assert {off[n].propeller_rps for n in late} == {0.0}
    assert {stuck[n].propeller_rps for n in late} == {sound[300].propeller_rps}
    assert [truth.propeller_rps for truth in weak] == [truth.propeller_rps for truth in sound]
    before = next(n for n, truth in enumerate(sound) if truth.time_us == 9.5e6)
    slow_mps, full_mps = (
        dist(truth.velocity_ned_mps, truth.water_velocity_ned_mps)
        for truth in (weak[before], sound[before])
    )
    assert slow_mps < 0.9 * full_mps


def test_added_mass_has_point_mass_energy() -> None:
    model = build_model.build(config.load("caribou_truth"))
    r, m = np.array([0.4, -0.1, 0.07]), 3.0
    laden = body.add_mass(model, m, (0.4, -0.1, 0.07))
    for nu in np.random.default_rng(1).standard_normal((5, 6)):
        v = nu[:3] + np.cross(nu[3:], r)
        gained = 0.5 * nu @ (laden.inertia.M - model.inertia.M) @ nu
        assert gained == pytest.approx(0.5 * m * v @ v, rel=1e-9)
    assert laden.hydrostatics.weight_n - model.hydrostatics.weight_n == pytest.approx(
        m * 9.81, rel=1e-3
    )
    assert laden.inertia.M_inverse @ laden.inertia.M == pytest.approx(np.eye(6), abs=1e-9)


def test_shifted_weight_heels_vehicle() -> None:
    """tan(heel) = m d / (M (z_CB - z_CM)) for a weight m moved sideways by d."""
    model = build_model.build(config.load("caribou_truth"))
    h, m, d = model.hydrostatics, 4.0, 0.1
    mass_kg = model.inertia.mass_kg
    final = run("caribou_truth", 120.0, idle, unit="ballast", kind="shifted", mass_kg=m, y_m=d)[-1]
    roll_rad, _, _ = euler_from_quaternion(*final.attitude_q)
    first_y = mass_kg * h.y_cm_m + m * d
    first_z = (h.buoyancy_n * h.z_cb_m - h.weight_n * h.z_cm_m) / h.gravity_mps2
    assert degrees(-roll_rad) == pytest.approx(degrees(atan2(first_y, first_z)), rel=0.03)
    assert abs(roll_rad) > radians(1.0)


def test_leak_fault_sets_flooding() -> None:
    truths = run(unit="leak", kind="wet")
    assert {truth.flooding for truth in truths if truth.time_us >= FROM_S * 1e6} == {True}
    assert {truth.flooding for truth in truths if truth.time_us < FROM_S * 1e6} == {False}
