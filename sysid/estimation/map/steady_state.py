"""Steady motion of a candidate vehicle: cruise speed for a thrust, trim and level flight."""

import bisect
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve

from sitl.vehicle import hull
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.model import VehicleModel
from sysid.data.runs import Run
from sysid.models import greybox, linear_planes, parameters
from sysid.models.linear_planes import LinearPlane
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

RATE = 2
"""Index of the yaw rate in the motion of `greybox.integrate`."""
MIN_SPEED_MPS, MAX_SPEED_MPS = 0.1, 10.0
"""Range in which the cruise speed is sought, m/s."""
TURN_LENGTHS, TURN_STEP_S = 60.0, 0.01
"""Length of a simulated turn until it is steady, in hull lengths at operating speed, and its
integration step."""
CONTROLLED_SHARE = 0.5
"""Share of the yaw rate from which the opposite rudder can still end a turn. The turn goes on while
the tailcone changes sides: with 15 deg of travel, 30 deg/s and 0.3 s of delay and lag for 0.8 s."""


def cruise_speed_mps(vehicle: CandidateVehicle, thrust: float) -> float:
    """Return the steady straight speed for a thrust: the root of the surge equation.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    thrust : float
        Fraction of full shaft speed, 0 to 1.

    Returns
    -------
    float
        Speed, m/s, at least MIN_SPEED_MPS.
    """
    model, rps = vehicle.model, thrust * vehicle.model.propeller.full_rps
    inverse = greybox.constraint(model, Plane.YAW)

    def surge(u: float) -> float:
        state = np.array([u, 0.0, 0.0, 0.0, 0.0])
        return float(greybox.accelerations(model, Plane.YAW, state, 0.0, rps, inverse)[0])

    if surge(MIN_SPEED_MPS) <= 0.0:
        return MIN_SPEED_MPS
    return float(brentq(surge, MIN_SPEED_MPS, MAX_SPEED_MPS, xtol=1e-9))


class LevelFlight(NamedTuple):
    """Straight flight at constant depth and cruise thrust, in the paper's axes."""

    speed_mps: float
    heave_mps: float
    pitch_rad: float
    elevator_rad: float


def level_flight(vehicle: CandidateVehicle) -> LevelFlight:
    """Return the straight flight at constant depth with the thrust of the operating point.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.

    Returns
    -------
    LevelFlight
        Straight flight without heave and pitch if no such flight is found.
    """
    model, point = vehicle.model, vehicle.config.operating_point
    rps = point.thrust_fraction * model.propeller.full_rps
    inverse = greybox.constraint(model, Plane.PITCH)
    x, inputs = np.zeros(5), np.zeros(1 + greybox.N_COUPLING)
    x[0], x[4] = point.speed_mps, greybox.SUBMERGED_Z_M
    if greybox.find_level_flight(x, inputs, rps, inverse, model):
        return LevelFlight(float(x[0]), float(x[1]), float(x[3]), float(inputs[0]))
    return LevelFlight(point.speed_mps, 0.0, 0.0, 0.0)


class SteadyTurn(NamedTuple):
    """Turn in the horizontal plane with a constant rudder angle."""

    speed_mps: float
    rate_radps: float
    """Yaw rate, without sign."""
    controlled_radps: float
    """Largest yaw rate at which the rudder controls the vehicle: CONTROLLED_SHARE of the largest
    one, while the turn develops, that the opposite rudder ends. Infinite if that ends the steady
    turn; a hull that is unstable in yaw can turn on against its rudder."""

    @property
    def radius_m(self) -> float:
        """Radius of the path of the vehicle."""
        return self.speed_mps / self.rate_radps

    @property
    def reference_radps(self) -> float:
        """Largest yaw rate that a heading reference may ask of the rudder."""
        return min(self.rate_radps, self.controlled_radps)


def steady_turn(config: VehicleConfig, model: VehicleModel, rudder_rad: float) -> SteadyTurn:
    """Return the steady turn with a rudder angle and the thrust of the operating point.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle file.
    model : VehicleModel
        Model built from it.
    rudder_rad : float
        Rudder angle (rad).

    Returns
    -------
    SteadyTurn
        Speed and yaw rate after TURN_LENGTHS hull lengths, and the rate that is controlled.
    """
    point = config.operating_point
    turn_s = TURN_LENGTHS * hull.length_m(config.hull) / point.speed_mps
    samples = math.ceil(turn_s / TURN_STEP_S) + 1

    def turn(start: Array, angle_rad: float) -> Array:
        """Return the motion that begins with a motion and a rudder angle."""
        return greybox.integrate(
            start,
            np.full(samples, angle_rad),
            np.full(samples, point.thrust_fraction * model.propeller.full_rps),
            1,
            TURN_STEP_S,
            True,
            greybox.constraint(model, Plane.YAW),
            model,
            np.zeros((samples, greybox.N_COUPLING)),
        )

    motion = turn(np.array([point.speed_mps, 0.0, 0.0, 0.0, 0.0]), rudder_rad)
    u, v, rate, *_ = motion[-1]

    def goes_on(row: int) -> bool:
        """Return whether the turn goes on if the rudder changes sides at a time."""
        return bool(turn(motion[row], -rudder_rad)[-1, RATE] * rate > 0.0)

    controlled_radps = math.inf
    if goes_on(samples - 1):
        first = bisect.bisect_left(range(samples - 1), True, key=goes_on)
        controlled_radps = CONTROLLED_SHARE * abs(float(motion[first, RATE]))
    return SteadyTurn(math.hypot(u, v), abs(float(rate)), controlled_radps)


def linear_plane(vehicle: CandidateVehicle, plane: Plane) -> LinearPlane:
    """Return the small-signal model of one plane of a vehicle in level flight.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    plane : Plane
        Plane.

    Returns
    -------
    LinearPlane
        State-space model in MAVLink's axes.

    Notes
    -----
    Central differences of the nonlinear model. A vehicle that is not neutrally buoyant flies with
    heave, so that its quadratic crossflow drag damps small motion too.
    """
    model, trim, is_yaw = vehicle.model, level_flight(vehicle), PLANES[plane].is_yaw
    rps = vehicle.config.operating_point.thrust_fraction * model.propeller.full_rps
    x, inputs = np.zeros(5), np.zeros(1 + greybox.N_COUPLING)
    x[0], x[4] = trim.speed_mps, greybox.SUBMERGED_Z_M
    if is_yaw:
        inputs[1], inputs[3], inputs[6] = trim.heave_mps, trim.pitch_rad, trim.elevator_rad
    else:
        x[1], x[3], inputs[0] = trim.heave_mps, trim.pitch_rad, trim.elevator_rad
    inverse = greybox.constraint(model, plane)
    slopes = greybox.slopes_about(x, inputs, rps, is_yaw, inverse, model)[1]
    size = 3 if is_yaw else 4
    A, B = np.zeros((size, size)), np.zeros(size)
    # From FLU to FRD every state changes its sign and the surface angle does not. Heading and
    # pitch rate are r and q for small motion.
    A[:2, :2], B[:2] = slopes[1:3, 1:3], -slopes[1:3, 5]
    A[2, 1] = 1.0
    if not is_yaw:
        A[:2, 2] = slopes[1:3, 3]
        A[3, 0], A[3, 2] = 1.0, -trim.speed_mps
    moment = np.eye(size)[1]
    return LinearPlane(A=A, B=B, states=PLANES[plane].states, moment=moment)


def straight_plane(vehicle: CandidateVehicle, plane: Plane) -> LinearPlane:
    """Return the small-signal model of one plane without heave, from the linear coefficients.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle with its linear coefficients.
    plane : Plane
        Plane.

    Returns
    -------
    LinearPlane
        State-space model in MAVLink's axes.
    """
    config = vehicle.config
    return linear_planes.linear_plane(
        plane,
        parameters.to_table_1_column(config.linear),
        config.operating_point.speed_mps,
        config.ballast.mass_kg,
        config.water.gravity_mps2,
    )


def trim_biases(
    config: VehicleConfig, model: VehicleModel, runs: Sequence[Run]
) -> dict[Plane, float]:
    """Estimate the actuator biases at which the prior vehicle is in trim like the measured one.

    Before each test the loops hold the vehicle straight and level. The median over the runs of the
    mean command, plus the bias, equals the trim angle of the prior vehicle (zero for the rudder).

    Parameters
    ----------
    config : VehicleConfig
        Prior vehicle.
    model : VehicleModel
        Its nonlinear model.
    runs : sequence of Run
        Runs with their pre-rolls.

    Returns
    -------
    dict
        Bias of each plane's actuator, rad.
    """
    level_rad = level_elevator_rad(config, model)
    commands = {plane: _median_command_rad(runs, plane) for plane in Plane}
    return {Plane.YAW: -commands[Plane.YAW], Plane.PITCH: level_rad - commands[Plane.PITCH]}


def _median_command_rad(runs: Sequence[Run], plane: Plane) -> float:
    """Return the median over the runs of the mean command of a surface in the pre-roll, rad."""
    means = [
        float(np.mean(run.in_plane(plane).command_rad[run.preroll]))
        for run in runs
        if run.preroll.any()
    ]
    return float(np.median(means)) if means else 0.0


def level_surface_rad(vehicle: CandidateVehicle, plane: Plane) -> float:
    """Return the angle (rad) of a plane's surface in straight level flight: zero in yaw."""
    if PLANES[plane].is_yaw:
        return 0.0
    return level_elevator_rad(vehicle.config, vehicle.model)


def level_elevator_rad(config: VehicleConfig, model: VehicleModel) -> float:
    """Return the elevator angle (rad) of straight flight at constant depth.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle with its operating point (speed and thrust).
    model : VehicleModel
        Its nonlinear model.

    Returns
    -------
    float
        Duct angle, rad, at which heave force and pitch moment vanish.
    """
    return float(_level_flight(config, model)[1])


def level_pitch_rad(config: VehicleConfig, model: VehicleModel) -> float:
    """Return the pitch angle (rad, positive nose up) of straight flight at constant depth.

    Parameters
    ----------
    config : VehicleConfig
        Vehicle with its operating point (speed and thrust).
    model : VehicleModel
        Its nonlinear model.

    Returns
    -------
    float
        Pitch, rad, at which heave force and pitch moment vanish.
    """
    return float(_level_flight(config, model)[0])


def _level_flight(config: VehicleConfig, model: VehicleModel) -> Array:
    """Return pitch (nose up) and elevator of level flight, rad: no heave force, no pitch moment."""
    speed = config.operating_point.speed_mps
    rps = config.operating_point.thrust_fraction * model.propeller.full_rps

    def imbalance(angles: Array) -> Array:
        """Return heave (m/s2) and pitch (rad/s2) acceleration at (-theta, elevator), rad."""
        theta, elevator = -float(angles[0]), float(angles[1])
        u, w = speed * math.cos(theta), speed * math.sin(theta)
        state = np.array([u, w, 0.0, theta, greybox.SUBMERGED_Z_M])
        return greybox.accelerations(model, Plane.PITCH, state, elevator, rps)[1:]

    # With full output it does not warn where a candidate cannot fly level: the last angles count.
    angles, *_ = fsolve(imbalance, np.zeros(2), xtol=1e-12, full_output=True)
    return np.asarray(angles)
