"""Grey-box model of one plane, driven by logged commands: the model that identification fits.

Forces come from ``sitl.vehicle``; only the motion is restricted to a plane, so a run is simulated
without the drift of the other plane. States, in the paper's FLU axes (y port, z up):

    yaw:    (u, v, r, psi, -)     m/s, m/s, rad/s, rad
    pitch:  (u, w, q, theta, z)   m/s, m/s, rad/s, rad (positive nose down), m (positive up)

Equations: M_p (u', v' or w', rate')^T = sum of forces in the plane, with M_p the 3 x 3 block of
M_RB + M_A that belongs to the plane (Fossen 2021; ``sitl.vehicle.dynamics``), and Euler kinematics

    psi' = (q sin phi + r cos phi) / cos theta,   theta' = q cos phi - r sin phi,
    z' = R^T z . (u, v, w).

Inputs and outputs of the module are in MAVLink's axes (FRD, NED): the signs of v, w, rates, angles
and depth are opposite. Surface angles have the same sign in both: positive rudder turns the nose to
starboard, positive elevator turns it up.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import entry_point, kernel
from sitl.core import tailcone
from sitl.core.tailcone import TailconeAxis
from sitl.vehicle import forces, runge_kutta
from sitl.vehicle.forces import HullFlow, TailInputs
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.runge_kutta import STAGES
from sitl.vehicle.vectors import Wrench
from sysid.data.runs import RATE_HZ, Run
from sysid.planes import PLANES, Plane
from sysid.signal_processing import fit_line

Array = NDArray[np.float64]

SUBMERGED_Z_M = -50.0
"""Height of the simulated vehicle, deep enough that the surface has no effect."""
N_COUPLING = 7
"""Number of known inputs besides the surface.

They are the other plane's cross speed, rate and pitch, roll rate, roll, and the angle of the other
surface, in the paper's axes, and the measured forward speed (m/s); 0 if it is not measured."""
SPEED = 6
"""Index of the measured speed."""
LINEARISATION_STEP = 1e-5
"""Step of the central differences of a linearisation (m/s, rad/s, rad)."""
SETTLING_S = 0.5
"""Duration at the start of a run over which measured initial values are averaged."""

MAX_TRIM_STEPS, MAX_TRIM_CHANGE, TRIM_TOLERANCE = 20, 0.3, 1e-10
"""Newton's method for level flight: steps, largest change per step and last change (m/s, rad)."""


class Actuator(NamedTuple):
    """One tailcone axis: travel limit, delay, second-order lag, rate limit, backlash, bias."""

    delay_s: float
    """Transport delay from command to motor."""
    natural_frequency_radps: float
    damping_ratio: float
    """Damping ratio; less than 1."""
    bias_rad: float
    """Duct angle at a command of zero."""
    travel_rad: float
    """Limit of the command and of the motor angle."""
    rate_radps: float
    """Rate limit of the motor."""
    backlash_rad: float = 0.0
    """Backlash between motor and duct, full width."""


class InitialMotion(NamedTuple):
    """Measured motion at the first sample, in MAVLink's axes."""

    rate_radps: float
    """Yaw or pitch rate."""
    angle_rad: float
    """Heading or pitch."""
    depth_m: float
    depth_rate_mps: float


class PlaneTrajectory(NamedTuple):
    """Simulated run in MAVLink's axes, one row per ``stride`` samples of the run's grid."""

    rate_radps: Array
    """Yaw or pitch rate."""
    angle_rad: Array
    """Heading (unwrapped) or pitch."""
    depth_m: Array
    speed_mps: Array
    """Forward speed u through the water."""


def discretise(actuator: Actuator, dt: float) -> TailconeAxis:
    """Return the axis as the simulator integrates it, with a continuous motor."""
    return tailcone.discretise(
        natural_frequency_radps=actuator.natural_frequency_radps,
        damping=actuator.damping_ratio,
        delay_s=actuator.delay_s,
        travel_rad=actuator.travel_rad,
        rate_limit_radps=actuator.rate_radps,
        bias_rad=actuator.bias_rad,
        substep_s=dt,
        backlash_rad=actuator.backlash_rad,
    )


def duct_angles(command: Array, actuator: Actuator, dt: float) -> Array:
    """Return the true duct angle (rad) at every sample of a zero-order-hold command (rad)."""
    return tailcone.respond(discretise(actuator, dt), command)


def duct_along(run: Run, surface: Plane, actuator: Actuator) -> Array:
    """Return the true angle (rad) of a plane's surface at every sample of a run, (samples,)."""
    return duct_angles(run.history_rad(surface), actuator, 1.0 / RATE_HZ)[-run.time_s.size :]


@kernel
def plane_slopes(
    x: Array,
    duct_rad: float,
    coupling: Array,
    rps: float,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    out: Array,
) -> None:
    """Write the derivative of (u, v, r, psi, -) or (u, w, q, theta, z) into ``out``.

    The water is deep and still, the axes are the paper's. ``coupling`` holds the cross-plane
    inputs: the other plane's cross speed, rate and pitch (0 where pitch is a state), roll rate,
    roll, the angle of the other surface, and the measured speed. ``inverse`` is from
    ``constraint``.
    """
    flow, tail = flow_and_tail(x, duct_rad, coupling, rps, is_yaw, model)
    wrench = forces.total(flow, tail, model)
    accelerate(flow, wrench, coupling, is_yaw, inverse, out)


@kernel
def flow_and_tail(
    x: Array, duct_rad: float, coupling: Array, rps: float, is_yaw: bool, model: VehicleModel
) -> tuple[HullFlow, TailInputs]:
    """Return the motion through deep water and the inputs of the tail; see ``plane_slopes``."""
    # A measured speed replaces the state u. R^T z = (-sin theta, sin phi cos theta,
    # cos phi cos theta).
    u, p, roll = (coupling[SPEED] if coupling[SPEED] > 0.0 else x[0]), coupling[3], coupling[4]
    if is_yaw:
        v, r, w, q = x[1], x[2], coupling[0], coupling[1]
        theta, rudder, elevator = coupling[2], duct_rad, coupling[5]
    else:
        w, q, v, r = x[1], x[2], coupling[0], coupling[1]
        theta, rudder, elevator = x[3], coupling[5], duct_rad
    level = math.cos(theta)
    up = (-math.sin(theta), math.sin(roll) * level, math.cos(roll) * level)
    nu = (u, v, w, p, q, r)
    flow = HullFlow(
        nu=nu,
        nu_flow=nu,
        up=up,
        height_m=SUBMERGED_Z_M,
        climb=up[0],
        density_ratio=1.0,
        boundary=forces.NO_WRENCH,
    )
    return flow, forces.tail_inputs(rudder, elevator, rps, model)


@kernel
def accelerate(
    flow: HullFlow, wrench: Wrench, coupling: Array, is_yaw: bool, inverse: Array, out: Array
) -> None:
    """Write the derivative under the sum of forces ``wrench``; see ``plane_slopes``."""
    # (u', cross', rate') = M_p^-1 (X, side, moment), with the components in the plane of the sum of
    # forces in ``sitl.vehicle.forces`` (N, N m, FLU); kinematics: module docstring.
    u, v, w, _, q, r = flow.nu
    up, roll = flow.up, coupling[4]
    X, Y, Z, _, M, N = wrench
    if is_yaw:
        side, moment = Y, N
        out[3] = (q * math.sin(roll) + r * math.cos(roll)) / math.cos(coupling[2])
        out[4] = 0.0
    else:
        side, moment = Z, M
        out[3] = q * math.cos(roll) - r * math.sin(roll)
        out[4] = up[0] * u + up[1] * v + up[2] * w
    for k in range(3):
        out[k] = inverse[k, 0] * X + inverse[k, 1] * side + inverse[k, 2] * moment
    if coupling[SPEED] > 0.0:
        out[0] = 0.0


@kernel
def integrate(
    x0: Array,
    duct: Array,
    rps: Array,
    stride: int,
    dt: float,
    is_yaw: bool,
    inverse: Array,
    model: VehicleModel,
    coupling: Array | None = None,
) -> Array:
    """Integrate one plane with classical Runge-Kutta; return rows (u, v|w, rate, angle, z).

    One step covers ``stride`` samples of ``dt`` seconds. ``duct`` (rad) and ``rps`` (rev/s) are
    sampled at ``dt``; ``inverse`` is from ``constraint``; ``coupling`` has shape
    (samples, N_COUPLING) and is zero if left out.
    """
    # Stages at 0, h/2, h/2 and h, h = dt stride. At a half step between two samples the inputs are
    # the mean of the two (indices early and late).
    rows = (duct.size - 1) // stride + 1
    track = np.empty((rows, 5))
    slopes, stage_state, inputs = np.empty((STAGES, 5)), np.empty(5), np.zeros(N_COUPLING)
    track[0] = x0
    h = dt * stride
    for row in range(1, rows):
        first = (row - 1) * stride
        for stage in range(STAGES):
            early, late = runge_kutta.samples_at(stage, first, stride)
            if coupling is not None:
                for i in range(N_COUPLING):
                    inputs[i] = 0.5 * (coupling[early, i] + coupling[late, i])
            runge_kutta.stage_state(stage, track[row - 1], slopes, h, stage_state)
            plane_slopes(
                stage_state,
                0.5 * (duct[early] + duct[late]),
                inputs,
                rps[first],
                is_yaw,
                inverse,
                model,
                slopes[stage],
            )
        runge_kutta.combine(track[row - 1], slopes, h, track[row])
    return track


@kernel
def slopes_about(
    x: Array, inputs: Array, rps: float, is_yaw: bool, inverse: Array, model: VehicleModel
) -> tuple[Array, Array]:
    """Return the derivative (5,) of the state, and its slopes (5, 6) by the state and the surface.

    ``inputs`` holds the surface angle and then the known inputs; the slopes are central
    differences.
    """
    base, up, down = np.empty(5), np.empty(5), np.empty(5)
    out = np.empty((5, 6))
    moved = x.copy()
    plane_slopes(x, inputs[0], inputs[1:], rps, is_yaw, inverse, model, base)
    for i in range(6):
        for sign in (1.0, -1.0):
            duct = inputs[0] + sign * LINEARISATION_STEP if i == 5 else inputs[0]
            if i < 5:
                moved[i] = x[i] + sign * LINEARISATION_STEP
            result = up if sign > 0.0 else down
            plane_slopes(moved, duct, inputs[1:], rps, is_yaw, inverse, model, result)
            if i < 5:
                moved[i] = x[i]
        for k in range(5):
            out[k, i] = (up[k] - down[k]) / (2.0 * LINEARISATION_STEP)
    return base, out


@entry_point
def find_level_flight(
    x: Array, inputs: Array, rps: float, inverse: Array, model: VehicleModel
) -> bool:
    """Move ``x`` and ``inputs`` to straight flight at constant depth; return whether it is found.

    Newton's method on (u', w', q', z') changes speed, heave and pitch of the pitch plane's state
    ``x`` and the elevator ``inputs[0]``. Arguments as for ``slopes_about``.
    """
    residuals, unknowns = (0, 1, 2, 4), (0, 1, 3, 5)
    system, offset = np.empty((4, 4)), np.empty(4)
    for _ in range(MAX_TRIM_STEPS):
        base, slopes = slopes_about(x, inputs, rps, False, inverse, model)
        for i in range(4):
            offset[i] = base[residuals[i]]
            for j in range(4):
                system[i, j] = slopes[residuals[i], unknowns[j]]
        if not solve_in_place(system, offset):
            return False
        converged = True
        for i in range(4):
            change = min(max(-offset[i], -MAX_TRIM_CHANGE), MAX_TRIM_CHANGE)
            converged = converged and abs(change) < TRIM_TOLERANCE
            if i < 3:
                x[unknowns[i]] += change
            else:
                inputs[0] += change
        if converged:
            return True
    return False


@kernel
def solve_in_place(A: Array, b: Array) -> bool:
    """Replace ``b`` by A^-1 b, and ``A`` by its factors; return False for a singular matrix.

    Gaussian elimination with partial pivoting.
    """
    n = b.size
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if not abs(A[pivot, k]) > 0.0:
            return False
        for j in range(k, n):
            A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
        b[k], b[pivot] = b[pivot], b[k]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            b[i] -= factor * b[k]
            for j in range(k, n):
                A[i, j] -= factor * A[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return True


def constraint(model: VehicleModel, plane: Plane) -> Array:
    """Return M_p^-1, shape (3, 3): from forces in the plane to accelerations."""
    return _inverse_of_block(model.inertia.M, PLANES[plane].velocities)


@entry_point
def _inverse_of_block(M: Array, rows: tuple[int, int, int]) -> Array:
    """Return the inverse, shape (3, 3), of the block of ``M`` in these rows and columns.

    Cramer's rule: element (j, i) is the cofactor of (i, j) over the determinant.
    """
    inverse, determinant = np.empty((3, 3)), 0.0
    for i in range(3):
        i1, i2 = rows[(i + 1) % 3], rows[(i + 2) % 3]
        for j in range(3):
            j1, j2 = rows[(j + 1) % 3], rows[(j + 2) % 3]
            inverse[j, i] = M[i1, j1] * M[i2, j2] - M[i1, j2] * M[i2, j1]
    for j in range(3):
        determinant += M[rows[0], rows[j]] * inverse[j, 0]
    return inverse / determinant


def accelerations(
    model: VehicleModel,
    plane: Plane,
    state: Array,
    duct_rad: float,
    rps: float,
    inverse: Array | None = None,
) -> Array:
    """Return (u', v' or w', rate') at the state (u, v|w, rate, angle, z), paper's axes.

    ``inverse`` is from ``constraint``, for a caller that needs many states of one model.
    """
    out = np.empty(5)
    plane_slopes(
        state,
        duct_rad,
        np.zeros(N_COUPLING),
        rps,
        PLANES[plane].is_yaw,
        constraint(model, plane) if inverse is None else inverse,
        model,
        out,
    )
    return out[:3]


def initial_motion(run: Run) -> InitialMotion:
    """Return the measured initial motion of a run; rates are averaged over SETTLING_S."""
    settling_samples = max(2, int(SETTLING_S * RATE_HZ))
    start = slice(2 * settling_samples)
    return InitialMotion(
        rate_radps=float(np.mean(run.rate_radps[:settling_samples])),
        angle_rad=float(run.angle_rad[0]),
        depth_m=float(run.depth_m[0]),
        depth_rate_mps=fit_line(run.time_s[start], run.depth_m[start]).slope,
    )


def first_state(run: Run, start: InitialMotion, speed_mps: float) -> Array:
    """Return the state (u, v|w, rate, angle, z) at the run's first sample, paper's axes."""
    # Pitch: heave follows from depth' = w cos(theta) - U sin(theta) in FRD.
    if PLANES[run.plane].is_yaw:
        return np.array([speed_mps, 0.0, -start.rate_radps, -start.angle_rad, SUBMERGED_Z_M])
    theta = start.angle_rad
    w_frd = (start.depth_rate_mps + speed_mps * math.sin(theta)) / math.cos(theta)
    return np.array([speed_mps, -w_frd, -start.rate_radps, -theta, SUBMERGED_Z_M])


def known_inputs(run: Run, speed_mps: float) -> Array:
    """Return the known inputs (samples, N_COUPLING) of a test; zero if there are none.

    A vehicle that is not neutrally buoyant keeps depth with a pitch angle and a heave velocity. The
    crossflow drag is quadratic in the total crossflow, so heave also damps sway: an input of a yaw
    test. In a pitch test the heading loop keeps the vehicle straight, and sway is not measured.

    The measured speed is used relative to that before the test, times the cruise speed of the
    model: this leaves out the scale of the sensor and a steady current.
    """
    # Heave from pitch and depth (FRD): depth' = w cos(theta) - U sin(theta).
    ratio = run.relative_speed
    speed = 0.0 * run.time_s if ratio is None else speed_mps * ratio
    if not PLANES[run.plane].is_yaw:
        still = np.zeros(run.time_s.size)
        return np.column_stack([*(still,) * (N_COUPLING - 1), speed])
    slow = run.slow_motion
    theta, q = slow.pitch_rad, slow.q_radps
    along = speed_mps if ratio is None else speed
    heave = (slow.depth_rate_mps + along * np.sin(theta)) / np.cos(theta)
    return np.column_stack([-heave, -q, -theta, 0.0 * q, slow.roll_rad, 0.0 * q, speed])


def simulate(
    model: VehicleModel,
    actuator: Actuator,
    run: Run,
    start: InitialMotion,
    stride: int,
    speed_mps: float,
    coupling: Array | None = None,
) -> PlaneTrajectory:
    """Simulate a run from ``start`` under the commands of the run.

    One integration step covers ``stride`` samples: 1 for plots (20 ms), 5 for fitting (0.1 s).
    ``coupling`` holds the cross-plane inputs; the default is ``known_inputs``, for a test with
    the loop of the other plane closed.
    """
    coupling = known_inputs(run, speed_mps) if coupling is None else coupling
    x0 = first_state(run, start, speed_mps)
    angles = duct_along(run, run.plane, actuator)
    rps, inverse = run.thrust * model.propeller.full_rps, constraint(model, run.plane)
    track = integrate(
        x0, angles, rps, stride, 1.0 / RATE_HZ, PLANES[run.plane].is_yaw, inverse, model, coupling
    )
    return to_mavlink_axes(track, start)


def to_mavlink_axes(track: Array, start: InitialMotion) -> PlaneTrajectory:
    """Return a track of states in MAVLink's axes, with depth relative to the start of the run."""
    return PlaneTrajectory(
        rate_radps=-track[:, 2],
        angle_rad=-track[:, 3],
        depth_m=start.depth_m - (track[:, 4] - SUBMERGED_Z_M),
        speed_mps=track[:, 0],
    )
