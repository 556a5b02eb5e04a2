"""Plants drawn at random, on the hull of a vehicle file that was written without seeing them.

Kind of forces, errors of the file, servo and sensors are drawn: what somebody has who measures a
hull, looks up no servo, and flies. All draws of a number are always the same.
"""

import math

import numpy as np
from numpy.typing import NDArray

from benchmarks.plants.actuators import FIRST_ORDER, SECOND_ORDER, SERVO, Axis
from benchmarks.plants.catalogue import Rows, Sensors, Specification
from sitl.vehicle.config import VehicleConfig
from sysid.estimation.map import steady_state
from sysid.models import linear_planes
from sysid.models.linear_planes import LinearPlane
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane

Array = NDArray[np.float64]

DAMPING_SD, COUPLING_SD, SHARE_SD = 0.15, 0.3, 0.25
"""Errors of the file: log ratios of the damping of sway and yaw and of the sway force by turning,
and error of the moment by drift over its value."""
EFFECT_SD, INERTIA_SD = 0.15, 0.1
"""Log ratios of the effect of the surface, and of inertias, righting moment and buoyancy."""
SERVO_RADPS, SERVO_RATE_DEGPS, SERVO_DELAY_S = (5.0, 25.0), (15.0, 120.0), (0.03, 0.2)
"""Ranges of bandwidth (log-uniform), rate limit (log-uniform) and delay."""
FLAW_DEG = 0.05, 0.4
"""Range of play or stiction (log-uniform); resolution and dead band are a quarter."""
DRAG_COEFFICIENT, CROSSFLOW_COEFFICIENT = 0.25, 0.9
"""Drag over dynamic pressure and frontal area, and crossflow drag over that and lateral area."""


def specification(
    kind: int, number: int, file: VehicleConfig, nominal: CandidateVehicle
) -> Specification:
    """Return a plant with forces of a kind on the hull of a vehicle file.

    Parameters
    ----------
    kind : int
        Kind of hydrodynamics, see ``benchmarks.plants.forces``.
    number : int
        Seed of the draws.
    file : VehicleConfig
        Vehicle file, whose values are wrong by the draws.
    nominal : CandidateVehicle
        The vehicle of the file.

    Returns
    -------
    Specification
        Plant for ``catalogue.assemble``.
    """
    draws = np.random.default_rng([number, 50_000 + kind])
    mass_matrix = nominal.model.inertia.M
    hydrostatics = nominal.model.hydrostatics
    length_m, width_m = 2.0 * hydrostatics.half_length_m, 2.0 * hydrostatics.radius_m
    speed_mps = file.operating_point.speed_mps
    half_density_kgpm3 = 0.5 * file.water.density_kgpm3
    pressure_pa = half_density_kgpm3 * speed_mps**2
    yaw, pitch = (steady_state.linear_plane(nominal, plane) for plane in Plane)
    # Lever of the surface: moment over side force, in the units of the state matrix.
    lever_m = abs(yaw.B[1] * mass_matrix[5, 5] / (yaw.B[0] * mass_matrix[1, 1]))
    across_kg = mass_matrix[1, 1] * _factor(draws, 0.07)
    inertia_kgm2 = mass_matrix[4, 4] * _factor(draws, INERTIA_SD)
    frontal_m2 = math.pi / 4.0 * width_m**2
    servo = _servo(draws)
    return Specification(
        kind=kind,
        length_m=length_m,
        mass_kg=nominal.model.inertia.mass_kg,
        m_kg=(float(mass_matrix[0, 0]), across_kg, across_kg * _factor(draws, 0.03)),
        j_kgm2=(float(mass_matrix[3, 3]), inertia_kgm2, inertia_kgm2 * _factor(draws, 0.03)),
        yaw=_rows(draws, yaw),
        pitch=_rows(draws, pitch),
        b1_per_s2=linear_planes.small_signal(yaw).b1_per_s2 * _factor(draws, EFFECT_SD),
        x_tail_m=-min(lever_m * _factor(draws, 0.05), 0.5 * length_m),
        restoring_per_s2=linear_planes.small_signal(pitch).restoring_per_s2
        * _factor(draws, INERTIA_SD),
        net_buoyancy_n=file.ballast.net_buoyancy_n * _factor(draws, INERTIA_SD),
        stall_rad=math.radians(draws.uniform(15.0, 22.0)),
        crossflow_kgpm=CROSSFLOW_COEFFICIENT
        * half_density_kgpm3
        * length_m
        * width_m
        * _factor(draws, 0.25),
        turn_drag=_factor(draws, 0.25),
        thrust_n=DRAG_COEFFICIENT * pressure_pa * frontal_m2 * _factor(draws, 0.2),
        speed_mps=speed_mps,
        rudder=servo._replace(bias_rad=math.radians(2.0 * draws.standard_normal())),
        elevator=servo._replace(bias_rad=math.radians(draws.standard_normal())),
        sensors=_sensors(draws),
        travel_deg=file.tailcone.travel_deg,
        thrust_pct=100.0 * file.operating_point.thrust_fraction,
    )


def _factor(draws: np.random.Generator, sd: float) -> float:
    """Return a log-normal factor."""
    return math.exp(sd * float(draws.standard_normal()))


def _between(draws: np.random.Generator, limits: tuple[float, float]) -> float:
    """Return a log-uniform value."""
    low, high = limits
    return math.exp(draws.uniform(math.log(low), math.log(high)))


def _rows(draws: np.random.Generator, plane: LinearPlane) -> Rows:
    """Return the block of cross velocity and rate of the state matrix, with errors."""
    (a, b), (c, d) = plane.A[:2, :2].tolist()
    return (
        (a * _factor(draws, DAMPING_SD), b * _factor(draws, COUPLING_SD)),
        (c + SHARE_SD * abs(c) * draws.standard_normal(), d * _factor(draws, DAMPING_SD)),
    )


def _servo(draws: np.random.Generator) -> Axis:
    """Return the drive of both surfaces: kind, bandwidth, delay, rate limit and flaw."""
    kind = int(draws.choice([SECOND_ORDER, FIRST_ORDER, SERVO]))
    flaw_rad = math.radians(_between(draws, FLAW_DEG))
    axis = Axis(
        kind,
        delay_s=draws.uniform(*SERVO_DELAY_S),
        omega_radps=_between(draws, SERVO_RADPS),
        damping=draws.uniform(0.5, 1.0),
        rate_radps=math.radians(_between(draws, SERVO_RATE_DEGPS)),
        bias_rad=0.0,
    )
    if kind == SECOND_ORDER:
        return axis._replace(play_rad=flaw_rad)
    if kind == FIRST_ORDER:
        return axis._replace(breakaway_rad=flaw_rad, lift_lag_s=draws.uniform(0.0, 0.06))
    return axis._replace(step_rad=0.25 * flaw_rad, dead_rad=0.25 * flaw_rad)


def _sensors(draws: np.random.Generator) -> Sensors:
    """Return the errors of sensors and recorder; half of the vehicles have a Doppler log."""
    return Sensors(
        rate_hz=float(draws.choice([20.0, 25.0, 50.0])),
        jitter_s=draws.uniform(0.0, 0.005),
        dropped=draws.uniform(0.0, 0.03),
        gyro_lag_s=draws.uniform(0.0, 0.05),
        angle_lag_s=draws.uniform(0.0, 0.06),
        depth_lag_s=draws.uniform(0.05, 0.25),
        speed_noise_mps=0.02 if draws.random() < 0.5 else 0.0,
    )
