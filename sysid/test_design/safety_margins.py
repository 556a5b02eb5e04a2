"""Largest excursions of a test over sampled vehicles, each with its own disturbance."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import bisect
from scipy.special import ndtr

from mavlink_io.errors import ErrorCode, OperationError
from sysid.control_analysis.loop_transfer import Gains
from sysid.data.runs import RATE_HZ
from sysid.estimation.map import steady_state
from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.models import greybox, noise
from sysid.models.noise import Noise
from sysid.models.parameters import MAX_DRAWS_PER_SAMPLE, CandidateVehicle, feasible_samples
from sysid.planes import PLANES, Plane
from sysid.test_design import closed_loop as loops
from sysid.test_design import prior as design_priors
from sysid.test_design.closed_loop import Loop
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import DEPTH_M, Manoeuvre, SimulatedLevelFlight, as_run, signal_rad

Array = NDArray[np.float64]

TRIM_SD_RAD = math.radians(0.15)
"""Standard deviation of a trim measured in flight (rad)."""
HELD_MOTION_SHARE = 0.3
"""Initial motion under the loops as a share of the one that the fit allows for."""
SETTLING_S = 40.0
"""Time (s) that is excluded from a simulation so that initial conditions decay."""
WATCHED_SAMPLES = 8
"""Number of samples for which surface rate and travel are checked."""
SHRINK = 0.95
"""Factor of size reduction per iteration."""
MAX_PROBABILITY = 0.01
"""Maximum probability that a test exceeds any excursion limit."""
MIN_SIZE_DEG = 0.1
"""Minimum size of a test (deg); below it, play and motor steps of the tailcone dominate."""


class ExcursionLimits(NamedTuple):
    """Limits of every test; depths are changes from its start."""

    heading_rad: float = math.radians(60.0)
    yaw_rate_radps: float = math.radians(10.0)
    pitch_rad: float = math.radians(15.0)
    pitch_rate_radps: float = math.radians(5.0)
    up_m: float = 2.0
    down_m: float = 2.0
    rate_limited: float = 0.15
    """Maximum share of a test in which the surface moves at its maximum rate."""
    stopped: float = 0.03
    """Maximum share of a test in which the surface is at a stop."""

    def motion(self, plane: Plane) -> tuple[float, float, float, float]:
        """Return the limits of rate (rad/s), angle (rad), and depth up and down (m) in a plane.

        Parameters
        ----------
        plane : Plane
            Yaw or pitch.

        Returns
        -------
        tuple of float
            The four limits; infinite where the plane has none.
        """
        return (
            (self.yaw_rate_radps, self.heading_rad, math.inf, math.inf),
            (self.pitch_rate_radps, self.pitch_rad, self.up_m, self.down_m),
        )[PLANES[plane].index]


HOLDING_LIMITS = ExcursionLimits(
    heading_rad=math.radians(20.0),
    yaw_rate_radps=math.radians(4.0),
    pitch_rad=math.radians(12.0),
    pitch_rate_radps=math.radians(3.0),
    up_m=1.0,
    down_m=1.0,
)
"""Limits within which a vehicle counts as held straight and level."""


class UnstableLoopError(OperationError):
    """The gains stabilise hardly any sampled vehicle; the message names the plane."""

    code = ErrorCode.UNSTABLE_LOOP


class VehicleSample(NamedTuple):
    """One vehicle sampled from the prior, with its disturbance motion.

    Motion is (steps, 3) at the fit's 10 Hz: rate (rad/s), angle (rad), depth (m).
    """

    vehicle: CandidateVehicle
    still: SimulatedLevelFlight
    loop: Loop
    free_motion: Array
    """Disturbance motion with the loop off."""
    held_motion: Array
    """Disturbance motion with the loop on."""
    command_2sd_rad: float
    """Two standard deviations of the surface command against the disturbance (rad)."""


class Excursion(NamedTuple):
    """Largest excursion of a test: 99 % of the samples stay within it."""

    angle_deg: float
    """Heading relative to the start, or pitch relative to the horizontal (deg)."""
    rate_degps: float
    depth_m: float
    """Change of depth (m); zero in yaw."""
    probability: float
    """Probability of exceeding the limits."""


def sample_vehicles(
    prior: DesignPrior, plane: Plane, gains: Gains, count: int, longest_s: float, seed: int
) -> list[VehicleSample]:
    """Sample vehicles and disturbances, the same for the same seed.

    Parameters
    ----------
    prior : DesignPrior
        Prior of the vehicle.
    plane : str
        yaw or pitch.
    gains : Gains
        Current gains of the loops.
    count : int
        Number of samples.
    longest_s : float
        Length of the disturbance motion (s).
    seed : int
        Seed of vehicles and disturbances.

    Returns
    -------
    list of VehicleSample
        Impossible vehicles and vehicles that the gains cannot hold are drawn again.

    Raises
    ------
    UnstableLoopError
        The gains hold hardly any vehicle.
    """
    streams = np.random.SeedSequence(seed).spawn(2)
    vehicle_rng, disturbance_rng = (np.random.default_rng(stream) for stream in streams)
    draws = vehicle_rng.standard_normal((MAX_DRAWS_PER_SAMPLE * count, prior.mean.size + 1))
    level = prior.noise[plane]
    samples = list[VehicleSample]()
    for index, _, vehicle in feasible_samples(
        prior.vehicle, prior.mean, prior.covariance, draws[:, :-1]
    ):
        trim_rad = TRIM_SD_RAD * draws[index, -1]
        loop = loops.of_vehicle(vehicle, plane, gains, level)
        held_motion, command_2sd_rad = _held_motion(loop, plane, longest_s, disturbance_rng)
        free_motion = _free_motion(vehicle, plane, level, longest_s, disturbance_rng)
        if _worst_share(plane, held_motion, HOLDING_LIMITS) < 1.0:
            trim = design_priors.level_flight(vehicle, plane)
            samples.append(
                VehicleSample(
                    vehicle=vehicle,
                    still=trim._replace(trim_rad=trim.trim_rad + trim_rad),
                    loop=loop,
                    free_motion=free_motion,
                    held_motion=held_motion,
                    command_2sd_rad=command_2sd_rad,
                )
            )
        if len(samples) == count:
            return samples
    raise UnstableLoopError(
        f"{plane}: the gains of the loops stabilise hardly any vehicle of the prior; set --gains"
    )


def _free_motion(
    vehicle: CandidateVehicle,
    plane: Plane,
    level: Noise,
    longest_s: float,
    rng: np.random.Generator,
) -> Array:
    """Return the disturbance motion after the loop is switched off, (steps, 3).

    x[k+1] = Phi x[k] + w[k] with the covariance Q of w from the noise model (Van Loan 1978).
    """
    linear = steady_state.linear_plane(vehicle, plane)
    A, density, _, _, P0 = noise.system(linear, level)
    transition, process = noise.discrete(A, density, STEP_S)
    spread = np.sqrt(np.diag(P0))
    spread[: len(linear.states)] *= HELD_MOTION_SHARE
    x = spread * rng.standard_normal(len(spread))
    kicks = rng.standard_normal((int(longest_s / STEP_S) + 1, len(spread))) @ noise.root(process).T
    motion = np.zeros((len(kicks), 3))
    n_outputs = len(linear.states) - 1
    for k in range(len(kicks)):
        motion[k, :n_outputs] = x[1 : 1 + n_outputs]
        x = transition @ x + kicks[k]
    return motion


def _held_motion(
    loop: Loop, plane: Plane, longest_s: float, rng: np.random.Generator
) -> tuple[Array, float]:
    """Return the disturbance motion with the loop on, and two standard deviations of command."""
    settling, ticks = int(SETTLING_S * RATE_HZ), int(longest_s * RATE_HZ) + 1
    kicks = rng.standard_normal((settling + ticks, loop.feedback.size))
    response = loops.simulate(loop, plane, np.zeros(len(kicks)), kicks)
    with np.errstate(over="ignore", invalid="ignore"):  # an unstable loop grows without limit
        command_2sd_rad = 2.0 * float(np.std(response.command_rad[settling:]))
    return response.motion[settling::STRIDE], command_2sd_rad


class TestResponse(NamedTuple):
    """Response of one sample to a test, (steps, 3): rate, angle and depth."""

    response: Array
    """Response to the test alone."""
    background: Array
    """Motion without the test."""


def excursion(
    plane: Plane, test_responses: Sequence[TestResponse], limits: ExcursionLimits
) -> Excursion:
    """Return the excursion of a test over all samples.

    The probability is that of a log-normal distribution fitted to the samples' largest share of a
    limit, and at least the share of samples beyond a limit.
    """
    tracks = [response + background for response, background in test_responses]
    peaks = np.quantile([np.max(np.abs(track), axis=0) for track in tracks], 0.99, axis=0)
    rate, angle = np.degrees(peaks[:2])
    return Excursion(
        angle_deg=float(angle),
        rate_degps=float(rate),
        depth_m=float(peaks[2]),
        probability=_risk(plane, tracks, limits),
    )


def responses(manoeuvre: Manoeuvre, samples: Sequence[VehicleSample]) -> list[TestResponse]:
    """Return the response of each sample to a manoeuvre."""
    return [
        _closed_loop_response(manoeuvre, sample)
        if manoeuvre.loop_on
        else _open_loop_response(manoeuvre, sample)
        for sample in samples
    ]


def _closed_loop_response(manoeuvre: Manoeuvre, sample: VehicleSample) -> TestResponse:
    """Return the linear response with the loop on."""
    answer = loops.simulate(sample.loop, manoeuvre.plane, signal_rad(manoeuvre)).motion[::STRIDE]
    level = np.array([0.0, sample.still.pitch_rad, 0.0])
    return TestResponse(answer, sample.held_motion[: len(answer)] + level)


def _open_loop_response(manoeuvre: Manoeuvre, sample: VehicleSample) -> TestResponse:
    """Return the nonlinear response with the loop off."""
    run = as_run(manoeuvre, sample.still, signal_rad(manoeuvre)).since(0.0)
    start = greybox.InitialMotion(
        rate_radps=0.0,
        angle_rad=sample.still.pitch_rad,
        depth_m=DEPTH_M,
        depth_rate_mps=0.0,
    )
    actuator = sample.vehicle.actuators[manoeuvre.plane]
    simulated = greybox.simulate(
        sample.vehicle.model, actuator, run, start, STRIDE, sample.still.speed_mps
    )
    depth_m = simulated.depth_m - start.depth_m
    track = np.column_stack([simulated.rate_radps, simulated.angle_rad, depth_m])
    return TestResponse(track - track[0], track[0] + sample.free_motion[: len(track)])


def _risk(plane: Plane, tracks: Sequence[Array], limits: ExcursionLimits) -> float:
    """Return the probability that a track exceeds a limit.

    With s the largest share of a limit over a track, taken as log-normal over the samples::

        P(s > 1) = Phi(mean(ln s) / sd(ln s))
    """
    shares = np.array([_worst_share(plane, track, limits) for track in tracks])
    logs = np.log(np.maximum(shares, 1e-9))
    beyond = float(ndtr(np.mean(logs) / max(float(np.std(logs)), 1e-9)))
    return max(beyond, float(np.mean(shares > 1.0)))


def _worst_share(plane: Plane, track: Array, limits: ExcursionLimits) -> float:
    """Return the largest excursion as a share of its limit."""
    rate, angle = np.max(np.abs(track[:, :2]), axis=0)
    down, up = max(0.0, float(np.max(track[:, 2]))), max(0.0, -float(np.min(track[:, 2])))
    motion = (rate, angle, up, down)
    return float(max(x / limit for x, limit in zip(motion, limits.motion(plane), strict=True)))


def _can_follow(
    manoeuvre: Manoeuvre,
    largest_deg: float,
    trim_offset_rad: float,
    samples: Sequence[VehicleSample],
    limits: ExcursionLimits,
) -> bool:
    """Return whether surface rate and travel suffice, in the median of the samples.

    With the loop on, the feedback is included. ``trim_offset_rad`` is a known trim: to the other
    side the surface has twice as much additional travel.
    """
    shares = np.array(
        [_shares(manoeuvre, largest_deg, trim_offset_rad, sample) for sample in samples]
    )
    return bool(np.all(np.median(shares, axis=0) <= (limits.rate_limited, limits.stopped)))


def _shares(
    manoeuvre: Manoeuvre, largest_deg: float, trim_offset_rad: float, sample: VehicleSample
) -> tuple[float, float]:
    """Return the shares of a test at maximum surface rate and at a stop."""
    actuator = sample.vehicle.actuators[manoeuvre.plane]
    command, busy_rad = signal_rad(manoeuvre), 0.0
    if manoeuvre.loop_on:
        command = loops.simulate(sample.loop, manoeuvre.plane, command).command_rad
        busy_rad = sample.command_2sd_rad
    duct_rate_radps = (
        np.abs(np.diff(greybox.duct_angles(command, actuator, 1.0 / RATE_HZ))) * RATE_HZ
    )
    at_stop = (
        np.abs(command + trim_offset_rad) + busy_rad
        > math.radians(largest_deg) + abs(trim_offset_rad) + 1e-9
    )
    return float(np.mean(duct_rate_radps > 0.99 * actuator.rate_radps)), float(np.mean(at_stop))


def max_size_within_limits(
    manoeuvre: Manoeuvre,
    largest_deg: float,
    samples: Sequence[VehicleSample],
    limits: ExcursionLimits,
    trim_offset_rad: float = 0.0,
) -> tuple[Manoeuvre, Excursion] | None:
    """Return the manoeuvre at its largest size within the limits, with its excursion.

    Parameters
    ----------
    manoeuvre : Manoeuvre
        Test at nominal size.
    largest_deg : float
        Travel of the surface from its trim to the nearer stop (deg).
    samples : Sequence of VehicleSample
        Sampled vehicles.
    limits : ExcursionLimits
        Limits.
    trim_offset_rad : float
        Known trim of the surface (rad).

    Returns
    -------
    tuple or None
        None if no size of at least `MIN_SIZE_DEG` stays within the limits.
    """
    test_responses = responses(manoeuvre, samples)
    size = min(
        largest_deg, manoeuvre.size_deg * _growth_factor(manoeuvre.plane, test_responses, limits)
    )
    while size >= MIN_SIZE_DEG:
        candidate = manoeuvre._replace(size_deg=round_down(size))
        if _can_follow(candidate, largest_deg, trim_offset_rad, samples[:WATCHED_SAMPLES], limits):
            found_excursion = excursion(
                candidate.plane,
                _responses_at_size(candidate, manoeuvre.size_deg, test_responses, samples),
                limits,
            )
            if found_excursion.probability <= MAX_PROBABILITY:
                return candidate, found_excursion
        size *= SHRINK
    return None


def _responses_at_size(
    manoeuvre: Manoeuvre,
    size_deg: float,
    test_responses: Sequence[TestResponse],
    samples: Sequence[VehicleSample],
) -> Sequence[TestResponse]:
    """Return the responses at a new size: simulated again with the loop off, scaled with it on."""
    if not manoeuvre.loop_on:
        return responses(manoeuvre, samples)
    factor = manoeuvre.size_deg / size_deg
    return [TestResponse(factor * response, background) for response, background in test_responses]


def _growth_factor(
    plane: Plane, test_responses: Sequence[TestResponse], limits: ExcursionLimits
) -> float:
    """Return the factor on the size at which the probability reaches its limit (linear scaling)."""

    def excess(log_factor: float) -> float:
        """Return the probability above its limit at a factor on the size."""
        factor = math.exp(log_factor)
        return (
            _risk(
                plane,
                [factor * response + background for response, background in test_responses],
                limits,
            )
            - MAX_PROBABILITY
        )

    min_log_factor, max_log_factor = math.log(1e-2), math.log(10.0)
    if excess(min_log_factor) > 0.0:
        return 0.0
    return math.exp(
        max_log_factor
        if excess(max_log_factor) <= 0.0
        else bisect(excess, min_log_factor, max_log_factor, xtol=0.02)
    )


def round_down(size_deg: float) -> float:
    """Round a size (deg) down to the resolution of a mission file."""
    return math.floor(size_deg * (20.0 if size_deg < 2.0 else 10.0) + 1e-9) / (
        20.0 if size_deg < 2.0 else 10.0
    )
