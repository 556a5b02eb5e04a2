"""The four plants, and seeded variants of each."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.plants import small_signal
from benchmarks.plants.actuators import FIRST_ORDER, SECOND_ORDER, SERVO, Axis
from benchmarks.plants.forces import GRAVITY, LUMPED, RACE, STALL, VORTEX, Body
from benchmarks.plants.small_signal import Trim

Array = NDArray[np.float64]
_deg = math.radians

Rows = tuple[tuple[float, float], tuple[float, float]]


class Sensors(NamedTuple):
    """Errors of sensors and recorder."""

    rate_hz: float
    """Rows of the log per second."""
    jitter_s: float
    """Standard deviation of the time stamps."""
    dropped: float
    """Fraction of rows that are missing."""
    gyro_lag_s: float
    angle_lag_s: float
    depth_lag_s: float
    speed_noise_mps: float = 0.0
    """Noise of a Doppler log; 0 for a vehicle without one."""


class Specification(NamedTuple):
    """Nominal plant: what the calibration turns into a body."""

    kind: int
    length_m: float
    mass_kg: float
    m_kg: tuple[float, float, float]
    j_kgm2: tuple[float, float, float]
    yaw: Rows
    """State matrix of (v, r)."""
    pitch: Rows
    """State matrix of (w, q)."""
    b1_per_s2: float
    """Angular acceleration per rudder angle."""
    x_tail_m: float
    restoring_per_s2: float
    net_buoyancy_n: float
    stall_rad: float
    crossflow_kgpm: float
    turn_drag: float
    thrust_n: float
    speed_mps: float
    rudder: Axis
    elevator: Axis
    sensors: Sensors
    travel_deg: float
    thrust_pct: float


class Plant(NamedTuple):
    """One vehicle."""

    name: str
    body: Body
    rudder: Axis
    elevator: Axis
    sensors: Sensors
    travel_rad: float
    thrust_pct: float
    trim: Trim

    @property
    def trim_command_rad(self) -> tuple[float, float]:
        """Commands of straight flight, rounded to half a degree as a trim dive would."""
        half = math.radians(0.5)
        wanted = -self.rudder.bias_rad, self.trim.elevator_rad - self.elevator.bias_rad
        return round(wanted[0] / half) * half, round(wanted[1] / half) * half


STICKING = Axis(
    FIRST_ORDER,
    delay_s=0.1,
    omega_radps=8.0,
    damping=0.0,
    rate_radps=_deg(25),
    bias_rad=0.0,
    breakaway_rad=_deg(0.35),
    lift_lag_s=0.06,
)
"""Surface of plant "stall"."""

SPECIFICATIONS: dict[str, Specification] = {
    "race": Specification(
        kind=RACE,
        length_m=3.5,
        mass_kg=640.0,
        m_kg=(660.0, 1262.0, 1285.0),
        j_kgm2=(21.0, 1000.0, 985.0),
        yaw=((-0.38, -0.40), (-0.19, -0.53)),
        pitch=((-0.36, 0.39), (0.17, -0.55)),
        b1_per_s2=0.50,
        x_tail_m=-1.70,
        restoring_per_s2=-0.11,
        net_buoyancy_n=24.0,
        stall_rad=_deg(20.0),
        crossflow_kgpm=800.0,
        turn_drag=1.0,
        thrust_n=28.0,
        speed_mps=1.27,
        rudder=Axis(SECOND_ORDER, 0.26, 3.2, 0.75, _deg(15), _deg(-4), _deg(0.3), _deg(0.1)),
        elevator=Axis(SECOND_ORDER, 0.26, 3.2, 0.75, _deg(15), _deg(1), _deg(0.3), _deg(0.1)),
        sensors=Sensors(50.0, 0.003, 0.02, 0.03, 0.03, 0.15),
        travel_deg=15.0,
        thrust_pct=58.0,
    ),
    "stall": Specification(
        kind=STALL,
        length_m=5.0,
        mass_kg=1580.0,
        m_kg=(1640.0, 3500.0, 3560.0),
        j_kgm2=(150.0, 6600.0, 6500.0),
        yaw=((-0.37, -0.16), (-0.13, -0.42)),
        pitch=((-0.36, 0.17), (0.14, -0.44)),
        b1_per_s2=0.55,
        x_tail_m=-2.0,
        restoring_per_s2=-0.075,
        net_buoyancy_n=28.0,
        stall_rad=_deg(17.0),
        crossflow_kgpm=1690.0,
        turn_drag=1.0,
        thrust_n=90.0,
        speed_mps=1.54,
        rudder=STICKING._replace(bias_rad=_deg(-2)),
        elevator=STICKING._replace(bias_rad=_deg(1)),
        sensors=Sensors(25.0, 0.004, 0.01, 0.05, 0.05, 0.25, 0.02),
        travel_deg=15.0,
        thrust_pct=55.0,
    ),
    "lumped": Specification(
        kind=LUMPED,
        length_m=1.33,
        mass_kg=30.5,
        m_kg=(31.4, 64.0, 66.0),
        j_kgm2=(0.143, 8.4, 8.2),
        yaw=((-1.00, -0.36), (-2.6, -1.45)),
        pitch=((-0.95, 0.38), (2.8, -1.40)),
        b1_per_s2=2.8,
        x_tail_m=-0.6,
        restoring_per_s2=-0.65,
        net_buoyancy_n=3.3,
        stall_rad=_deg(19.0),
        crossflow_kgpm=160.0,
        turn_drag=1.0,
        thrust_n=9.25,
        speed_mps=1.50,
        rudder=Axis(
            SERVO, 0.11, 7.0, 0.0, _deg(30), _deg(-1), step_rad=_deg(0.05), dead_rad=_deg(0.04)
        ),
        elevator=Axis(
            SERVO, 0.11, 7.0, 0.0, _deg(30), _deg(0.5), step_rad=_deg(0.05), dead_rad=_deg(0.04)
        ),
        sensors=Sensors(20.0, 0.005, 0.02, 0.02, 0.0, 0.1),
        travel_deg=13.6,
        thrust_pct=60.0,
    ),
    "vortex": Specification(
        kind=VORTEX,
        length_m=2.0,
        mass_kg=58.2,
        m_kg=(59.0, 122.0, 126.0),
        j_kgm2=(0.38, 39.5, 38.5),
        yaw=((-0.92, -0.22), (-0.85, -1.08)),
        pitch=((-0.88, 0.21), (0.9, -1.0)),
        b1_per_s2=2.2,
        x_tail_m=-0.85,
        restoring_per_s2=-0.155,
        net_buoyancy_n=3.0,
        stall_rad=_deg(18.0),
        crossflow_kgpm=260.0,
        turn_drag=1.0,
        thrust_n=11.7,
        speed_mps=1.46,
        rudder=Axis(SECOND_ORDER, 0.09, 8.6, 0.65, _deg(30), _deg(-3), _deg(0.2)),
        elevator=Axis(SECOND_ORDER, 0.09, 7.0, 0.95, _deg(30), _deg(1), _deg(0.2)),
        sensors=Sensors(40.0, 0.003, 0.03, 0.04, 0.06, 0.2, 0.03),
        travel_deg=15.0,
        thrust_pct=60.0,
    ),
}


def plant(name: str, seed: int) -> Plant:
    """Return the variant of a plant that belongs to a seed.

    Every entry of the state matrices, the surface force, its lever, crossflow, stall, drag in turns
    and righting moment are multiplied by log-normal factors; delay, bias and buoyancy are shifted.
    """
    spec = SPECIFICATIONS[name]
    draws = np.random.default_rng([seed, 40_000 + spec.kind])

    def factor(sd: float) -> float:
        return math.exp(sd * float(draws.standard_normal()))

    def rows(matrix: Rows) -> Rows:
        (a, b), (c, d) = np.array(matrix) * np.exp(0.08 * draws.standard_normal((2, 2)))
        return (float(a), float(b)), (float(c), float(d))

    varied = spec._replace(
        yaw=rows(spec.yaw),
        pitch=rows(spec.pitch),
        b1_per_s2=spec.b1_per_s2 * factor(0.1),
        x_tail_m=spec.x_tail_m * factor(0.03),
        restoring_per_s2=-abs(spec.restoring_per_s2) * factor(0.08),
        net_buoyancy_n=spec.net_buoyancy_n * factor(0.1),
        stall_rad=spec.stall_rad * factor(0.1),
        crossflow_kgpm=spec.crossflow_kgpm * factor(0.2),
        turn_drag=spec.turn_drag * factor(0.25),
    )
    late = 0.02 * draws.standard_normal()
    return assemble(
        name,
        varied._replace(
            rudder=spec.rudder._replace(delay_s=spec.rudder.delay_s + late),
            elevator=spec.elevator._replace(delay_s=spec.elevator.delay_s + late),
        ),
    )


def assemble(name: str, spec: Specification) -> Plant:
    """Return the plant that has the small-signal behaviour of a specification."""
    body = Body(
        kind=spec.kind,
        length_m=spec.length_m,
        mass_kg=spec.mass_kg,
        m_kg=spec.m_kg,
        j_kgm2=spec.j_kgm2,
        net_buoyancy_n=spec.net_buoyancy_n,
        z_g_m=abs(spec.restoring_per_s2) * spec.j_kgm2[1] / (spec.mass_kg * GRAVITY),
        x_tail_m=spec.x_tail_m,
        tail_kgpm=spec.b1_per_s2 * spec.j_kgm2[2] / (abs(spec.x_tail_m) * spec.speed_mps**2),
        stall_rad=spec.stall_rad,
        crossflow_kgpm=spec.crossflow_kgpm,
        surge_drag_kgpm=spec.thrust_n / spec.speed_mps**2,
        turn_drag=spec.turn_drag,
        thrust_n=spec.thrust_n,
        design_speed_mps=spec.speed_mps,
        hull_yaw=(0.0, 0.0, 0.0, 0.0),
        hull_pitch=(0.0, 0.0, 0.0, 0.0),
    )
    body = small_signal.calibrate(body, np.array(spec.yaw), np.array(spec.pitch), spec.b1_per_s2)
    return Plant(
        name=name,
        body=body,
        rudder=spec.rudder,
        elevator=spec.elevator,
        sensors=spec.sensors,
        travel_rad=math.radians(spec.travel_deg),
        thrust_pct=spec.thrust_pct,
        trim=small_signal.trim(body),
    )
