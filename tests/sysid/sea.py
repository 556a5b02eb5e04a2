"""A sea to identify in: the simulator's vehicle and tailcone under simple loops, logged as runs."""

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from sitl import tailcone
from sitl.vehicle import calibrate, config, dynamics, propeller
from sitl.vehicle.water import STILL
from sysid.runs import RATE_HZ, Plane, Run

Array = NDArray[np.float64]
DT = 1.0 / RATE_HZ
SUBSTEPS = 4
SETTLE_S = 60.0
PREROLL_S = 15.0
DEPTH_M = 12.0

CALM = 0.0
ROUGH = 1.0
"""The level at which slow and wave-band moments give about 0.4 deg/s rms of yaw rate."""
SLOW_NM, WAVE_NM = 2.25, 4.58


class Sensors(NamedTuple):
    """Standard deviations of white noise; the gyro bias is drawn once a run."""

    rate_radps: float = math.radians(0.05)
    angle_rad: float = math.radians(0.1)
    depth_m: float = 0.005
    gyro_bias_radps: float = math.radians(0.02)


def moments(seconds: float, level: float, rng: np.random.Generator) -> Array:
    """(samples, 2): pitch and yaw moment in N m, a 3 s Gauss-Markov process and a 0.15 Hz band, by Euler-Maruyama."""
    n = int(seconds * RATE_HZ)
    out = np.zeros((n, 2))
    omega, zeta = 2 * math.pi * 0.15, 0.1
    for axis in range(2):
        slow, wave, speed = rng.standard_normal(), rng.standard_normal(), omega * rng.standard_normal()
        draws = rng.standard_normal((n, 2))
        for k in range(n):
            slow += -slow * DT / 3.0 + math.sqrt(2 * DT / 3.0) * draws[k, 0]
            speed += (-2 * zeta * omega * speed - omega**2 * wave) * DT + math.sqrt(4 * zeta * omega**3 * DT) * draws[
                k, 1
            ]
            wave += speed * DT
            out[k, axis] = level * (SLOW_NM * slow + WAVE_NM * wave)
    return out


@numba.njit(cache=True)
def _fly(model, rudder_axis, elevator_axis, rudder_state, elevator_state, signal, is_yaw, trim, wrenches, rps, speed):
    """Ticks of (time index): rates, angles, depth, commands. The loops hold heading 0 and DEPTH_M."""
    n = signal.size
    log = np.empty((n, 9))
    state = np.zeros(13)
    state[2], state[3], state[7] = -DEPTH_M, 1.0, speed
    work = np.empty((5, 13))
    rudder_angle, elevator_angle = np.empty(SUBSTEPS), np.empty(SUBSTEPS)
    disturbance = np.zeros(6)
    integral = np.zeros(2)
    travel = math.radians(15.0)
    for k in range(n):
        w, x, y, z = state[3], state[4], state[5], state[6]
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        theta = -math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
        psi = -math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        p, q, r, depth = state[10], -state[11], -state[12], -state[2]
        testing = not math.isnan(signal[k])
        if testing and is_yaw:
            rudder = trim[0] + signal[k]
        else:
            integral[0] += -0.02 * psi * DT
            rudder = trim[0] - 0.6 * psi - 1.3 * r + integral[0]
        if testing and not is_yaw:
            elevator = trim[1] + signal[k]
        else:
            integral[1] += 0.005 * (depth - DEPTH_M) * DT
            wanted = 0.13 * (depth - DEPTH_M) + integral[1]
            elevator = trim[1] + 0.8 * (wanted - theta) - 1.5 * q
        rudder, elevator = min(max(rudder, -travel), travel), min(max(elevator, -travel), travel)
        log[k] = np.array([p, q, r, roll, theta, psi, depth, rudder, elevator])
        disturbance[4], disturbance[5] = wrenches[k, 0], wrenches[k, 1]
        tailcone.advance(rudder_axis, rudder_state, rudder, rudder_angle)
        tailcone.advance(elevator_axis, elevator_state, elevator, elevator_angle)
        for i in range(SUBSTEPS):
            dynamics.rk4_step(
                state, rudder_angle[i], elevator_angle[i], rps, disturbance, STILL, DT / SUBSTEPS, model, work
            )
    return log


def fly(
    vehicle: config.VehicleConfig,
    plane: Plane,
    signal_rad: Array,
    *,
    name: str = "run",
    wave: str = "step",
    seed: int = 0,
    level: float = ROUGH,
    sensors: Sensors | None = None,
    trim_rad: tuple[float, float] = (0.0, 0.0),
) -> Run:
    """One test of ``signal_rad`` (50 Hz, relative to trim) as identification would receive it."""
    sensors = sensors or Sensors()
    rng = np.random.default_rng(seed)
    model = calibrate.build(vehicle)
    settle = int(SETTLE_S * RATE_HZ)
    signal = np.concatenate([np.full(settle, np.nan), signal_rad])
    axes = [
        tailcone.servo(
            natural_frequency_radps=vehicle.tailcone.natural_frequency_radps,
            damping=vehicle.tailcone.damping_ratio,
            delay_s=vehicle.tailcone.delay_s,
            travel_rad=math.radians(vehicle.tailcone.travel_deg),
            rate_limit_radps=math.radians(vehicle.tailcone.rate_degps),
            bias_rad=math.radians(bias),
            substep_s=DT / SUBSTEPS,
        )
        for bias in (vehicle.tailcone.rudder_bias_deg, vehicle.tailcone.elevator_bias_deg)
    ]
    thrust = vehicle.operating_point.thrust_fraction
    log = _fly(
        model, *axes, *map(tailcone.at_rest, axes), signal, plane == "yaw", np.array(trim_rad),
        moments(signal.size / RATE_HZ, level, rng), propeller.rps(thrust, model), vehicle.operating_point.speed_mps,
    )  # fmt: skip
    log = log[settle - int(PREROLL_S * RATE_HZ) :]
    n = len(log)
    rates = (
        log[:, :3] + sensors.gyro_bias_radps * rng.standard_normal(3) + sensors.rate_radps * rng.standard_normal((n, 3))
    )
    angles = log[:, 3:6] + sensors.angle_rad * rng.standard_normal((n, 3))
    depth = log[:, 6] + sensors.depth_m * rng.standard_normal(n)
    return Run(
        name=name,
        plane=plane,
        wave=wave,
        magnitude_deg=math.degrees(float(np.max(np.abs(signal_rad)))),
        time_s=np.arange(n) / RATE_HZ - PREROLL_S,
        rudder_rad=log[:, 7],
        elevator_rad=log[:, 8],
        thrust=np.full(n, thrust),
        p_radps=rates[:, 0],
        q_radps=rates[:, 1],
        r_radps=rates[:, 2],
        roll_rad=angles[:, 0],
        pitch_rad=angles[:, 1],
        heading_rad=np.unwrap(angles[:, 2]),
        depth_m=depth,
        stop_reason="",
        longest_gap_s=DT,
        rudder_trim_rad=trim_rad[0],
        elevator_trim_rad=trim_rad[1],
    )


def step(degrees: float, seconds: float = 15.0) -> Array:
    return np.full(int(seconds * RATE_HZ), math.radians(degrees))


def doublet(degrees: float, half_s: float = 5.0) -> Array:
    return np.concatenate([step(degrees, half_s), step(-degrees, half_s)])


def campaign(vehicle: config.VehicleConfig, seed: int = 0, level: float = ROUGH) -> list[Run]:
    """The paper's kind of set: rudder steps of both signs, elevator steps nose up, from a trimmed vehicle."""
    trim = -math.radians(vehicle.tailcone.rudder_bias_deg), math.radians(1.0)
    runs = []
    for number, degrees in enumerate((3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0)):
        name, signal = f"rudder/{number}", step(degrees, 20.0)
        runs.append(fly(vehicle, "yaw", signal, name=name, seed=seed + number, level=level, trim_rad=trim))
    for number, (degrees, seconds) in enumerate(((2.0, 8.0), (4.0, 8.0), (6.0, 7.0), (9.0, 6.0), (15.0, 5.0))):
        name, signal = f"elevator/{number}", step(degrees, seconds)
        runs.append(fly(vehicle, "pitch", signal, name=name, seed=seed + 50 + number, level=level, trim_rad=trim))
    return runs
