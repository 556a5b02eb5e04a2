"""Campaigns of linear vehicles with known noise, for which the Cramer-Rao bound is exact.

A trial is one campaign of a plane: ten tests of about the paper's test time, simulated with the
linearised plane of the study's true vehicle.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from benchmarks.identification import vehicles
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import records, response
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.records import LinearPrior, LinearRun
from sysid.estimation.linear.response import SurfaceCommand
from sysid.estimation.map.datasets import STEP_S
from sysid.estimation.map.problem import Prior
from sysid.models import noise, parameters
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane
from tests.sysid import sea

Array = NDArray[np.float64]
Draw = Callable[[LinearPlane, list[int], np.random.Generator], list[Array]]
"""(plane, steps per run, generator) -> noise on the outputs of each run, shape (steps, outputs)."""

WHITE = Noise(rate_radps=math.radians(0.3), angle_rad=math.radians(0.3), depth_m=0.03)
"""Sensor noise; its disturbance levels are not used."""
COLOURED = Noise(
    rate_radps=math.radians(0.15),
    angle_rad=math.radians(0.15),
    depth_m=0.02,
    slow_radps2=math.radians(0.2),
    slow_time_s=4.0,
    wave_radps2=math.radians(0.25),
    wave_frequency_hz=0.13,
    wave_damping=0.07,
    force_mps15=0.002,
)
"""Levels different from the initial values of the estimators."""
STEADY = 0.3
"""Initial state of a run over the estimators' initial standard deviation: control was active."""
APPROACH_S, AFTER_S = 5.0, 8.0
"""Straight parts before and after the signal."""
GROWTH = 0.12
"""Instability (1/s) above which tests are shortened in proportion, as safety limits would do."""
BIAS_RAD, LEVEL_RAD = math.radians(0.7), math.radians(1.0)


class Campaign(NamedTuple):
    """One campaign of a plane."""

    truth: LinearModel
    records: list[LinearRun]
    belief: LinearPrior
    """Plane of the prior file, with the lag as measured by one bench test."""


def campaign(
    vehicle: str,
    plane: Plane,
    draw: Draw,
    seed: int,
    tests: tuple[SurfaceCommand, ...] | None = None,
) -> Campaign:
    """Simulate tests of one plane, by default the usual ten, with noise from ``draw``."""
    truth, rng = true_plant(vehicle, plane), np.random.default_rng([seed, PLANES[plane].index])
    by, linear, count = (
        response.discretise(truth),
        plants.linear_plane(truth),
        PLANES[plane].n_outputs,
    )
    tests = tests or commands(vehicle, plane)
    rest = np.zeros(len(by.transition))
    clean = [response.outputs(truth, by, command, rest, count) for command in tests]
    noises = draw(linear, [response.steps(command) for command in tests], rng)
    flown = [LinearRun(command, y + e) for command, y, e in zip(tests, clean, noises, strict=True)]
    return Campaign(truth, flown, _bench_tested(prior_belief(vehicle, plane), truth, rng))


def white(linear: LinearPlane, steps: list[int], rng: np.random.Generator) -> list[Array]:
    """Draw white sensor noise, with initial states and gyro biases of the noise model."""
    silent = WHITE._replace(slow_radps2=0.0, wave_radps2=0.0, force_mps15=0.0)
    return _drawn(linear, silent, steps, rng, drifts=False)


def coloured(linear: LinearPlane, steps: list[int], rng: np.random.Generator) -> list[Array]:
    """Draw the disturbances of the noise model, with levels of their own."""
    return _drawn(linear, COLOURED, steps, rng)


def misspecified(linear: LinearPlane, steps: list[int], rng: np.random.Generator) -> list[Array]:
    """Draw swell that the noise model lacks: eight tones about a random centre frequency."""
    silent = COLOURED._replace(wave_radps2=0.0, force_mps15=0.0)
    base = _drawn(linear, silent, steps, rng)
    return [sensed + _swell(linear, len(sensed), rng)[:, : sensed.shape[1]] for sensed in base]


def _drawn(
    linear: LinearPlane,
    level: Noise,
    steps: list[int],
    rng: np.random.Generator,
    *,
    drifts: bool = True,
) -> list[Array]:
    """Simulate the noise model's state-space system, all runs in parallel.

    x(k+1) = Phi x(k) + w, w ~ N(0, Q);  y = C x + v, v ~ N(0, R);  x(0) ~ N(0, P0), where the
    vehicle's states are scaled by STEADY. Without ``drifts`` the measured angle does not drift.
    """
    A, density, C, R, P0 = noise.system(linear, level)
    if not drifts:
        C[1, 3:] = 0.0  # the angle is state 2
    Phi, Q = noise.discrete(A, density, STEP_S)
    runs, n = len(steps), len(A)
    values, vectors = np.linalg.eigh(Q)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    start = np.sqrt(np.diag(P0))
    start[: len(linear.A)] *= STEADY
    x = start * rng.standard_normal((runs, n))
    out = np.empty((runs, max(steps), len(C)))
    for k in range(max(steps)):
        out[:, k] = x @ C.T
        x = x @ Phi.T + rng.standard_normal((runs, n)) @ root.T
    out += np.sqrt(np.diag(R)) * rng.standard_normal(out.shape)
    return [run[:length] for run, length in zip(out, steps, strict=True)]


def _swell(linear: LinearPlane, steps: int, rng: np.random.Generator) -> Array:
    """Return rate, angle and depth (zero in yaw) due to eight wave tones, shape (steps, 3)."""
    tones = 2.0 * math.pi * rng.uniform(0.1, 0.2) * rng.uniform(0.7, 1.3, 8)
    sizes, phases = rng.rayleigh(1.0, 8) / 4.0, rng.uniform(0.0, 2.0 * math.pi, (2, 8))
    time_s = STEP_S * np.arange(steps)[:, None]
    moment = COLOURED.wave_radps2 * (sizes * np.sin(tones * time_s + phases[0])).sum(axis=1)
    force = SWELL_MPS2 * (sizes * np.sin(tones * time_s + phases[1])).sum(axis=1)
    n = len(linear.A)
    pushed = np.zeros((n + 2, n + 2))
    pushed[:n, :n], pushed[:n, n] = linear.A * STEP_S, linear.moment * STEP_S
    pushed[0, n + 1] = STEP_S
    over = expm(pushed)[:n]
    x = np.zeros((steps, n))
    for k in range(steps - 1):
        x[k + 1] = over[:, :n] @ x[k] + over[:, n] * moment[k] + over[:, n + 1] * force[k]
    return np.column_stack([x[:, 1:], np.zeros((steps, 4 - n))])


SWELL_MPS2 = 0.01
"""Root mean square of the lateral acceleration due to waves, 7 N on Caribou."""


@cache
def true_plant(vehicle: str, plane: Plane) -> LinearModel:
    """Return the linearised plane of the true vehicle, with residual trim errors."""
    flies = vehicles.case(vehicle)
    found = plants.of_vehicle(vehicles.nominal(flies.truth), plane)
    values = found.values.copy()
    values[plants.names(plane).index("bias_rad")] = BIAS_RAD * flies.scale(plane)
    if plants.OFFSETS[plane]:
        values[-1] = LEVEL_RAD
    return LinearModel(found.frame, values)


@cache
def prior_belief(vehicle: str, plane: Plane) -> LinearPrior:
    """Return the prior of the vehicle file with zero bias and zero level pitch."""
    prior = Prior(
        vehicles.case(vehicle).prior,
        {Plane.YAW: 0.0, Plane.PITCH: 0.0},
        np.zeros(len(NAMES)),
        parameters.prior_covariance(),
    )
    found = records.linear_prior(prior, plane)
    values = found.model.values.copy()
    values[plants.names(plane).index("bias_rad")] = 0.0
    return records.with_bounds(LinearModel(found.model.frame, values), found.covariance)


def _bench_tested(belief: LinearPrior, truth: LinearModel, rng: np.random.Generator) -> LinearPrior:
    """Return the prior with the lag of a simulated bench test."""
    lag = plants.lag(truth.frame.plane)
    values = belief.model.values.copy()
    frame = belief.model.frame
    values[lag] = truth.values[lag] * (1.0 + frame.lag_relative_sd * rng.standard_normal(2))
    return records.with_bounds(LinearModel(frame, values), belief.covariance)


@cache
def commands(vehicle: str, plane: Plane) -> tuple[SurfaceCommand, ...]:
    """Return slow and fast 3-2-1-1 and doublets and two steps, scaled to the vehicle's prior."""
    size = vehicles.case(vehicle).scale(plane)
    slow = plants.small_signal(true_plant(vehicle, plane)).p_slow_per_s
    pace = min(1.0, GROWTH / slow) if slow > 0.0 else 1.0
    kinds = (
        (6.0, 2.5, (3, -2, 1, -1)),
        (9.0, 1.5, (3, -2, 1, -1)),
        (6.0, 5.0, (1, -1)),
        (9.0, 2.5, (1, -1)),
        (6.0, 20.0, (1,)),
    )
    return tuple(
        _command(sign * size * degrees, unit_s * pace, shape)
        for degrees, unit_s, shape in kinds
        for sign in (1.0, -1.0)
    )


def _command(degrees: float, unit_s: float, shape: tuple[int, ...]) -> SurfaceCommand:
    """Return pulses of ``abs(count)`` units between straight parts."""
    pulses = [
        sea.step(math.copysign(degrees, count * degrees), abs(count) * unit_s) for count in shape
    ]
    return SurfaceCommand(
        np.concatenate([sea.step(0.0, APPROACH_S), *pulses, sea.step(0.0, AFTER_S)])
    )
