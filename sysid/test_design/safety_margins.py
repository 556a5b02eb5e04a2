"""How far a test takes the vehicle: candidates drawn from the belief, each flown in a sea of her
own."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import bisect
from scipy.special import ndtr

from sysid.control_analysis.loop_transfer import Gains
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map import fit
from sysid.models import greybox, noise
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle, feasible_samples
from sysid.test_design import closed_loop as loops
from sysid.test_design import prior as beliefs
from sysid.test_design.closed_loop import Loop
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import LevelFlight, Manoeuvre, as_run, signal_rad

Array = NDArray[np.float64]

DT = fit.STRIDE / RATE_HZ
TRIM_SD_RAD = math.radians(0.15)
"""How well a trim flight tells the trim (one standard deviation)."""
HELD_MOTION_SHARE = 0.3
"""A vehicle whose loops held her starts this much steadier than what the fit must be ready for."""
SETTLING_S = 40.0
"""In which the loop forgets how a simulation began."""
WATCHED_SAMPLES = 8
"""Samples whose surface is watched."""
SHRINK = 0.95
MIN_SIZE_DEG = 0.1
"""Tests below this drown in the tailcone's play and motor steps."""


class ExcursionLimits(NamedTuple):
    """What no test may exceed. Depths are changes from where it began."""

    heading_rad: float = math.radians(60.0)
    yaw_rate_radps: float = math.radians(10.0)
    pitch_rad: float = math.radians(15.0)
    pitch_rate_radps: float = math.radians(5.0)
    up_m: float = 2.0
    down_m: float = 2.0
    rate_limited: float = 0.15
    """Share of a test in which the surface may run at its greatest rate."""
    stopped: float = 0.03
    """Share in which it may stand at its stops."""
    probability: float = 0.01
    """That a test leaves any of the excursions."""


HOLDING_LIMITS = ExcursionLimits(
    math.radians(20.0), math.radians(4.0), math.radians(12.0), math.radians(3.0), 1.0, 1.0
)
"""Within these a vehicle is held straight and level."""
MAX_DRAWS_PER_SAMPLE = 10
"""For every sample that is wanted."""


class UnstableLoopError(ValueError):
    """Gains under which the vehicle cannot be imagined to fly; the message says in which plane."""


class VehicleSample(NamedTuple):
    """One vehicle that the belief allows, and the sea that she meets: (steps, 3) at the fit's 10 Hz
    of rate, angle and depth."""

    vehicle: CandidateVehicle
    still: LevelFlight
    loop: Loop
    free: Array
    """With the loop off."""
    held: Array
    """With the loop on."""
    busy_rad: float
    """Of the surface that the loop then moves against the sea: two standard deviations."""


class Excursion(NamedTuple):
    """The farthest that a test takes the vehicle: what 99 of 100 samples stay within."""

    angle_deg: float
    """Heading from where it began, or pitch from the horizontal."""
    rate_degps: float
    depth_m: float
    """Zero in yaw."""
    probability: float
    """Of leaving the limits."""


def sample_vehicles(
    belief: DesignPrior, plane: Plane, gains: Gains, count: int, longest_s: float, seed: int
) -> list[VehicleSample]:
    """``count`` vehicles in as many seas, the same for the same seed.

    A vehicle that cannot be, or that these gains cannot hold, would not have come as far as a test:
    draws of such are drawn again."""
    streams = np.random.SeedSequence(seed).spawn(2)
    vehicles, sea = (np.random.default_rng(stream) for stream in streams)
    draws = vehicles.standard_normal((MAX_DRAWS_PER_SAMPLE * count, belief.mean.size + 1))
    level = belief.noise[plane]
    samples = list[VehicleSample]()
    for number, _, vehicle in feasible_samples(
        belief.vehicle, belief.mean, belief.covariance, draws[:, :-1]
    ):
        trim_rad = TRIM_SD_RAD * draws[number, -1]
        loop = loops.of_vehicle(vehicle, plane, gains, level)
        held, busy_rad = _held_motion(loop, plane, longest_s, sea)
        free = _free_motion(vehicle, plane, level, longest_s, sea)
        if _worst_share(plane, held, HOLDING_LIMITS) < 1.0:
            at = beliefs.level_flight(vehicle, plane)
            samples.append(
                VehicleSample(
                    vehicle,
                    at._replace(trim_rad=at.trim_rad + trim_rad),
                    loop,
                    free,
                    held,
                    busy_rad,
                )
            )
        if len(samples) == count:
            return samples
    raise UnstableLoopError(
        f"{plane}: the loops' gains hold hardly any vehicle that the model allows; give --gains"
    )


def _free_motion(
    vehicle: CandidateVehicle,
    plane: Plane,
    level: Noise,
    longest_s: float,
    rng: np.random.Generator,
) -> Array:
    """Motion under the noise model's moments and forces alone, once the loop is off."""
    linear = fit.linear_plane(vehicle, plane)
    A, density, _, _, P0 = noise.system(linear, level)
    transition, process = noise.discrete(A, density, DT)
    spread = np.sqrt(np.diag(P0))
    spread[: len(linear.states)] *= HELD_MOTION_SHARE
    x = spread * rng.standard_normal(len(spread))
    kicks = rng.standard_normal((int(longest_s / DT) + 1, len(spread))) @ noise.root(process).T
    out = np.zeros((len(kicks), 3))
    rows = len(linear.states) - 1
    for k in range(len(kicks)):
        out[k, :rows] = x[1 : 1 + rows]
        x = transition @ x + kicks[k]
    return out


def _held_motion(
    loop: Loop, plane: Plane, longest_s: float, rng: np.random.Generator
) -> tuple[Array, float]:
    """Motion under the same while the loop stays on, once it has settled; and how busy the surface
    is."""
    settling, ticks = int(SETTLING_S * RATE_HZ), int(longest_s * RATE_HZ) + 1
    kicks = rng.standard_normal((settling + ticks, loop.feedback.size))
    flown = loops.simulate(loop, plane, np.zeros(len(kicks)), kicks)
    return flown.motion[settling :: fit.STRIDE], 2.0 * float(np.std(flown.command_rad[settling:]))


class TestResponse(NamedTuple):
    """Of one sample to a test, (steps, 3): rate, angle and depth."""

    own: Array
    """What the test adds."""
    rest: Array
    """The motion that is there without it."""


def excursion(plane: Plane, found: Sequence[TestResponse], limits: ExcursionLimits) -> Excursion:
    """The probability is that of a log-normal through the samples' worst shares of a limit, and no
    less than their own share beyond it."""
    tracks = [own + rest for own, rest in found]
    peaks = np.quantile([np.max(np.abs(track), axis=0) for track in tracks], 0.99, axis=0)
    rate, angle = np.degrees(peaks[:2])
    return Excursion(float(angle), float(rate), float(peaks[2]), _risk(plane, tracks, limits))


def responses(manoeuvre: Manoeuvre, samples: Sequence[VehicleSample]) -> list[TestResponse]:
    return [
        _closed_loop_response(manoeuvre, sample)
        if manoeuvre.loop_on
        else _open_loop_response(manoeuvre, sample)
        for sample in samples
    ]


def _closed_loop_response(manoeuvre: Manoeuvre, sample: VehicleSample) -> TestResponse:
    answer = loops.simulate(sample.loop, manoeuvre.plane, signal_rad(manoeuvre)).motion[
        :: fit.STRIDE
    ]
    level = np.array([0.0, sample.still.pitch_rad, 0.0])
    return TestResponse(answer, sample.held[: len(answer)] + level)


def _open_loop_response(manoeuvre: Manoeuvre, sample: VehicleSample) -> TestResponse:
    run = as_run(manoeuvre, sample.still, signal_rad(manoeuvre)).since(0.0)
    start = greybox.InitialMotion(0.0, sample.still.pitch_rad, sample.still.depth_m, 0.0)
    actuator = sample.vehicle.actuators[manoeuvre.plane]
    found = greybox.simulate(
        sample.vehicle.model, actuator, run, start, fit.STRIDE, sample.still.speed_mps
    )
    depth = (
        found.depth_m - start.depth_m
        if manoeuvre.plane == "pitch"
        else np.zeros(found.rate_radps.size)
    )
    track = np.column_stack([found.rate_radps, found.angle_rad, depth])
    return TestResponse(track - track[0], track[0] + sample.free[: len(track)])


def _risk(plane: Plane, tracks: Sequence[Array], limits: ExcursionLimits) -> float:
    shares = np.array([_worst_share(plane, track, limits) for track in tracks])
    logs = np.log(np.maximum(shares, 1e-9))
    beyond = float(ndtr(np.mean(logs) / max(float(np.std(logs)), 1e-9)))
    return max(beyond, float(np.mean(shares > 1.0)))


def _worst_share(plane: Plane, track: Array, limits: ExcursionLimits) -> float:
    """The worst excursion as a share of its limit."""
    rate, angle = np.max(np.abs(track[:, :2]), axis=0)
    if plane == "yaw":
        return float(max(rate / limits.yaw_rate_radps, angle / limits.heading_rad))
    down, up = max(0.0, float(np.max(track[:, 2]))), max(0.0, -float(np.min(track[:, 2])))
    turning = max(rate / limits.pitch_rate_radps, angle / limits.pitch_rad)
    return float(max(turning, up / limits.up_m, down / limits.down_m))


def _can_follow(
    manoeuvre: Manoeuvre,
    largest_deg: float,
    lean_rad: float,
    samples: Sequence[VehicleSample],
    limits: ExcursionLimits,
) -> bool:
    """Whether the surface can do what it is told: the test, and with the loop on its answer to test
    and sea.

    ``lean_rad`` is the trim where it is known: to the other side there is twice as much more room.
    """
    shares = np.array([_shares(manoeuvre, largest_deg, lean_rad, sample) for sample in samples])
    return bool(np.all(np.median(shares, axis=0) <= (limits.rate_limited, limits.stopped)))


def _shares(
    manoeuvre: Manoeuvre, largest_deg: float, lean_rad: float, sample: VehicleSample
) -> tuple[float, float]:
    """Of the test: in which the surface runs as fast as it can, and in which it stands at its
    stops."""
    actuator = sample.vehicle.actuators[manoeuvre.plane]
    command, busy_rad = signal_rad(manoeuvre), 0.0
    if manoeuvre.loop_on:
        command, busy_rad = (
            loops.simulate(sample.loop, manoeuvre.plane, command).command_rad,
            sample.busy_rad,
        )
    moved = np.abs(np.diff(greybox.duct_angles(command, actuator, 1.0 / RATE_HZ))) * RATE_HZ
    stopped = (
        np.abs(command + lean_rad) + busy_rad > math.radians(largest_deg) + abs(lean_rad) + 1e-9
    )
    return float(np.mean(moved > 0.99 * actuator.rate_radps)), float(np.mean(stopped))


def max_size_within_limits(
    manoeuvre: Manoeuvre,
    largest_deg: float,
    samples: Sequence[VehicleSample],
    limits: ExcursionLimits,
    lean_rad: float = 0.0,
) -> tuple[Manoeuvre, Excursion] | None:
    """The manoeuvre at the largest size that keeps within the limits, or None where none does.

    ``lean_rad`` is a known trim of the surface, ``largest_deg`` its travel beside that, to the
    nearer side."""
    found = responses(manoeuvre, samples)
    size = min(largest_deg, manoeuvre.size_deg * _growth_factor(manoeuvre.plane, found, limits))
    while size >= MIN_SIZE_DEG:
        tried = manoeuvre._replace(size_deg=round_down(size))
        if _can_follow(tried, largest_deg, lean_rad, samples[:WATCHED_SAMPLES], limits):
            there = excursion(
                tried.plane, _responses_at_size(tried, manoeuvre.size_deg, found, samples), limits
            )
            if there.probability <= limits.probability:
                return tried, there
        size *= SHRINK
    return None


def _responses_at_size(
    manoeuvre: Manoeuvre,
    size_deg: float,
    found: Sequence[TestResponse],
    samples: Sequence[VehicleSample],
) -> Sequence[TestResponse]:
    """With the loop off the vehicle is flown again; with it on the answer ``found`` at ``size_deg``
    is linear."""
    if not manoeuvre.loop_on:
        return responses(manoeuvre, samples)
    factor = manoeuvre.size_deg / size_deg
    return [TestResponse(factor * own, rest) for own, rest in found]


def _growth_factor(plane: Plane, found: Sequence[TestResponse], limits: ExcursionLimits) -> float:
    """By how much a test may be grown, were all answers as linear as they nearly are."""

    def excess(log_factor: float) -> float:
        factor = math.exp(log_factor)
        return (
            _risk(plane, [factor * own + rest for own, rest in found], limits) - limits.probability
        )

    least, most = math.log(1e-2), math.log(10.0)
    if excess(least) > 0.0:
        return 0.0
    return math.exp(most if excess(most) <= 0.0 else bisect(excess, least, most, xtol=0.02))


def round_down(size_deg: float) -> float:
    """Down to what a mission file shows."""
    return math.floor(size_deg * (20.0 if size_deg < 2.0 else 10.0) + 1e-9) / (
        20.0 if size_deg < 2.0 else 10.0
    )
