"""Simulated tests with disturbances: the simulator's vehicle under simple loops, logged as runs."""

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from sitl.core import tailcone
from sitl.core.tailcone import TailconeAxis
from sitl.vehicle import build_model, config, dynamics, propeller
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import STILL
from sysid.data.events import StopReason
from sysid.data.runs import RATE_HZ, Run
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
DT = 1.0 / RATE_HZ
SUBSTEPS = 4
"""Steps of the tailcone in a sample; the body moves in one, under the mean of their angles."""
SETTLE_S = 60.0
PREROLL_S = 15.0
DEPTH_M = 12.0

CALM = 0.0
ROUGH = 1.0
"""The level at which slow and wave-band moments give about 0.4 deg/s rms of yaw rate."""
SLOW_RADPS2, WAVE_RADPS2 = math.radians(0.128), math.radians(0.261)
"""Standard deviations of a vehicle's disturbing angular acceleration at level 1."""


class Hold(NamedTuple):
    """Gains of the loops that hold heading and depth before a test and in the untested plane."""

    heading_p: float = 0.6
    heading_d: float = 1.3
    heading_i: float = 0.02
    pitch_p: float = 0.8
    pitch_d: float = 1.5
    depth_p: float = 0.13
    depth_i: float = 0.005


class Tests(NamedTuple):
    """Signals on the 50 Hz grid, rad relative to trim; NaN where the plane's loop stays closed."""

    rudder_rad: Array
    elevator_rad: Array


class Sensors(NamedTuple):
    """Standard deviations of white noise; the gyro bias is sampled once per run."""

    rate_radps: float = math.radians(0.05)
    angle_rad: float = math.radians(0.1)
    depth_m: float = 0.005
    gyro_bias_radps: float = math.radians(0.02)


class Fault(NamedTuple):
    """Deviation of a surface from its command."""

    gain: float = 1.0
    """Factor of the deflection from trim."""
    slip_rad: float = 0.0
    """Additional deflection after a slip of the linkage, rad."""
    slip_s: float = 0.0
    """Time of the slip since the start of the test, s."""


def accelerations(seconds: float, level: float, rng: np.random.Generator) -> Array:
    """Disturbing angular accelerations about pitch and yaw, (samples, 2), rad/s^2.

    A Gauss-Markov process of 3 s and a narrow band at 0.15 Hz, by the Euler-Maruyama method.
    """
    n = int(seconds * RATE_HZ)
    out = np.zeros((n, 2))
    omega, zeta = 2 * math.pi * 0.15, 0.1
    for axis in range(2):
        slow, wave, speed = (
            rng.standard_normal(),
            rng.standard_normal(),
            omega * rng.standard_normal(),
        )
        draws = rng.standard_normal((n, 2))
        out[:, axis] = level * _coloured(draws, slow, wave, speed, omega, zeta)
    return out


@numba.njit(cache=True)
def _coloured(
    draws: Array, slow: float, wave: float, speed: float, omega: float, zeta: float
) -> Array:
    n = len(draws)
    out = np.empty(n)
    for k in range(n):
        slow += -slow * DT / 3.0 + math.sqrt(2 * DT / 3.0) * draws[k, 0]
        pushed = math.sqrt(4 * zeta * omega**3 * DT) * draws[k, 1]
        speed += (-2 * zeta * omega * speed - omega**2 * wave) * DT + pushed
        wave += speed * DT
        out[k] = SLOW_RADPS2 * slow + WAVE_RADPS2 * wave
    return out


@numba.njit(cache=True)
def _fly(
    model: VehicleModel,
    rudder_axis: TailconeAxis,
    elevator_axis: TailconeAxis,
    rudder_state: Array,
    elevator_state: Array,
    rudder_test: Array,
    elevator_test: Array,
    trim: Array,
    travel: float,
    hold: Hold,
    moments: Array,
    rps: float,
    speed: float,
    gains: Array,
    slips: Array,
    added: Array,
) -> Array:
    """Simulate all ticks: rates, angles, depth and commands.

    The loops hold heading 0 and DEPTH_M.
    """
    n = rudder_test.size
    log = np.empty((n, 9))
    state = np.zeros(13)
    state[2], state[3], state[7] = -DEPTH_M, 1.0, speed
    work = np.empty((5, 13))
    rudder_angle, elevator_angle = np.empty(SUBSTEPS), np.empty(SUBSTEPS)
    disturbance = np.zeros(6)
    integral = np.zeros(2)
    for k in range(n):
        w, x, y, z = state[3], state[4], state[5], state[6]
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        theta = -math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
        psi = -math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        p, q, r, depth = state[10], -state[11], -state[12], -state[2]
        rudder, elevator = trim[0] + rudder_test[k], trim[1] + elevator_test[k]
        if math.isnan(rudder):
            integral[0] += -hold.heading_i * psi * DT
            rudder = trim[0] - hold.heading_p * psi - hold.heading_d * r + integral[0]
        if math.isnan(elevator):
            integral[1] += hold.depth_i * (depth - DEPTH_M) * DT
            wanted = min(max(hold.depth_p * (depth - DEPTH_M) + integral[1], -0.3), 0.3)
            elevator = trim[1] + hold.pitch_p * (wanted - theta) - hold.pitch_d * q
        rudder, elevator = rudder + added[k, 0], elevator + added[k, 1]
        rudder, elevator = min(max(rudder, -travel), travel), min(max(elevator, -travel), travel)
        log[k] = np.array([p, q, r, roll, theta, psi, depth, rudder, elevator])
        disturbance[4], disturbance[5] = moments[k, 0], moments[k, 1]
        rudder, elevator = (
            trim[0] + gains[0] * (rudder - trim[0]),
            trim[1] + gains[1] * (elevator - trim[1]),
        )
        tailcone.advance(rudder_axis, rudder_state, rudder, rudder_angle)
        tailcone.advance(elevator_axis, elevator_state, elevator, elevator_angle)
        dynamics.rk4_step(
            state,
            np.mean(rudder_angle) + slips[k, 0],
            np.mean(elevator_angle) + slips[k, 1],
            rps,
            disturbance,
            STILL,
            DT,
            model,
            work,
        )
    return log


def fly_tests(
    vehicle: config.VehicleConfig,
    tests: Tests,
    *,
    rng: np.random.Generator,
    level: float = ROUGH,
    sensors: Sensors | None = None,
    trim_rad: tuple[float, float] = (0.0, 0.0),
    hold: Hold | None = None,
    sea_radps2: Array | None = None,
    faults: tuple[Fault, Fault] = (Fault(), Fault()),
    added: Tests | None = None,
) -> Array:
    """Simulate tests; return measurements (samples, 9) at 50 Hz from PREROLL_S before the tests on.

    Columns: p, q, r (rad/s), roll, pitch, heading (rad), depth (m), commanded rudder and elevator
    (rad). ``sea_radps2``, (SETTLE_S and the tests, 2), replaces the disturbance about pitch and
    yaw; ``faults`` are those of rudder and elevator. ``added`` signals are added to the commands of
    the loops.
    """
    sensors = sensors or Sensors()
    settling = np.full(int(SETTLE_S * RATE_HZ), np.nan)
    signals = [np.concatenate([settling, signal]) for signal in tests]
    model = build_model.build(vehicle)
    tail, point = vehicle.tailcone, vehicle.operating_point
    rudder_axis, elevator_axis = (
        tailcone.from_config(tail, bias, DT / SUBSTEPS)
        for bias in (tail.rudder_bias_deg, tail.elevator_bias_deg)
    )
    pushed = (
        accelerations(signals[0].size / RATE_HZ, level, rng) if sea_radps2 is None else sea_radps2
    )
    since_s = np.arange(signals[0].size) / RATE_HZ - SETTLE_S
    extra = np.zeros((signals[0].size, 2))
    if added is not None:
        extra[settling.size :] = np.column_stack(added)
    slips = np.column_stack(
        [np.where(since_s >= fault.slip_s, fault.slip_rad, 0.0) for fault in faults]
    )
    log: Array = _fly(
        model,
        rudder_axis,
        elevator_axis,
        tailcone.at_rest(rudder_axis),
        tailcone.at_rest(elevator_axis),
        signals[0],
        signals[1],
        np.array(trim_rad),
        math.radians(tail.travel_deg),
        hold or Hold(),
        pushed * np.diag(model.inertia.M)[4:6],
        propeller.rps(point.thrust_fraction, model),
        point.speed_mps,
        np.array([fault.gain for fault in faults]),
        slips,
        extra,
    )
    log = log[settling.size - int(PREROLL_S * RATE_HZ) :]
    log[:, :3] += sensors.gyro_bias_radps * rng.standard_normal(3)
    log[:, :3] += sensors.rate_radps * rng.standard_normal((len(log), 3))
    log[:, 3:6] += sensors.angle_rad * rng.standard_normal((len(log), 3))
    log[:, 6] += sensors.depth_m * rng.standard_normal(len(log))
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
    hold: Hold | None = None,
    sea_radps2: Array | None = None,
    fault: Fault | None = None,
    loop_on: bool = False,
) -> Run:
    """Simulate one test of ``signal_rad`` (50 Hz, relative to trim) and return its run.

    ``fault`` is that of the tested surface; with ``loop_on`` the signal is added to the loop's
    command.
    """
    closed, none = np.full(signal_rad.size, np.nan), np.zeros(signal_rad.size)
    tests, added, faults = [closed, closed], [none, none], [Fault(), Fault()]
    index = PLANES[plane].index
    tests[index], added[index], faults[index] = signal_rad, signal_rad, fault or Fault()
    log = fly_tests(
        vehicle,
        Tests(closed, closed) if loop_on else Tests(*tests),
        rng=np.random.default_rng(seed),
        level=level,
        sensors=sensors,
        trim_rad=trim_rad,
        hold=hold,
        sea_radps2=sea_radps2,
        faults=(faults[0], faults[1]),
        added=Tests(*added) if loop_on else None,
    )
    return run_of(log, vehicle, plane, signal_rad, name=name, wave=wave, trim_rad=trim_rad)


def run_of(
    log: Array,
    vehicle: config.VehicleConfig,
    plane: Plane,
    signal_rad: Array,
    *,
    name: str,
    wave: str,
    trim_rad: tuple[float, float],
) -> Run:
    """Return the measurements of ``fly_tests`` as the run of one plane."""
    n = len(log)
    return Run(
        name=name,
        plane=plane,
        wave=wave,
        magnitude_deg=math.degrees(float(np.max(np.abs(signal_rad)))),
        time_s=np.arange(n) / RATE_HZ - PREROLL_S,
        rudder_rad=log[:, 7],
        elevator_rad=log[:, 8],
        thrust=np.full(n, vehicle.operating_point.thrust_fraction),
        p_radps=log[:, 0],
        q_radps=log[:, 1],
        r_radps=log[:, 2],
        roll_rad=log[:, 3],
        pitch_rad=log[:, 4],
        heading_rad=np.unwrap(log[:, 5]),
        depth_m=log[:, 6],
        stop_reason=StopReason.COMPLETE,
        longest_gap_s=DT,
        rudder_trim_rad=trim_rad[0],
        elevator_trim_rad=trim_rad[1],
    )


def step(degrees: float, seconds: float = 15.0) -> Array:
    return np.full(int(seconds * RATE_HZ), math.radians(degrees))


def doublet(degrees: float, half_s: float = 5.0) -> Array:
    return np.concatenate([step(degrees, half_s), step(-degrees, half_s)])


def campaign(vehicle: config.VehicleConfig, seed: int = 0, level: float = ROUGH) -> list[Run]:
    """Simulate a set of tests like the paper's: rudder steps of both signs and elevator steps."""
    trim = -math.radians(vehicle.tailcone.rudder_bias_deg), math.radians(1.0)
    runs = []
    for number, degrees in enumerate((3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0)):
        name, signal = f"rudder/{number}", step(degrees, 20.0)
        runs.append(
            fly(
                vehicle,
                Plane.YAW,
                signal,
                name=name,
                seed=seed + number,
                level=level,
                trim_rad=trim,
            )
        )
    for number, (degrees, seconds) in enumerate(
        ((2.0, 8.0), (4.0, 8.0), (6.0, 7.0), (9.0, 6.0), (15.0, 5.0))
    ):
        name, signal = f"elevator/{number}", step(degrees, seconds)
        runs.append(
            fly(
                vehicle,
                Plane.PITCH,
                signal,
                name=name,
                seed=seed + 50 + number,
                level=level,
                trim_rad=trim,
            )
        )
    return runs
